"""Assembly errors of a machine's links, from where the tool's tip was measured to be (mrm-control, section 5).

The tip is measured at joint values all over the workspace, by laser or by gauges. The errors e of the links' six
numbers that bring the machine's own chain nearest to the readings are found by Gauss and Newton's method:

    minimize Σ |p_measured - p(q, e)|²        e <- e + J⁺ (p_measured - p(q, e))

Most errors look alike from the tip: a shift of the tool and one of the slide behind it do the same. J⁺ takes of all
solutions the smallest one, in which a turn counts as the shift that it makes at 100 mm, and leaves out what the
readings show a thousand times less than the rest. The poses are determined by it even where single numbers are not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rds.core.errors import InputError
from rds.machines.kinematics.build import steps_of
from rds.machines.kinematics.chain import joined
from rds.machines.kinematics.kinematics import Kinematics
from rds.machines.link_table import Link
from rds.machines.machine import Machine
from rds.machines.ncc import ScriptLink, joints_of, read_script, script_of_machine, words_of

COORDINATES = "xyz"
_UNIT = np.array([np.degrees(1.0 / 100.0)] * 3 + [1.0] * 3)  # of the six numbers, degrees and mm: alike at 100 mm
_SHOWN = 1e-3  # smallest singular value that counts, of the largest
_STEP = 1e-3  # of a derivative, in _UNIT
_ROUNDS, _SETTLED = 20, 1e-7
_DIGITS = 6


@dataclass(frozen=True)
class Calibration:
    """What was found: six numbers (XA, YA, ZA in degrees, X, Y, Z in mm) by link number, and how well they explain.

    `before` and `after` (readings × coordinates, mm) are the deviations without and with them; `determined` is how
    many of their combinations the readings tell, of the `unknown` numbers.
    """

    errors: Mapping[int, tuple[float, ...]]
    before: np.ndarray
    after: np.ndarray
    determined: int
    unknown: int

    def script(self, about: str = "") -> str:
        """The errors as a configuration script without links: RF03 of each link, and BUILD."""
        head = [f"({about})"] if about else []
        lines = [f"RF03 LN{number} {words_of(errors)}" for number, errors in self.errors.items()]
        return "\n".join([*head, *lines, "BUILD"]) + "\n"


def calibrate(
    machine: Machine,
    joints: np.ndarray,
    tips: Mapping[str, np.ndarray],
    links: Sequence[int] | None = None,
) -> Calibration:
    """The errors of `links` (numbers as `rds machine script` writes them; by default all) of a machine.

    `joints` (n, joints) are in mm and degrees, in the order of the machine's kinematics; `tips` holds (n,) mm of those
    coordinates x, y, z of the tip, relative to the work, that were measured. InputError for links that there are not,
    and for readings that are too few.
    """
    own = read_script(script_of_machine(machine)).links
    chosen = list(range(1, len(own) + 1)) if links is None else sorted(set(links))
    if unknown := [number for number in chosen if not 1 <= number <= len(own)]:
        said = f"there is no link LN{unknown[0]} (LN1 to LN{len(own)})"
        raise InputError(f"{said}; `rds machine script {machine.name}` lists them")
    rows = [COORDINATES.index(name) for name in tips]
    measured = np.column_stack(list(tips.values()))
    start = np.array([own[number - 1].errors for number in chosen])

    def tip(errors: np.ndarray) -> np.ndarray:
        return _tips(_with(own, chosen, errors), machine.kinematics, joints)[:, rows]

    found, determined = start, 0
    before = measured - tip(start)
    for _ in range(_ROUNDS):
        off = measured - tip(found)
        slopes = []
        for place in np.ndindex(found.shape):
            step = np.zeros(found.shape)
            step[place] = _STEP * _UNIT[place[1]]
            slopes.append(((tip(found + step) - tip(found - step)) / (2.0 * _STEP)).ravel())
        change, _, determined, _ = np.linalg.lstsq(np.array(slopes).T, off.ravel(), rcond=_SHOWN)
        if off.size <= determined:
            raise InputError(
                f"{len(off)} readings of {off.shape[1]} coordinates do not tell {determined} errors from noise; "
                "measure at more places, or name fewer links"
            )
        found = found + change.reshape(found.shape) * _UNIT
        if np.abs(change).max(initial=0.0) < _SETTLED:
            break
    found = found.round(_DIGITS) + 0.0
    errors = {number: tuple(map(float, row)) for number, row in zip(chosen, found, strict=True)}
    return Calibration(errors, before, measured - tip(found), int(determined), found.size)


def _with(own: Sequence[ScriptLink], chosen: Sequence[int], errors: np.ndarray) -> list[ScriptLink]:
    made = list(own)
    for number, row in zip(chosen, errors, strict=True):
        made[number - 1] = replace(own[number - 1], errors=tuple(row))
    return made


def _tips(links: Sequence[ScriptLink], kinematics: Kinematics, joints: np.ndarray) -> np.ndarray:
    """(n, 3) mm: where the chain of the links has the tip at the machine's joint values."""
    steps, names = [], iter(joints_of(kinematics))
    numbers = {name: number for number, name in enumerate(kinematics.joints)}
    for link in reversed(links):
        axis = next(names) if link.variable else ""
        six, off = link.numbers, link.errors
        told = Link(
            "", axis=axis, joint=link.variable, angles=(six[0], six[1], six[2]), offset=(six[3], six[4], six[5]),
            error_angles=(off[0], off[1], off[2]), error_offset=(off[3], off[4], off[5]),
        )  # fmt: skip
        steps += steps_of(told, numbers)
    return np.asarray(joined(steps).forward(kinematics.radians(joints))[:, :3, 3])
