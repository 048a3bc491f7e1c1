"""From the words of an experiment to the plan of a run."""

from __future__ import annotations

import os
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.clock import LatePolicy
from rds.core.errors import InputError
from rds.core.folder_kept import folder_kept
from rds.core.last_made import LastMade
from rds.core.toml_table import TomlTable
from rds.core.types import Controller
from rds.machines import Axis, Machine, load_machine
from rds.modes import load_mode
from rds.modes.experiment.bus_table import bus_commands, bus_table
from rds.modes.experiment.compensation import compensated
from rds.modes.experiment.drives import (
    check_reference,
    drive_model,
    gives_way,
    giving_way,
    top_speed,
)
from rds.modes.experiment.experiment_file import AXIS_KEYS, PATHS, is_path
from rds.modes.experiment.parts import Setting, make_controller, make_drive, make_model, named
from rds.modes.loop.commands import Command
from rds.modes.loop.following_error import ErrorLimits
from rds.modes.loop.laws import ReferenceSamples
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import AxisPlan, Plan
from rds.modes.loop.program import InterpolatedProgram, Program
from rds.network.network_file import read_network

MOST_SAMPLES = 20_000_000


@folder_kept()
def resolve(
    words: TomlTable,
    folder: Path,
    mode_name: str | None = None,
    program: Program | InterpolatedProgram | None = None,
    planned: LastMade | None = None,
) -> tuple[Plan, dict[str, Any]]:
    """The plan of the experiment, in `mode_name` if that is given, and what is known of it for the result's meta.

    With a part program, that drives its axes and the spindle: the words say their controllers, and no reference.
    `planned` keeps the motion of a path from one time to the next.
    Raises InputError with file, line, key, value and remedy for anything that will not do.
    """
    words.read("title")
    machine = _machine(words, folder)
    written = words.read("mode")
    mode = load_mode(written if mode_name is None else mode_name)
    T = words.read("sample_period", machine.sample_period)
    drawn, own_files = _path(words, folder, machine, T, planned or LastMade()) if program is None else (None, ())
    leads = program or drawn
    samples = _samples(words, T) if leads is None else leads.samples
    words.read("compiled")
    saturation, quantization = _interface(words, mode)
    limit = machine.converter.range if saturation else inf
    timing = _timing(words, mode)
    driven = _drive(words, mode) if program is None else _program(words, mode)
    if drawn is not None:
        driven = "program"
    bus = bus_table(words, folder, machine)
    axes, periods, notes = [], {}, []
    every = _axes(words, machine) if program is None else _program_axes(words, machine, program)
    commands = bus_commands(words, bus, machine, [axis.name for axis, _ in every], driven)
    for axis, own in every:
        if drawn is not None and own is not words and "reference" in own.table:
            raise InputError("the path drives all axes of the run: remove this reference", own.place("reference"))
        command = commands[axis.name]
        speed = top_speed(axis, machine)
        most = limit if command is Command.VOLTAGE else speed if saturation else inf
        on_bus = mode.drivers == "live" and not gives_way(axis, command)
        setting = Setting(axis, T, most, folder, command, speed, on_bus)
        made, periods[axis.name], note = _axis_plan(own, setting, driven, samples)
        axes.append(made)
        notes += [note] if note else []
    if isinstance(leads, Program):
        notes += machine.too_fast(each.axis.name for each in axes if each.command is Command.VOLTAGE)
    network = read_network(words, folder)
    words.done()
    _check_coupling(axes, words)
    plan = Plan(
        mode=mode.name,
        machine=machine,
        axes=tuple(axes),
        T=T,
        samples=samples,
        saturation=saturation,
        quantization=quantization,
        bus=bus,
        network=network,
        import_path=_import_path(axes, own_files),
        program=leads,
        notes=tuple(notes),
        **timing,
    )
    return plan, {"period": periods}


def _path(
    words: TomlTable, folder: Path, machine: Machine, T: float, planned: LastMade
) -> tuple[InterpolatedProgram | Program | None, tuple[str, ...]]:
    """The path that all axes of the run follow, and the files of its interpolators that the user wrote."""
    given = words.any("reference")
    if not is_path(given):
        return None, ()
    for key, why in (
        ("signal", "a signal drives the axes without a controller"),
        ("duration", "the path says how long the run lasts"),
    ):
        if key in words:
            raise InputError(f"{why}: remove {key}, or the path", words.place(key))
    table = words.inner("reference")
    assert table is not None
    kind = table.read("kind")
    table.declared = PATHS.module(kind).WORDS
    names = [axis.name for axis, _ in _axes(words, machine)]
    try:
        made: tuple[InterpolatedProgram | Program, tuple[str, ...]]
        made = PATHS.module(kind).program(table, folder, machine, names, T, planned)
    except InputError as error:
        raise error if error.where else InputError(str(error), table.place()) from error
    return made


