"""Zero-phase-error tracking: the feedforward of `feedforward`, inverted for the sampled axis and a delay in its loop.

Tomizuka, "Zero Phase Error Tracking Algorithm for Digital Control", Trans. ASME, J. of Dynamic Systems, Measurement and
Control 109 (1987) 65-68. The axis held over T is z⁻¹ B(z⁻¹)/A(z⁻¹), with

    A = (1 - z⁻¹)(1 - a₂₂ z⁻¹)        B = b₁ + c z⁻¹        c = a₁₂ b₂ - a₂₂ b₁

and its zero -c/b₁ is near -1: to cancel it would ring. So the feedforward cancels A and the phase of B alone,

    u_ff(k) = A(z⁻¹) B(z)/B(1)² x_r(k + 1 + lead)

where `lead` is how many samples later than here a voltage acts: 0 in a simulation, 1 on a bus. The reference of the
samples to come is x_r + v_r j T + a_r (j T)²/2: exact while the acceleration is constant over lead + 2 samples. Then
u_ff is v_r/K + β a_r, since A(1) = 0; only the weight of the acceleration differs from τ/K.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from rds.controllers import feedforward, observer
from rds.core.options import check_known
from rds.core.quantities import Declaration, Quantity
from rds.core.types import Controller, Source

NAME = "zero-phase"
SPINDLE = False
LEAD = Quantity("samples that a voltage acts later than in a loop without a bus", "", 0, 100, default=0, whole=True)
OPTIONS: Mapping[str, Declaration] = {**feedforward.OPTIONS, "lead": LEAD}

law, control = feedforward.law, feedforward.control


def acceleration_gain(tau: float, K: float, T: float, lead: int) -> float:
    """β in V/(mm/s²): what the zero-phase feedforward gives for the reference's acceleration."""
    a12, a22, b1, b2 = observer.held_axis(tau, K, T)
    poles = (1.0, -(1.0 + a22), a22)  # of A, at z⁰, z⁻¹, z⁻²
    zeros = (b1, a12 * b2 - a22 * b1)  # of B(z), at z⁰, z¹
    ahead = [(1 + lead - i + j, a * b) for i, a in enumerate(poles) for j, b in enumerate(zeros)]
    return 0.5 * T * T * sum(weight * steps**2 for steps, weight in ahead) / sum(zeros) ** 2


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """`feedforward` with zero-phase-error tracking for a loop of `lead` samples; see `library_controller`.

    Options: those of `feedforward`, and `lead`. Raises InputError as `feedforward` does.
    """
    check_known(options, OPTIONS, f"controller {NAME!r}")
    lead = LEAD.check(options.pop("lead", LEAD.default), "lead", f"controller {NAME!r}")
    base = feedforward.make(axis_model, T, converter_range, unit=unit, **options)
    return replace(
        base,
        params=_weighted(base.params, axis_model, T, lead),
        source=Source(NAME),
        retune=partial(_retuned, dict(axis_model), T, converter_range, lead, base),
    )


def _weighted(params: Mapping[str, Any], axis_model: Mapping[str, Any], T: float, lead: int) -> dict[str, Any]:
    coefficients = params["coefficients"]
    beta = acceleration_gain(axis_model["tau"], axis_model["K"], T, lead)
    return {**params, "lead": lead, "coefficients": (*coefficients[:-1], beta / coefficients[1])}


def _retuned(
    axis_model: Mapping[str, Any], T: float, converter_range: float, lead: int, base: Controller, values: Any
) -> Mapping[str, Any]:
    """The parameters after they were changed while it runs."""
    assert base.retune is not None
    return _weighted(base.retune(values), axis_model, T, lead)
