"""An axis driven by a DC motor, with the current of its armature, solved exactly.

    J ω̇ + b ω = k i        L i̇ + R i = u - k ω        v = h ω/(2π)        (oacs-thesis, equation 7.17)

V become A, A become N m: torque k i, with k the torque constant and the constant of the back-EMF. J and b are those of
the whole axis about the motor, h is the way per revolution. Speed and current are a linear system of second order, so
for a constant voltage the response is closed-form: with the eigenvalues λ of its matrix M,

    e^(Mt) = e^(λ₁t) I + (e^(λ₂t) - e^(λ₁t))/(λ₂ - λ₁) (M - λ₁I)        ∫ e^(Ms) ds = M⁻¹ (e^(Mt) - I)

Without inductance it is the linear axis with τ = J R/(b R + k²) and K = k h/(2π)/(b R + k²), and the current follows
the voltage at once. There is no Coulomb friction.
"""

from __future__ import annotations

from cmath import exp, sqrt
from collections.abc import Mapping, Sequence
from math import expm1, pi
from typing import Any

from rds.core.options import read_all
from rds.core.quantities import Quantity
from rds.core.types import Model, Source

NAME = "dc-motor-axis"
PARAMETERS = {
    "resistance": Quantity("resistance R of the armature", "Ohm", above=0.0),
    "inductance": Quantity("inductance L of the armature", "H", low=0.0),
    "torque_constant": Quantity("torque constant k, which is that of the back-EMF in V/(rad/s)", "N m/A", above=0.0),
    "inertia": Quantity("moment of inertia J of the axis about the motor", "kg m²", above=0.0),
    "damping": Quantity("viscous damping b of the axis about the motor", "N m/(rad/s)", low=0.0),
    "lead": Quantity("way of the axis per revolution of the motor", "mm", above=0.0),
}
_NEUTRAL = {"inductance": 0.0, "damping": 0.0}
_CLOSE = 1e-4  # eigenvalues nearer than this (times T) are taken by a series
Coefficients = tuple[tuple[float, float, float, float], ...]


def _divided(first: complex, second: complex, T: float) -> complex:
    """(e^(second T) - e^(first T))/(second - first)."""
    z = (second - first) * T
    if abs(z) < _CLOSE:
        return exp(first * T) * T * (1.0 + z / 2.0 + z * z / 6.0 + z * z * z / 24.0)
    return (exp(second * T) - exp(first * T)) / (second - first)


def coefficients(params: Mapping[str, Any], T: float) -> Coefficients:
    """Rows of x⁺, v⁺ and i⁺ over (x, v, i, u), for samples of `T` s of constant voltage."""
    R, L, k, J, b = (params[name] for name in ("resistance", "inductance", "torque_constant", "inertia", "damping"))
    per_radian = params["lead"] / (2.0 * pi)  # mm
    stiffness = b * R + k * k
    if L == 0.0:
        tau, K, emf = J * R / stiffness, k * per_radian / stiffness, k / per_radian
        gone = -expm1(-T / tau)
        velocity = (0.0, 1.0 - gone, 0.0, K * gone)
        current = (0.0, -emf * velocity[1] / R, 0.0, (1.0 - emf * velocity[3]) / R)
        return (1.0, tau * gone, 0.0, K * (T - tau * gone)), velocity, current
    m11, m12, m21, m22 = -b / J, k * per_radian / J, -k / (per_radian * L), -R / L
    half, determinant = 0.5 * (m11 + m22), stiffness / (J * L)
    root = sqrt(half * half - determinant)
    slow, fast = half + root, half - root
    if root.imag == 0.0:
        slow = determinant / fast  # without the cancellation of half + root
    here = _divided(slow, fast, T)
    start, spread = (exp(slow * T) - here * slow).real, here.real  # e^(MT) = start I + spread M
    e11, e12, e21, e22 = start + spread * m11, spread * m12, spread * m21, start + spread * m22
    # M⁻¹ (e^(MT) - I), of which both rows times the input 1/L in the second place give the answer to u
    s11, s12 = _solved(m22, -m12, determinant, e11 - 1.0, e21), _solved(m22, -m12, determinant, e12, e22 - 1.0)
    s22 = _solved(-m21, m11, determinant, e12, e22 - 1.0)
    # position: ∫ of the velocity's answer to u, M⁻¹ (∫ e^(Ms) ds - I T) in the same place
    twice = _solved(m22, -m12, determinant, s12, s22 - T)
    return (1.0, s11, s12, twice / L), (0.0, e11, e12, s12 / L), (0.0, e21, e22, s22 / L)


def _solved(a: float, b: float, determinant: float, first: float, second: float) -> float:
    """A row (a, b) of the adjugate over the determinant, times a column."""
    return (a * first + b * second) / determinant


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, ...]:
    """The exact response over `T` s: state (mm, mm/s, A) and constant voltage `u` V in, state out."""
    return _moved(x, u, coefficients(params, T))


def _moved(x: Sequence[float], u: float, rows: Coefficients) -> tuple[float, ...]:
    position, velocity, current = x
    return tuple(a * position + b * velocity + c * current + d * u for a, b, c, d in rows)


class DcMotorMotion:
    """The axis in motion in a loop with a fixed sample period: `contracts.Motion`."""

    __slots__ = ("_params", "_rows", "current", "position", "velocity")
    dead_time = 0.0

    def __init__(self, model: Model, T: float):
        self.position, self.velocity, self.current = (float(value) for value in model.initial_state)
        self._params, self._rows = model.params, coefficients(model.params, T)

    def read(self) -> float:
        """Position, mm."""
        return self.position

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        self._go(voltage, self._rows)

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s of constant `voltage`, V."""
        self._go(voltage, coefficients(self._params, time))

    def _go(self, voltage: float, rows: Coefficients) -> None:
        state = (self.position, self.velocity, self.current)
        self.position, self.velocity, self.current = _moved(state, voltage, rows)


def torque(current: float, params: Mapping[str, Any]) -> float:
    """The motor's torque, N m, at a `current` in A."""
    return float(params["torque_constant"] * current)


def force(current: float, params: Mapping[str, Any]) -> float:
    """The force along the axis, N, that the torque of a `current` in A gives over the lead, without losses."""
    return torque(current, params) * 2.0 * pi / (1e-3 * params["lead"])


def make(**params: Any) -> Model:
    """The axis at rest with the given `PARAMETERS`; `inductance` and `damping` are 0 if not given.

    The model's `tau` (s) and `K` ((mm/s)/V), which controllers are designed for, follow: those of the slow part,
    (J R + b L)/(b R + k²) and k h/(2π)/(b R + k²). Raises InputError for an unknown, missing or impossible parameter.
    """
    values = read_all(params, PARAMETERS, NAME, _NEUTRAL)
    R, L, k, J, b = (values[name] for name in ("resistance", "inductance", "torque_constant", "inertia", "damping"))
    stiffness = b * R + k * k
    derived = {"tau": (J * R + b * L) / stiffness, "K": k * values["lead"] / (2.0 * pi * stiffness)}
    return Model(
        advance,
        (0.0, 0.0, 0.0),
        values | derived,
        source=Source(NAME),
        motion=DcMotorMotion,
        has_velocity=True,
        told={"current": "A"},
    )