def _samples(words: TomlTable, T: float) -> int:
    if "duration" not in words:
        raise words.missing("duration")
    duration = words.read("duration")
    samples: int = round(duration / T)
    if duration < T * (1.0 - 1e-9):
        raise words.fault("duration", f"s must be at least one sample period, {T:g} s")
    if samples > MOST_SAMPLES:
        raise words.fault("duration", f"s makes {samples} samples of {T:g} s; it takes at most {MOST_SAMPLES}")
    return samples


def machine_name(words: TomlTable, folder: Path) -> str:
    """The machine's name, or the path of its file, which an experiment names as seen from its own folder."""
    name: str = words.read("machine")
    return str(folder / name) if name.endswith(".toml") else name


def _machine(words: TomlTable, folder: Path) -> Machine:
    name = machine_name(words, folder)
    try:
        return load_machine(name)
    except InputError as error:
        raise error if error.where else InputError(str(error), words.place("machine")) from error


def _axes(words: TomlTable, machine: Machine) -> list[tuple[Axis, TomlTable]]:
    """Each axis of the run with its words: its own tables over the general ones."""
    given, several = words.any("axis"), words.any("axes")
    if given is not None and not isinstance(given, str | dict):
        raise words.fault(
            "axis", f"must be the name of an axis in quotes; {machine.name} has {', '.join(machine.axes)}"
        )
    if several is None:
        if not isinstance(given, str):
            raise InputError('axis is missing; as in `axis = "X"`, or `axes = ["X", "Y"]` for several', words.place())
        several = [given]
    elif isinstance(given, str):
        raise InputError("axis and axes both say which axes run; give one of them", words.place("axis"))
    if not isinstance(several, list) or not several or not all(isinstance(name, str) for name in several):
        raise words.fault("axes", f"must be a list of axis names; {machine.name} has {', '.join(machine.axes)}")
    if len(set(several)) != len(several):
        raise words.fault("axes", "names an axis twice")
    key = "axes" if "axes" in words.table else "axis"
    for name in several:
        if name not in machine.axes:
            remedy = f"names {name!r}, which machine {machine.name!r} does not have; it has {', '.join(machine.axes)}"
            raise words.fault(key, remedy)
    return _with_words(words, machine, several)


def _with_words(words: TomlTable, machine: Machine, several: list[str]) -> list[tuple[Axis, TomlTable]]:
    """Each axis with its own tables over the general ones."""
    given = words.any("axis")
    for key in AXIS_KEYS:
        _ = key in words  # known even where every axis has its own
    overrides = words.inner("axis") if isinstance(given, dict) else None
    for name in overrides.table if overrides else ():
        if name not in several:
            text = f"[axis.{name}] is for an axis that does not run; axes = {several}"
            raise InputError(text, overrides.place(name) if overrides else None)
    return [(machine.axes[name], _own_words(words, overrides, name)) for name in several]


def _own_words(words: TomlTable, overrides: TomlTable | None, name: str) -> TomlTable:
    own = overrides.inner(name) if overrides else None
    if own is None:
        return words
    own = own.over(words, AXIS_KEYS)
    for key in AXIS_KEYS:
        _ = key in own
    return own


def _drive(words: TomlTable, mode: Mode) -> str:
    """Whether controllers or voltage signals drive this run."""
    overrides = words.table.get("axis")
    tables = [words.table, *(overrides.values() if isinstance(overrides, dict) else ())]
    has = {key: any(isinstance(table, dict) and key in table for table in tables) for key in AXIS_KEYS}
    controlled = has["reference"] or has["controller"]
    if controlled and has["signal"]:
        raise InputError(
            "[signal] drives the axes without a controller; give either [signal], or [reference] and [controller]",
            words.place("signal"),
        )
    if has["signal"] and "signal" not in mode.drives:
        raise InputError(f"mode {mode.name} needs [reference] and [controller], not [signal]", words.place("signal"))
    if not has["signal"] and "controller" not in mode.drives:
        raise InputError(
            f"mode {mode.name} sends a voltage signal: give [signal] (kind, amplitude in V, frequency in Hz) "
            "instead of [reference] and [controller]",
            words.place("mode"),
        )
    return "signal" if has["signal"] else "controller"


