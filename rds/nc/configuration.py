"""What a machine's virtual limits and a configuration script at a program's head (option ncc) change for the program.

mrm-control, sections 5 and 6: limits of links, and RF02 of the script, narrow the travel of the joints; RF01 says a
chain, which has to be the machine's; RF03 says its assembly errors, for which the motion is corrected.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.machines import Machine
from rds.machines.kinematics.kinematics import Kinematics
from rds.machines.kinematics.tip import Tip
from rds.machines.link_table import ENTRIES, Link
from rds.machines.ncc import Script, ScriptLink, joints_of, machine_of_script
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError

_NEAR = 1e-3  # mm: how far the tool may stand from where the script has it
_ALONG = 1e-6  # the same of entries of its direction
_POSES = 16


def configured(program: Path, machine: Machine, options: Dialect) -> tuple[Machine, list[ProgramError]]:
    """The machine that the program is checked for and run on, and what is to be noted, by line.

    Its travel is narrowed to the limits of its links and by the script at the program's head, whose assembly errors
    (RF03) it has. A script without links is about the machine's own. A script that is wrong changes nothing: that is
    said, by its line, where the program is read. Raises ProgramError with what differs where the script's chain is not
    the machine's, where a word fits none of its links, and where it cannot be corrected for.
    """
    machine = _within_limits(machine)
    script = _script(program) if options.ncc else None
    if script is None:
        return machine, []
    line = script.built
    name = machine.name
    if script.changes:
        try:
            script = script.over(machine)
        except InputError as error:
            raise _error(program, script.line, str(error).removeprefix(f"{error.where}: ")) from None
    elif not machine.links:
        raise _error(program, line, f"the machine {name} has no links to compare the script with; {_remedy(program)}")
    joints = [(number, link) for number, link in reversed(list(enumerate(script.links, 1))) if link.variable]
    own = machine.kinematics
    names = joints_of(own)
    if len(names) != len(joints):
        said = f"the script has {len(joints)} joints, and {name} has {len(names)} ({', '.join(names)} from the work)"
        raise _error(program, line, f"{said}; {_remedy(program)}")
    for (number, link), joint, axis in zip(joints, own.chain.joints, names, strict=True):
        if (link.variable in ENTRIES[:3]) != joint.turns:
            is_a = "turns" if joint.turns else "shifts"
            said = f"LN{number} ({link.variable}#) is not the joint {axis} of {name}, which {is_a}"
            raise _error(program, link.line, f"{said}; {_remedy(program)}")
    if not script.of and (said := _differs(script, own)):
        raise _error(program, line, f"the script's chain is not that of {name}: {said}; {_remedy(program)}")
    notes, axes = [], dict(machine.axes)
    for (number, link), axis in zip(joints, names, strict=True):
        if link.limits is None:
            continue
        low, high = max(axes[axis].travel[0], link.limits[0]), min(axes[axis].travel[1], link.limits[1])
        if not low < high:
            (a, b), (c, d) = link.limits, axes[axis].travel
            said = f"LN{number} is limited to {a:g} to {b:g}, outside the travel of {axis}, {c:g} to {d:g}"
            raise _error(program, link.line, f"{said}; mend RF02")
        if (low, high) != axes[axis].travel:
            axes[axis] = replace(axes[axis], travel=(low, high))
            said = f"RF02 narrows the travel of {axis} (LN{number}) to {low:g} to {high:g} {axes[axis].unit}"
            notes.append(_error(program, link.line, said))
    wrong = [(number, link) for number, link in enumerate(script.links, 1) if any(link.errors) and link.error_line]
    for number, link in wrong:
        words = " ".join(f"{word}{value:g}" for word, value in zip(ENTRIES, link.errors, strict=True) if value)
        said = f"the motion is corrected for the assembly error that RF03 says of LN{number}, {words}"
        notes.append(_error(program, link.error_line, said))
    made = replace(machine, axes=axes)
    if not wrong:
        return made, notes
    made = replace(made, links=_links(script, names), tool=None, work=None)
    try:
        Tip(made.kinematics)
    except InputError as error:
        said = f"the motion cannot be corrected for RF03: {error.args[0]}; remove it"
        raise _error(program, wrong[0][1].error_line, said) from None
    return made, notes


def corrects(program: Path, options: Dialect) -> bool:
    """Whether a script at the program's head says assembly errors."""
    script = _script(program) if options.ncc else None
    return script is not None and script.corrects


def _within_limits(machine: Machine) -> Machine:
    """The machine with the travel of its axes narrowed to the limits of their links, the operational workspace."""
    limits = {link.axis: link.limits for link in machine.links if link.axis and link.limits}
    if not limits:
        return machine
    axes = {name: replace(axis, travel=limits.get(name, axis.travel)) for name, axis in machine.axes.items()}
    return replace(machine, axes=axes)


def _links(script: Script, names: list[str]) -> tuple[Link, ...]:
    """The script's links with the machine's names of axes, given in the order from the work."""
    told = machine_of_script(_bounded(script.links))
    kinematics = told.kinematics
    own = dict(zip([kinematics.joints[joint.number] for joint in kinematics.chain.joints], names, strict=True))
    return tuple(replace(link, axis=own[link.axis]) if link.axis else link for link in told.links)


def _script(program: Path) -> Script | None:
    script = Script(str(program))
    try:
        with program.open("rb") as stream:
            for number, raw in enumerate(stream, 1):
                if not script.take(raw.decode("latin-1"), number):
                    break
    except (InputError, OSError):  # said where the program is read
        return None
    return script if script.built else None


def _differs(script: Script, own: Kinematics) -> str:
    """How the poses of the script's chain differ from the machine's, with or without its assembly errors."""
    found = [_away(script.links, own), _away([replace(link, errors=(0.0,) * 6) for link in script.links], own)]
    at_zero, far, turned = min(found, key=lambda each: (each[1] > _NEAR or each[2] > _ALONG, each[1]))
    if far <= _NEAR and turned <= _ALONG:
        return ""
    if turned > _ALONG:
        return f"the tool's frame is turned against it, and its tip up to {far:.4g} mm away"
    return f"the tool's tip is {at_zero:.4g} mm away with all joints at zero, and up to {far:.4g} mm elsewhere"


def _away(links: list[ScriptLink], own: Kinematics) -> tuple[float, float, float]:
    """mm between the tips with all joints at zero, the most of them at random poses, and of entries of the turn."""
    told = machine_of_script(_bounded(links)).kinematics
    q = np.concatenate([np.zeros((1, len(own.joints))), own.random(_POSES, seed=5)])
    theirs = np.empty_like(q)
    for joint, mine in zip(told.chain.joints, own.chain.joints, strict=True):
        theirs[:, joint.number] = q[:, mine.number]
    apart = told.forward(theirs) - own.forward(q)
    far = np.linalg.norm(apart[:, :3, 3], axis=1)
    return float(far[0]), float(far.max()), float(np.abs(apart[:, :3, :3]).max())


def _bounded(links: list[ScriptLink]) -> Script:
    """The links as a script whose joints all have limits, without which no machine is made of it."""
    return Script("", [replace(link, limits=(-1.0, 1.0)) if link.variable else link for link in links], 1)


def _remedy(program: Path) -> str:
    return f"name the machine that the script says (`rds machine new` makes one of it), or mend {program.name}"


def _error(program: Path, line: int, said: str) -> ProgramError:
    return ProgramError(said, file=str(program), line=line)
