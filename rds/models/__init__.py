"""Plant models, one per file, by name.

Each file has `PARAMETERS`, by name, each a declaration of `rds.core.quantities` (meaning, unit, range), and
`make(**params) -> Model`, which checks them (`rds.core.options.read_options`). What a model is, `rds.core.types.Model`
says.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

from rds.core.errors import InputError
from rds.core.face import face
from rds.core.quantities import listed
from rds.core.registry import Registry
from rds.core.types import Model

__getattr__, __dir__ = face(
    __name__,
    {
        "StepperAxis": "stepper_axis",
        "StepperParameters": "stepper_axis",
    },
)

LIBRARY = Registry(
    "model",
    {
        "linear-axis": "rds.models.linear_axis",
        "spindle": "rds.models.spindle",
        "machine-axis": "rds.models.machine_model",
        "directional-axis": "rds.models.directional_axis",
        "position-drive": "rds.models.position_drive",
        "profile-drive": "rds.models.profile_drive",
        "dc-motor-axis": "rds.models.dc_motor_axis",
    },
)


def model_names() -> list[str]:
    """Names of the library's models."""
    return LIBRARY.names()


def model_module(name: str) -> ModuleType:
    """The module of the model called `name`, with its `make`."""
    return LIBRARY.module(name)


def library_model(name: str, **params: Any) -> Model:
    """The library's model called `name` with the given parameters.

    Raises InputError for an unknown name or parameter, or a value that will not do.
    """
    try:
        return LIBRARY.module(name).make(**params)
    except ArithmeticError as error:
        said = f"model {name!r} cannot be computed with numbers so large or so small: {listed(params)}"
        raise InputError(f"{said}; give others") from error
