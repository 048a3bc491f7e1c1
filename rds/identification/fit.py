"""A fit: logs and a structure in, an estimate out, by one of the methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.identification.estimate import Estimate
from rds.identification.log import Log
from rds.identification.structure import Structure

METHODS = Registry(  # each module has `estimate(logs, structure, options) -> Estimate`
    "method",
    {
        "simulation": "rds.identification.simulation_error",
        "inverse-dynamics": "rds.identification.inverse_dynamics",
        "step": "rds.identification.step_fit",
        "frequency": "rds.identification.frequency",
    },
    own=False,
)


def fit(
    logs: Sequence[Log], structure: Structure, method: str | None = None, options: Mapping[str, Any] | None = None
) -> Estimate:
    """The parameters of `structure` that explain the logs, all fitted together, by the method's own `options`.

    InputError for an unknown method or option, no logs, or logs that hold nothing to estimate from.
    """
    if not logs:
        raise InputError("there is no log to fit; name at least one")
    estimated: Estimate = METHODS.module(method or structure.default_method).estimate(
        list(logs), structure, dict(options or {})
    )
    return estimated
