"""The fields of equipment model and equipment control: what there is to choose, with units, ranges, first values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rds.controllers import controller_module
from rds.controllers.tracking import OBSERVER_POLE, POLES
from rds.core.quantities import Quantity
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.machines import Axis, Machine
from rds.modes.loop.mode import Drive
from rds.panels.session.fields import Choice, Field, Number, Text, mode_choice
from rds.panels.session.file_params import file_params
from rds.panels.session.formula import check_formula

USER = "user"  # the choice of something that the student wrote
PREFIX = "controller."  # of the fields of a controller's parameters
OF_MODEL = "model."  # of those of a student's model
SPINDLE = "rev/min"
DRIVEN_BY: dict[str, Drive] = {"model": "signal", "control": "controller"}  # what drives the axes, by panel
SHAPES = {"square": "Square", "triangle": "Triangle", "sinusoid": "Sinusoid", USER: "User-defined"}
CONTROLLERS = {
    "p": "Proportional",
    "pid": "PID",
    "modified-pid": "Modified PID",
    "tracking": "General tracking",
    USER: "User-defined",
}
MODELS = {"default": "Default", USER: "User-defined"}
POLE, POLE_OFFSET, OBSERVER = f"{PREFIX}pole", f"{PREFIX}pole_imaginary", f"{PREFIX}observer_pole"
_COMMENT = 40  # characters of a file's comment that stand beside a field
# first values that every axis of the mini CNC can follow: (amplitude, frequency) by what is driven
_FIRST = {"V": (2.0, 1.0), "mm": (5.0, 0.2), "°": (20.0, 0.2), SPINDLE: (200.0, 0.5)}


def first_fields(kind: str, machine: Machine, kept: object = None) -> Iterable[Field]:
    """All fields of the panel `kind`, "model" or "control", but the controller's parameters.

    As they are for the system `kept`, so that the values that were kept with it will do; else for the first one.
    """
    systems = {name: "Spindle" if axis.unit == SPINDLE else f"{name} axis" for name, axis in machine.axes.items()}
    first = next(iter(systems))
    axis = machine.axes[kept if isinstance(kept, str) and kept in systems else first]
    what = "voltage signal" if kind == "model" else "reference"
    yield Choice("system", "System", "which axis of the machine, or its spindle", first, systems)
    yield mode_choice(DRIVEN_BY[kind])
    yield Choice("shape", what.capitalize(), f"the form of the {what} over time", "sinusoid", SHAPES)
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
    yield Choice("model", "Model", "what stands for the machine in simulation, and beside it", "default", MODELS)
    yield Text(
        "model_file",
        "File of the model",
        "a Python file with derivatives() or advance(), or a model file of `rds fit`",
        "",
        "e.g. my_model.py",
    )
    if kind == "control":
        yield controllers(axis)
        yield Text(
            "controller_file", "File of the controller", "a Python file with control()", "", "e.g. my_controller.py"
        )
    yield Number("duration", "Final time", "how long it runs", 10.0, unit="s", above=0.0, high=3600.0)
    yield Number.of(SAMPLE_PERIOD, "sample_period", "Sample period", machine.sample_period)


def controllers(axis: Axis) -> Choice:
    """The controllers that an axis can have: a spindle's speed is measured, so it has nothing to observe."""
    fitting = {name: words for name, words in CONTROLLERS.items() if axis.unit != SPINDLE or name != "tracking"}
    first = "tracking" if "tracking" in fitting else "pid"
    return Choice("controller", "Controller", "the law that answers with a voltage", first, fitting)


def sizes(kind: str, machine: Machine, axis: Axis) -> Iterable[Field]:
    """Amplitude, frequency and offset, with the range and the first value that the system allows."""
    if kind == "model":
        unit, high, reach = "V", *([machine.converter.range] * 2)
    else:
        unit, (low, top) = axis.unit, axis.travel
        reach = max(abs(low), abs(top))
        high = top if unit == SPINDLE else (top - low) / 2.0
    amplitude, frequency = _FIRST.get(unit, (1.0, 0.2))
    yield Number("amplitude", "Amplitude", "middle to peak", min(amplitude, high), unit=unit, low=0.0, high=high)
    yield Number("frequency", "Frequency", "periods per second", frequency, unit="Hz", above=0.0, high=1000.0)
    yield Number("offset", "Offset", "middle of the signal", 0.0, unit=unit, low=-reach, high=reach)


def parameter_fields(controller: str, axis: Axis) -> Iterable[Field]:
    """The parameters of one of the library's controllers; `own_fields` has those of a student's file."""
    if controller == USER:
        return
    if controller == "tracking":
        yield from _tracking_fields()
        return
    options: Mapping[str, Quantity] = controller_module(controller).OPTIONS
    for name, option in options.items():
        yield _parameter(name, option, axis.unit)


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
    """The tracking controller's options from the values of its fields: a pair of poles, and the observer's."""
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


def _parameter(name: str, option: Quantity, unit: str) -> Number:
    meaning = option.meaning.partition(";")[0]
    return Number(
        f"{PREFIX}{name}",
        f"{name}, {meaning}",
        f"{option.described.replace('mm', unit)}; empty: tuned from the axis's data",
        None,
        unit=option.unit.replace("mm", unit),
        low=option.low,
        above=option.above,
        optional=True,
    )


def _refuse_signal(text: str) -> None:
    if not text.strip().lower().endswith(".csv"):
        check_formula(text)
