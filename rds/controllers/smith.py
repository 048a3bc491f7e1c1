"""The Smith predictor: a law of the library, designed without delay, around a model of the axis.

    ŷ = y + x̂(t) - x̂(t - delay)        (O. J. M. Smith, Chem. Eng. Prog. 53 (1957) 217-219)

with x̂ the model's position on the voltages that were sent. For an axis, which integrates, the difference of both is
the distance that the voltages on their way will move it, K ∫u - τ Δv̂ over the delay: nothing is summed up that rounding
would drive away. The inner law gets ŷ, and sees an axis without delay. It gets the reference of the instant at which
its voltage will act, too. A constant disturbance leaves an error even under an
inner law with an integral: use `lqg` where that matters.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor
from typing import Any

from rds.controllers import feedforward, modified_pid, pid, proportional, tracking
from rds.controllers.axis_data import axis_data, check_delayed
from rds.controllers.observer import held_axis
from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import AnyValue, Choice, Declaration, Quantity, checked
from rds.core.types import NOT_LIVE, Controller, Reference, Source

NAME = "smith"
SPINDLE = False
_INNER = {
    "p": proportional,
    "pid": pid,
    "modified-pid": modified_pid,
    "tracking": tracking,
    "feedforward": feedforward,
}
OPTIONS: Mapping[str, Declaration] = {
    "delay": Quantity("from a sampling instant until its voltage acts", "s", 0.0, 1000.0, default=0.0),
    "law": Choice("the law that is designed without delay", tuple(_INNER), "tracking"),
    "options": AnyValue("its options, as in a table of its own"),
}
_ROUNDING = 1e-9  # of a sample


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """Voltage (V) and next state: the inner law's; how much faster the model without delay is; the voltages sent."""
    inner, faster, sent = state
    (tau, K, T, left), first, rest, over = params["prediction"]
    whole = len(sent) - 1
    ahead = K * (T * sum(sent[:whole]) + left * sent[whole]) - tau * faster  # mm
    u, inner = params["inner"](t, _later(r, params["delay"]), y + ahead, inner, params["inner_params"])
    sent = (u, *sent)
    late = _pushed(_pushed(0.0, sent[whole + 1], first), sent[whole], rest)
    return u, (inner, _pushed(faster, u, over) - late, sent[:-1])


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """A Smith predictor around a law of the library; see `rds.controllers.library_controller` and `OPTIONS`.

    InputError for a spindle, a delay of more than 200 samples, and what the inner law refuses.
    """
    owner = f"controller {NAME!r}"
    check_known(options, OPTIONS, owner)
    values = {
        name: checked(declared, options[name], name, owner) if name in options else declared.default
        for name, declared in OPTIONS.items()
    }
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    delay, of_inner = values["delay"], values["options"] or {}
    check_delayed(axis, delay, owner)
    if not isinstance(of_inner, Mapping):
        raise InputError(f"{owner}: options = {of_inner!r} must be a table of the inner law's options")
    inner = _INNER[values["law"]].make(axis_model, T, converter_range, unit=unit, **of_inner)
    whole = floor(delay / T + _ROUNDING)
    left = max(delay - whole * T, 0.0)
    parts = (held_axis(axis.tau, axis.K, time) for time in (left, T - left, T))
    params = {
        "delay": delay,
        "law": values["law"],
        "inner": inner.control,
        "inner_params": dict(inner.params),
        "prediction": ((axis.tau, axis.K, T, left), *parts),
    }
    start = (inner.initial_state, 0.0, (0.0,) * (whole + 1))
    return Controller(control, start, params, Source(NAME), retune=NOT_LIVE)


def _later(r: Reference, time: float) -> Reference:
    """The reference extrapolated by its velocity and acceleration: the inner law's voltage acts so much later."""
    return Reference(r[0] + r[1] * time + 0.5 * r[2] * time * time, r[1] + r[2] * time, r[2])


def _pushed(v: float, u: float, over: tuple[float, float, float, float]) -> float:
    """The model's velocity after a time of constant voltage."""
    return over[1] * v + over[3] * u
