"""The fields of the design panel: the axis, the poles, how uncertain the axis is, the file."""

from __future__ import annotations

from collections.abc import Iterable

from rds.controllers.tracking import OBSERVER_POLE, POLES
from rds.core.errors import InputError
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.types import SPINDLE_UNIT
from rds.machines import Machine
from rds.panels.session.fields import Choice, Field, Number, Text

AXIS = "axis"
LIBRARY, MODEL_FILE = "library", "file"  # where the axis's data come from
PAIR, REAL = "pair", "real"  # of poles
FASTEST, SLOWEST = -1e5, -0.1  # 1/s


def fields(machine: Machine) -> Iterable[Field]:
    """All of them. A spindle is not among the axes: its speed is measured, so there is nothing to observe.

    InputError for a machine that has nothing else.
    """
    axes = {name: f"{name} axis" for name, axis in machine.axes.items() if axis.unit != SPINDLE_UNIT}
    if not axes:
        raise InputError(f"{machine.name} has no position axis, whose poles are placed here; open a page with another")
    sources = {LIBRARY: "Machine's data", MODEL_FILE: "Fitted model"}
    yield Choice("source", "Axis from", "the machine's own data, or a model file that you fitted", LIBRARY, sources)
    yield Choice(AXIS, "Axis", "which axis of the machine", next(iter(axes)), axes)
    yield Text("model_file", "Model file", "what Save model in Data wrote, in your folder", "", "model.toml")
    yield Number.of(SAMPLE_PERIOD, "sample_period", "Sample period", machine.sample_period)  # fmt: skip
    kinds = {PAIR: "Conjugate pair", REAL: "Two real"}
    yield Choice("kind", "Poles of the error", "how the tracking error dies away: with or without a swing", PAIR, kinds)
    (real, imaginary), _ = POLES
    yield _pole("real", "Real part", "of both poles: further left is faster", real)
    yield Number(
        "imaginary", "± Imaginary part", "0: a double real pole", imaginary, unit="rad/s", low=0.0, high=-FASTEST
    )
    yield _pole("first", "First pole", "one of the two real poles", -40.0)
    yield _pole("second", "Second pole", "the other one", -60.0)
    yield _pole("observer", "Observer pole", "of the velocity's observer: several times as fast", OBSERVER_POLE)
    tip = "in the response that is shown"
    yield Number("step", "Step of the reference", tip, 1.0, unit="mm or °", above=0.0, high=100.0)
    for name, of in (("tau", "time constant τ"), ("K", "gain K")):
        yield Number(
            f"spread_{name}", f"± {of}", "how far it may be off, in the cloud", 10.0, unit="%", low=0.0, high=90.0
        )
    yield Number("delay", "Delay up to", "of drive and bus, in the cloud", 1.0, unit="ms", low=0.0, high=50.0)
    yield Text("file", "File", "a controller of your own in your folder, to read and change", "my_tracking.py")


def _pole(name: str, label: str, tip: str, default: float) -> Number:
    return Number(name, label, tip, default, unit="1/s", low=FASTEST, high=SLOWEST)