def _axis_plan(
    words: TomlTable, setting: Setting, driven: str, samples: int
) -> tuple[AxisPlan, float | None, str | None]:
    """One axis's plan, its reference's period, and a note for the result."""
    axis, command = setting.axis, setting.command
    times = np.arange(samples) * setting.T
    own = command is Command.VOLTAGE or words.any("model") is not None
    model = make_model(words, setting) if own else drive_model(axis, command)
    controller = period = note = None
    if driven != "signal" and (words.any("controller") is not None or not gives_way(axis, command)):
        controller = make_controller(words, setting, model)
    if gives_way(axis, command):
        controller, note = giving_way(axis, command, controller)
    if (table := words.inner("error_compensation")) is not None:
        controller = _compensated(table, setting, controller)
    watched = _following_error(words, setting, driven)
    most = setting.limit if command is Command.VELOCITY else inf
    if driven == "program":
        plan = AxisPlan(axis, model, controller, command=command, most_target=most, following_error=watched)
    elif driven == "signal":
        if "signal" not in words:
            raise InputError(f"axis {axis.name} has no [signal]{words.slip('signal')}", words.place())
        signal = make_drive(words, "signal", setting, "V")
        plan, period = AxisPlan(axis, model, signal=signal.value(times).tolist()), signal.period
    else:
        if "reference" not in words:
            said = f'axis {axis.name} has no [reference]; as in `kind = "sinusoid"`{words.slip("reference")}'
            raise InputError(said, words.place())
        reference = make_drive(words, "reference", setting, axis.unit)
        samples_of = ReferenceSamples(*(np.asarray(part, dtype=float) for part in reference.reference(times)))
        _check_travel(samples_of, axis, words)
        with named(words.table_of("reference", {})):
            check_reference(samples_of, axis, command, setting.top_speed, setting.T)
        plan = AxisPlan(axis, model, controller, samples_of, command=command, most_target=most, following_error=watched)
        period = reference.period
    if words.name:
        words.done()
    return plan, period, note


def _compensated(table: TomlTable, setting: Setting, controller: Controller | None) -> Controller | None:
    """The controller with error compensation; that of a spindle as it is."""
    axis = setting.axis
    time, most = table.read("time"), table.read("most")
    table.done()
    if controller is None:
        raise InputError("[signal] drives the axis without a controller: remove [error_compensation]", table.place())
    if controller.coupled:
        raise InputError(
            "[error_compensation] is for axes with controllers of their own; a coupled one does it itself",
            table.place(),
        )
    if setting.command is Command.PROFILE or axis.is_spindle:
        _refuse_own(table, axis, "is for position axes, but not for drives with a profile of their own")
        return controller
    if controller.source.name == "relay":
        raise InputError(
            "[error_compensation] moves the reference, about which the law relay swings; leave it out", table.place()
        )
    return compensated(controller, setting.T, time, most, axis, setting.command)


def _following_error(words: TomlTable, setting: Setting, driven: str) -> ErrorLimits | None:
    """How far the axis may be from its reference; a spindle, whose speed rises as it can, is not watched."""
    if (table := words.inner("following_error")) is None:
        return None
    ferror = table.read("ferror")
    at_rest = table.read("min_ferror", ferror)
    if at_rest > ferror:
        raise table.fault("min_ferror", f"must be at most ferror, {ferror:g}: the error that is allowed at full speed")
    table.done()
    if driven == "signal":
        raise InputError("[signal] drives the axis without a reference: remove [following_error]", table.place())
    if setting.axis.is_spindle:
        _refuse_own(table, setting.axis, "is for position axes")
        return None
    limits = setting.axis.limits
    return ErrorLimits(at_rest, ferror, setting.top_speed if limits is None else limits.velocity)


def _refuse_own(table: TomlTable, axis: Axis, why: str) -> None:
    """InputError for a table of this axis alone, which would change nothing; a general one is for the other axes."""
    if table.name.startswith(f"axis.{axis.name}."):
        raise InputError(f"[{table.name}] {why}: remove it", table.place())


