"""The fields of equipment model and equipment control: what there is to choose, with units, ranges, first values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rds.controllers import controller_module, controller_names, is_for_spindle
from rds.controllers.speed_tracking import SPEED_POLE
from rds.controllers.tracking import OBSERVER_POLE, POLES
from rds.core.quantities import Declaration, Quantity
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.types import SPINDLE_UNIT
from rds.machines import Axis, Machine
from rds.modes.loop.following_error import LARGEST
from rds.modes.loop.mode import Drive
from rds.nc.run.run import usual_controller
from rds.panels.interpolator.motion import motion_fields
from rds.panels.session.fields import Choice, Field, Flag, Number, Text, field_of, labels, mode_choice
from rds.panels.session.file_params import file_params
from rds.panels.session.formula import check_formula
from rds.references import signal_kinds, signal_options

USER = "user"  # the choice of something that the student wrote
PREFIX = "controller."  # of the fields of a controller's parameters
OF_MODEL = "model."  # of those of a student's model
FERROR = "ferror"  # the field of the largest following error
DRIVEN_BY: dict[str, Drive] = {"model": "signal", "control": "controller"}  # what drives the axes, by panel
SIZES = ("amplitude", "frequency", "offset")  # of a signal: fields that most kinds share
OF_SIGNAL = "signal."  # prefix of the fields of what else a kind of signal needs
CIRCLE, PATH = "circle", "path"  # what several axes follow together
PATHS = {CIRCLE: "Circle of X and Y", PATH: "Path or part program"}
TOGETHER = "+"  # between the names of axes that are one system
_CONTROLLERS = {
    "p": "Proportional",
    "pid": "PID",
    "modified-pid": "Modified PID",
    "tracking": "General tracking",
    "cascade": "Servo cascade",
    "lqg": "LQG",
    "smith": "Smith predictor",
    "relay": "Relay autotuning",
}
MODELS = {"default": "Default", USER: "User-defined"}
POLE, POLE_OFFSET, OBSERVER = f"{PREFIX}pole", f"{PREFIX}pole_imaginary", f"{PREFIX}observer_pole"
OF_SPINDLE = f"{PREFIX}speed_pole"
_COMMENT = 40  # characters of a file's comment that stand beside a field
_FIRST_OF = {"lowest": 0.5, "highest": 20.0, "sweep": 5.0, "steps": 5}  # Hz, Hz, s
# first values that every axis of the mini CNC can follow: (amplitude, frequency) by what is driven
_FIRST = {"V": (2.0, 1.0), "mm": (5.0, 0.2), SPINDLE_UNIT: (200.0, 0.5)}


def first_fields(kind: str, machine: Machine, kept: object = None) -> Iterable[Field]:
    """All fields of the panel `kind`, "model" or "control", but the controller's parameters.

    As they are for the system `kept`, so that the values that were kept with it will do; else for the first one.
    """
    systems = _systems(kind, machine)
    first = next(iter(systems))
    axes = axes_of(kept if isinstance(kept, str) and kept in systems else first)
    axis = machine.axes[axes[0]]
    tip = "which axis of the machine, or its spindle" + (", or some together" if kind == "control" else "")
    yield Choice("system", "System", tip, first, systems)
    yield mode_choice(DRIVEN_BY[kind])
    yield shapes(kind, axes)
    yield Text(
        "shape_file",
        "CSV file, or formula of t [s]",
        f"columns of time [s] and value [{'V' if kind == 'model' else 'unit of the axis'}], or such as "
        f"3*sin(2*pi*0.5*t)",
        "",
        "e.g. 3*sin(2*pi*0.5*t)",
        refuse=_refuse_signal,
    )
    yield from sizes(kind, machine, axis)
    if kind == "control":
        yield from _path_fields()
    yield Choice("model", "Model", "what stands for the machine in simulation, and beside it", "default", MODELS)
    yield Text(
        "model_file",
        "File of the model",
        "a Python file with derivatives() or advance(), or a model file of `rds fit`",
        "",
        "e.g. my_model.py",
    )
    if kind == "control":
        yield controllers(machine, axis)
        yield Text(
            "controller_file", "File of the controller", "a Python file with control()", "", "e.g. my_controller.py"
        )
        tip = "the file's control() gets and returns arrays, one value for each axis: contour control"
        yield Flag("coupled", "One controller for all axes", tip, False)
    yield Number("duration", "Final time", "how long it runs", 10.0, unit="s", above=0.0, high=3600.0)
    yield Number.of(SAMPLE_PERIOD, "sample_period", "Sample period", machine.sample_period)
    if kind == "control":
        yield Number.of(
            LARGEST,
            FERROR,
            "Largest following error",
            tooltip="how far the axis may be from its reference before the run ends, at its largest velocity and below",
            unit=axis.unit if axis.unit != SPINDLE_UNIT else "mm",
            optional=True,
            when_empty="not watched",
        )


def axes_of(system: str) -> list[str]:
    """The axes of a system, in order."""
    return system.split(TOGETHER)


def _systems(kind: str, machine: Machine) -> dict[str, str]:
    """Each axis alone; for controllers, the first two linear axes and all three together as well."""
    alone = {name: "Spindle" if axis.unit == SPINDLE_UNIT else f"{name} axis" for name, axis in machine.axes.items()}
    linear = [name for name in machine.axes if name in ("X", "Y", "Z")]
    several = [linear[:count] for count in (2, 3) if kind == "control" and len(linear) >= count]
    return alone | {TOGETHER.join(names): " and ".join([", ".join(names[:-1]), names[-1]]) for names in several}


def shapes(kind: str, axes: Sequence[str]) -> Choice:
    """What drives the axes: a signal, the same for each of them, or a path for several together."""
    what = "voltage signal" if kind == "model" else "reference"
    signals = [name for name in signal_kinds() if name != USER]
    options = (PATHS if len(axes) > 1 else {}) | labels(signals, {}) | {USER: "User-defined"}
    first = "sinusoid" if len(axes) == 1 else CIRCLE
    return Choice("shape", what.capitalize(), f"the form of the {what} over time", first, options)


def _path_fields() -> Iterable[Field]:
    yield Text(
        "path_file",
        "Path file, or part program",
        "a path file (.toml) or a part program (.ngc) of your folder",
        "",
        "e.g. part.ngc",
    )
    yield Number("radius", "Radius", "of the circle, which begins at 0", 5.0, unit="mm", above=0.0, high=1e3)
    yield Number("feed", "Feed rate", "along the circle", 300.0, unit="mm/min", above=0.0, high=6e4)
    yield Number("laps", "Laps", "how often it goes around", 2, low=1, high=100, whole=True)
    yield from motion_fields()


def controllers(machine: Machine, axis: Axis) -> Choice:
    """The controllers that an axis can have, the usual one of its machine first: a spindle has no position."""
    fitting = [name for name in controller_names() if axis.unit != SPINDLE_UNIT or is_for_spindle(name)]
    first = "pid" if axis.unit == SPINDLE_UNIT else usual_controller(machine)
    options = labels(fitting, _CONTROLLERS) | {USER: "User-defined"}
    return Choice("controller", "Controller", "the law that answers with a voltage", first, options)


def sizes(kind: str, machine: Machine, axis: Axis) -> Iterable[Field]:
    """Amplitude, frequency and offset, with the range and the first value that the system allows."""
    if kind == "model":
        unit, high, reach = "V", *([machine.converter.range] * 2)
    else:
        unit, (low, top) = axis.unit, axis.travel
        reach = max(abs(low), abs(top))
        high = top if unit == SPINDLE_UNIT else (top - low) / 2.0
    amplitude, frequency = _FIRST.get(unit, (1.0, 0.2))
    yield Number("amplitude", "Amplitude", "middle to peak", min(amplitude, high), unit=unit, low=0.0, high=high)
    yield Number("frequency", "Frequency", "periods per second", frequency, unit="Hz", above=0.0, high=1000.0)
    yield Number("offset", "Offset", "middle of the signal", 0.0, unit=unit, low=-reach, high=reach)


def parameter_fields(controller: str, axis: Axis) -> Iterable[Field]:
    """The parameters of one of the library's controllers; `own_fields` has those of a student's file."""
    if controller == USER:
        return
    if controller == "tracking":
        yield from _speed_fields() if axis.unit == SPINDLE_UNIT else _tracking_fields()
        return
    options: Mapping[str, Declaration] = controller_module(controller).OPTIONS
    for name, option in options.items():
        yield _parameter(name, option, axis.unit)


def signal_fields(shape: str, unit: str) -> Iterable[Field]:
    """What a kind of signal must be told besides `SIZES`: the lowest frequency of a chirp, the steps of a staircase."""
    if shape == USER or shape in PATHS:
        return
    options = signal_options(shape)
    for name in options.needed:
        if name not in SIZES:
            declared = options.keys[name]
            label = name.replace("_", " ").capitalize()
            if isinstance(declared, Quantity):
                own = declared.unit.replace("V or mm", unit)
                yield Number.of(declared, OF_SIGNAL + name, label, _FIRST_OF.get(name, 1.0), unit=own)
            else:
                yield field_of(declared, OF_SIGNAL + name, label)


def sizes_of(shape: str) -> tuple[str, ...]:
    """Which of `SIZES` a shape has."""
    if shape == USER or shape in PATHS:
        return ()
    return tuple(name for name in SIZES if name in signal_options(shape).keys)


def own_fields(path: Path, prefix: str) -> Iterable[Number]:
    """The numbers in `params` of the student's file at `path`; empty fields leave them as the file has them."""
    for name, value, comment in file_params(path):
        yield Number(
            f"{prefix}{name}",
            f"{name}, {comment}" if 0 < len(comment) <= _COMMENT else name,
            f"{comment or 'a parameter of your file'}; empty: as in {path.name}",
            None,
            optional=True,
            when_empty=f"{value:.10g}",
        )


