"""From the words of an experiment to the plan of a run."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.clock import LatePolicy
from rds.core.errors import InputError
from rds.experiment.parts import Setting, make_controller, make_drive, make_model
from rds.experiment.words import Words
from rds.machines import Axis, Machine, load_machine
from rds.modes import load_mode, mode_names
from rds.runtime.laws import ReferenceSamples
from rds.runtime.mode import Mode
from rds.runtime.plan import AxisPlan, Plan

MOST_SAMPLES = 20_000_000
_AXIS_WORDS = ("reference", "signal", "controller", "model")


def resolve(words: Words, folder: Path, mode_name: str | None = None) -> tuple[Plan, dict[str, Any]]:
    """The plan of the experiment, in `mode_name` if that is given, and what is known of it for the result's meta.

    Raises InputError with file, line, key, value and remedy for anything that will not do.
    """
    words.text("title")
    machine = _machine(words, folder)
    written = words.choice("mode", "simulation", mode_names())
    mode = load_mode(mode_name or written)
    T = words.number("sample_period", machine.sample_period, "s", more_than=0)
    duration = words.number("duration", None, "s", more_than=0)
    samples = round(duration / T)
    if not 1 <= samples <= MOST_SAMPLES:
        raise words.fault("duration", f"s makes {samples} samples of {T:g} s; it takes 1 to {MOST_SAMPLES}")
    words.flag("compiled", False)
    saturation, quantization = _interface(words)
    limit = machine.converter.range if saturation else inf
    timing, bus = _timing(words, mode), words.inner("bus")
    axes, periods = [], {}
    driven = _drive(words, mode)
    for axis, own in _axes(words, machine):
        plan, period = _axis_plan(own, Setting(axis, T, limit, folder), driven, samples)
        axes.append(plan)
        periods[axis.name] = period
    words.any("axis")
    words.done()
    _check_coupling(axes)
    plan = Plan(
        mode=mode.name,
        machine=machine,
        axes=tuple(axes),
        T=T,
        samples=samples,
        saturation=saturation,
        quantization=quantization,
        bus=dict(bus.table) if bus else {},
        import_path=_import_path(axes),
        **timing,
    )
    return plan, {"period": periods}


def _machine(words: Words, folder: Path) -> Machine:
    name = words.text("machine", "mini-cnc") or ""
    try:
        return load_machine(str(folder / name) if name.endswith(".toml") else name)
    except InputError as error:
        raise error if error.where else InputError(str(error), words.place("machine")) from error


def _axes(words: Words, machine: Machine) -> list[tuple[Axis, Words]]:
    """Each axis of the run with its words: its own tables over the general ones."""
    given = words.table.get("axis")
    several = words.any("axes")
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
    own = words.inner("axis") if isinstance(given, dict) else None
    for name in own.table if own else ():
        if name not in several:
            raise InputError(f"[axis.{name}] is for an axis that does not run; axes = {several}", words.place("axes"))
    chosen = []
    for name in several:
        if name not in machine.axes:
            key = "axes" if "axes" in words.table else "axis"
            raise words.fault(key, f": machine {machine.name!r} has no axis {name!r}; it has {', '.join(machine.axes)}")
        inner = own.inner(name) if own else None
        chosen.append((machine.axes[name], _merged(words, inner)))
    return chosen


def _merged(words: Words, own: Words | None) -> Words:
    """The axis's own words, and the general ones where it has none."""
    if own is None:
        return words
    for key in _AXIS_WORDS:
        if key not in own and key in words:
            own.table[key] = words.table[key]
    return own


def _drive(words: Words, mode: Mode) -> str:
    """Whether controllers or voltage signals drive this run."""
    overrides = words.table.get("axis")
    tables = [words.table, *(overrides.values() if isinstance(overrides, dict) else ())]
    has = {key: any(isinstance(table, dict) and key in table for table in tables) for key in _AXIS_WORDS}
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


def _axis_plan(words: Words, setting: Setting, driven: str, samples: int) -> tuple[AxisPlan, float | None]:
    axis = setting.axis
    times = np.arange(samples) * setting.T
    model = make_model(words, setting)
    if driven == "signal":
        if "signal" not in words:
            raise InputError(f"axis {axis.name} has no [signal]", words.place())
        signal = make_drive(words, "signal", setting, "V")
        signal.check_sampling(setting.T)
        plan = AxisPlan(axis, model, signal=signal.value(times).tolist())
        words.done() if words.name.startswith("axis.") else None
        return plan, signal.period
    if "reference" not in words:
        raise InputError(f'axis {axis.name} has no [reference]; as in `kind = "sinusoid"`', words.place())
    reference = make_drive(words, "reference", setting, axis.unit)
    signal_place = words.place("reference")
    position, velocity, acceleration = reference.reference(times)
    low, high = axis.travel
    if position.min() < low or position.max() > high:
        raise InputError(
            f"the reference goes from {position.min():g} to {position.max():g} {axis.unit}, "
            f"but axis {axis.name} travels from {low:g} to {high:g} {axis.unit}; reduce the amplitude",
            signal_place,
        )
    controller = make_controller(words, setting, model)
    words.done() if words.name.startswith("axis.") else None
    samples_of = ReferenceSamples(position, velocity, acceleration)
    return AxisPlan(axis, model, controller, samples_of), reference.period


def _interface(words: Words) -> tuple[bool, bool]:
    table = words.inner("interface")
    if table is None:
        return True, True
    flags = table.flag("saturation", True), table.flag("quantization", True)
    table.done()
    return flags


def _timing(words: Words, mode: Mode) -> dict[str, Any]:
    """Late policy and real-time settings; the mode's own where nothing is said."""
    table = words.inner("timing") or Words({})
    late = table.choice("late", "discard" if mode.late.discard else "process", ("process", "discard"))
    phase = table.choice("phase", "keep" if mode.late.keep_phase else "ignore", ("keep", "ignore"))
    stop_after = table.whole("stop_after", mode.late.stop_after, "late samples in a row that end the run; 0: never")
    settings = {
        "late": LatePolicy(late == "discard", phase == "keep", stop_after or 0),
        "late_limit": table.whole("late_limit", 0, "late samples that the verdict allows"),
        "priority": table.whole("priority", 80, "of SCHED_FIFO", 1, 99),
        "cpu": table.whole("cpu", None, "processor to run on", 0, 4095),
    }
    table.done()
    return settings


def _check_coupling(axes: list[AxisPlan]) -> None:
    coupled = [plan.axis.name for plan in axes if plan.controller and plan.controller.coupled]
    if coupled and len(coupled) != len(axes):
        raise InputError("a coupled controller drives all axes of the run; give it in the general [controller] table")


def _import_path(axes: list[AxisPlan]) -> tuple[str, ...]:
    paths = [part.source.path for plan in axes for part in (plan.controller, plan.model) if part is not None]
    return tuple(dict.fromkeys(str(Path(path).parent) for path in paths if path))
