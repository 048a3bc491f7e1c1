"""Control laws, one per file, by name.

A module of a law has

- `OPTIONS`: what a user may set, by name, each a declaration of `rds.core.quantities` (what it means, unit, range);
- `make(axis_model, T, converter_range, *, unit="mm", **options) -> Controller`, as `library_controller` describes it:
  it checks the options (`rds.core.options.read_options`) and fills in tuned gains. What the `Controller` names as
  `tunable` can be changed while it runs;
- `control(t, r, y, state, params) -> (voltage, next_state)`, the fixed interface, which `make` hands to `Controller`;
- `SPINDLE = False`, where it is not for an axis whose speed is measured;
- `law(position, velocity, acceleration, y, state, coefficients) -> (voltage, next_state)`, where a run may be compiled:
  the same on floats and tuples of floats alone, which numba compiles as it stands. `control` then calls it with
  `params["coefficients"]`. The laws for loops with delay (`lqg`, `smith`) keep voltages that are on their way: they
  have no `law`. `relay`, which changes from one law to another, has none either.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import listed
from rds.core.registry import Registry
from rds.core.types import Controller

LIBRARY = Registry(
    "controller",
    {
        "p": "rds.controllers.proportional",
        "pid": "rds.controllers.pid",
        "modified-pid": "rds.controllers.modified_pid",
        "tracking": "rds.controllers.tracking",
        "feedforward": "rds.controllers.feedforward",
        "zero-phase": "rds.controllers.zero_phase",
        "cascade": "rds.controllers.cascade",
        "lqg": "rds.controllers.lqg",
        "smith": "rds.controllers.smith",
        "relay": "rds.controllers.relay",
    },
)


def controller_names() -> list[str]:
    """Names of the library's controllers."""
    return LIBRARY.names()


def controller_module(name: str) -> ModuleType:
    """The module of the controller called `name`, with its `OPTIONS`, `control` and `make`."""
    return LIBRARY.module(name)


def is_for_spindle(name: str) -> bool:
    """Whether the law called `name` can drive an axis whose speed is measured."""
    return bool(getattr(LIBRARY.module(name), "SPINDLE", True))


def library_controller(
    name: str,
    axis_model: Mapping[str, Any],
    T: float,
    converter_range: float,
    *,
    unit: str = "mm",
    **options: Any,
) -> Controller:
    """The library's controller called `name`, for one axis sampled every `T` s.

    `axis_model` holds the axis's `tau` (s) and `K` ((unit/s)/V; for a spindle unit/V); other keys are left alone.
    `converter_range` is the voltage (V) at which the command saturates, inf if nothing saturates it. An axis
    whose `unit` is "rev/min" is a spindle: first order, its speed measured. Options not given are tuned from
    `tau`, `K` and `T`. Raises InputError for an unknown name or option, or a value that will not do.
    """
    try:
        return LIBRARY.module(name).make(axis_model, T, converter_range, unit=unit, **options)
    except ArithmeticError as error:
        numbers = listed(options | {key: axis_model[key] for key in ("tau", "K") if key in axis_model})
        said = f"controller {name!r} cannot be computed with numbers so large or so small: {numbers}"
        raise InputError(f"{said}; give others") from error