def tracking_options(values: Mapping[str, Any]) -> dict[str, Any]:
    """The tracking controller's options from its fields: a pair of poles and the observer's; of a spindle, one pole."""
    if OF_SPINDLE in values:
        return {"speed_pole": values[OF_SPINDLE]}
    real, imaginary = values[POLE], values[POLE_OFFSET]
    return {"poles": [[real, imaginary], [real, -imaginary]], "observer_pole": values[OBSERVER]}


def _tracking_fields() -> Iterable[Field]:
    (real, imaginary), _ = POLES
    yield Number(
        POLE,
        "Poles, real part",
        "of the pair of closed-loop poles: further left is faster",
        real,
        unit="1/s",
        low=-1e4,
        high=-0.1,
    )
    yield Number(
        POLE_OFFSET, "Poles, ± imaginary part", "0: a double real pole", imaginary, unit="1/s", low=0.0, high=1e4
    )
    yield Number(
        OBSERVER,
        "Observer pole",
        "of the reduced-order observer: several times as fast as the poles",
        OBSERVER_POLE,
        unit="1/s",
        low=-1e5,
        high=-0.1,
    )


def _speed_fields() -> Iterable[Field]:
    tip = "closed-loop pole of the speed: further left is faster"
    yield Number(OF_SPINDLE, "Pole", tip, SPEED_POLE, unit="1/s", low=-1e4, high=-0.1)


def _parameter(name: str, option: Declaration, unit: str) -> Field:
    meaning = option.meaning.partition(";")[0]
    own = option.unit.replace("mm", unit) if isinstance(option, Quantity) else ""
    made = field_of(option, f"{PREFIX}{name}", f"{name}, {meaning}", own)
    return replace(made, tooltip=f"{made.tooltip}; empty: tuned from the axis's data")


def _refuse_signal(text: str) -> None:
    if not text.strip().lower().endswith(".csv"):
        check_formula(text)
