"""What may be chosen about modules: how they are simulated, the step that is recorded, their tuning."""

from __future__ import annotations

from typing import Any

from rds.bus.modules.dialects import DEFAULT, dialect_names
from rds.bus.modules.oacs.pid import FIELDS, MEANINGS, RANGES, Tuning
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Number

_SPEAK = {"rds": "rds: cyclic", "oacs": "oacs: distributed", "cia402": "cia402: drives", "dcs": "dcs: serial line"}
CONTROLLERS = {"P": "P", "PI": "PI", "PID": "PID"}

SERVED = Choice(
    "dialect",
    "Dialect",
    "What the simulated modules speak; only distributed ones say what they are, and have a tuning",
    DEFAULT,
    {name: _SPEAK.get(name, name) for name in dialect_names()},
)
STEP: tuple[Field, ...] = (
    Number("step", "Step", "How far the set point jumps", 5.0, unit="mm or °", low=-1000.0, high=1000.0),
    Number(
        "period", "Sample every", "Time between two samples, a multiple of 0.01 s", 0.01, unit="s", low=0.01, high=1
    ),
    Number(
        "settled",
        "Settled after",
        "The recording ends when the axis has stood still for so long; 0: when the module itself ends the motion",
        1.0,
        unit="s",
        low=0.0,
        high=60.0,
    ),
)


def _tuning() -> list[Field]:
    fields: list[Field] = [
        Choice("controller", "Controller", "P is PI without its integral gain", Tuning().controller.name, CONTROLLERS)
    ]
    for parameter, name in FIELDS.items():
        unit, words = MEANINGS[name]
        low, high = RANGES[parameter]
        label = name.replace("_", " ")
        fields.append(Number(name, label, words, getattr(Tuning(), name), unit=unit, low=low, high=high))
    return fields


TUNING = tuple(_tuning())


def tuning_values(choices: Choices) -> tuple[str, dict[str, Any]]:
    """The module's controller, PI or PID, and its parameters. P, which modules do not know, is PI with Ki = 0."""
    values = choices.values()
    controller = values.pop("controller")
    return ("PI", values | {"Ki": 0.0}) if controller == "P" else (controller, values)