def _program(words: TomlTable, mode: Mode) -> str:
    """What a part program takes the place of is refused."""
    if "controller" not in mode.drives:
        raise InputError(f"mode {mode.name} has no controllers, which a part program needs", words.place("mode"))
    axes = words.any("axis")
    tables = [words, *(filter(None, map(words.table_of("axis", axes).inner, axes)) if isinstance(axes, dict) else ())]
    for table in tables:
        for key in ("reference", "signal", "duration", "axes"):
            if key in table:
                raise InputError(f"the part program says what the axes do: remove {key}", table.place(key))
    return "program"


def _program_axes(
    words: TomlTable, machine: Machine, program: Program | InterpolatedProgram
) -> list[tuple[Axis, TomlTable]]:
    """The axes that a program moves and the spindle, in the machine's order."""
    given = words.any("axis")
    if given is not None and not isinstance(given, dict):
        raise words.fault("axis", "names an axis; the part program drives all of them: remove it")
    used = {*program.axes, program.spindle}
    axes = [name for name in machine.axes if name in used]
    for name in given or ():
        if name not in axes:
            raise InputError(f"the program drives {', '.join(axes)}, and no axis {name!r}", words.place("axis"))
    return _with_words(words, machine, axes)


def _check_travel(reference: ReferenceSamples, axis: Axis, words: TomlTable) -> None:
    low, high = axis.travel
    lowest, highest = reference.position.min(), reference.position.max()
    if lowest < low or highest > high:
        raise InputError(
            f"the reference goes from {lowest:g} to {highest:g} {axis.unit}, "
            f"but axis {axis.name} travels from {low:g} to {high:g} {axis.unit}; bring the reference into that range",
            words.place("reference"),
        )


def _interface(words: TomlTable, mode: Mode) -> tuple[bool, bool]:
    """Whether the simulated converter saturates, and whether it and the encoder quantize."""
    table = words.inner("interface")
    if table is None:
        return True, True
    flags = table.read("saturation"), table.read("quantization")
    table.done()
    for key, on in zip(("saturation", "quantization"), flags, strict=True):
        if not on and mode.drivers == "live":
            raise table.fault(
                key, f"cannot be in mode {mode.name}: the machine has its own converter and encoders; remove it"
            )
    return flags


def _timing(words: TomlTable, mode: Mode) -> dict[str, Any]:
    """Late policy and real-time settings; the mode's own where nothing is said."""
    table = words.inner_or_empty("timing")
    late = table.read("late", "discard" if mode.late.discard else "process")
    phase = table.read("phase", "keep" if mode.late.keep_phase else "ignore")
    stop_after = table.read("stop_after", mode.late.stop_after)
    settings = {
        "late": LatePolicy(late == "discard", phase == "keep", stop_after),
        **{key: table.read(key) for key in ("late_limit", "priority", "cpu")},
    }
    table.done()
    if settings["cpu"] is not None:
        if not hasattr(os, "sched_getaffinity"):
            raise table.fault("cpu", "cannot be chosen on this system, only on Linux; remove it")
        if settings["cpu"] not in (usable := sorted(os.sched_getaffinity(0))):
            raise table.fault("cpu", f"is not a processor that this program may use; it may use {usable}")
    return settings


def _check_coupling(axes: list[AxisPlan], words: TomlTable) -> None:
    """A coupled controller drives all position axes; a spindle may have one of its own, as the first or last axis."""
    together = [plan.controller for plan in axes if plan.controller is not None and plan.controller.coupled]
    if not together:
        return
    same = all(c.source == together[0].source and c.params == together[0].params for c in together)
    apart = [plan for plan in axes if plan.controller is None or not plan.controller.coupled]
    if not same or not all(plan.axis.is_spindle for plan in apart):
        raise InputError(
            "a coupled controller drives all axes of the run, but a spindle; give it in the general [controller] table "
            "only",
            words.place("controller"),
        )
    if any(plan in apart for plan in axes[1:-1]):
        raise InputError("name the spindle last: the axes of a coupled controller stand together", words.place("axes"))


def _import_path(axes: list[AxisPlan], interpolators: tuple[str, ...]) -> tuple[str, ...]:
    paths = [part.source.path for plan in axes for part in (plan.controller, plan.model) if part is not None]
    paths += interpolators
    return tuple(dict.fromkeys(str(Path(path).parent) for path in paths if path and path.endswith(".py")))
