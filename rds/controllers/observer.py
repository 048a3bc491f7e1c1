"""The reduced-order observer of an axis's velocity, for the sampled loop.

Over one period of constant voltage the axis (mini-cnc-rds, equation 3) goes exactly from x, v to

    x⁺ = x + a₁₂ v + b₁ u        a₂₂ = e^(-T/τ)        a₁₂ = τ (1 - a₂₂)
    v⁺ =     a₂₂ v + b₂ u        b₁ = K (T - a₁₂)      b₂ = K (1 - a₂₂)

The observer of this plant has the form of equation 9 with its own numbers,

    v̂ = L y + z        z⁺ = F z + G y + H u
    F = e^(pole T)      L = (a₂₂ - F)/a₁₂      G = (F - 1) L      H = b₂ - L b₁

so that v - v̂ shrinks by F each sample, whatever the voltage. Equation 9 itself, stepped with the measured position
held constant, would not do: between samples the position moves on by v T, which that observer takes for a
velocity error in proportion to v.
"""

from __future__ import annotations

from math import exp, expm1

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.shared_quantities import SAMPLE_PERIOD

POLE = Quantity("pole of the observer, left of 0, such as -320", "1/s")
_OPTIONS = {
    "tau": Quantity("time constant of the axis", "s", above=0.0),
    "K": Quantity("gain of the axis", "(mm/s)/V"),
    "T": SAMPLE_PERIOD,
}


def held_axis(tau: float, K: float, T: float) -> tuple[float, float, float, float]:
    """a₁₂ (s), a₂₂, b₁ (mm/V) and b₂ ((mm/s)/V) of the axis over one period of constant voltage."""
    a22 = exp(-T / tau)
    gone = -expm1(-T / tau)
    a12 = tau * gone
    return a12, a22, K * (T - a12), K * gone


def coefficients(tau: float, K: float, pole: float, T: float) -> tuple[float, float, float, float]:
    """L (1/s), F, G (1/s) and H ((mm/s)/V) for a continuous observer pole in 1/s and a period `T` in s.

    Raises InputError for a pole that is not negative or a `tau` or `T` that is not positive.
    """
    owner = "observer"
    _OPTIONS["tau"].check(tau, "tau", owner)
    _OPTIONS["K"].check(K, "K", owner)
    _OPTIONS["T"].check(T, "T", owner)
    check_pole(pole, owner)
    a12, a22, b1, b2 = held_axis(tau, K, T)
    F = exp(pole * T)
    L = (a22 - F) / a12
    return L, F, (F - 1.0) * L, b2 - L * b1


def check_pole(pole: float, owner: str) -> float:
    """The observer's pole as a float, 1/s; InputError unless it is a negative number."""
    number = POLE.check(pole, "observer_pole", owner)
    if number >= 0.0:
        raise InputError(f"{owner}: observer_pole = {pole!r} 1/s is not stable; it must be less than 0, such as -320")
    return number


def start(y: float, c: tuple[float, float, float, float]) -> float:
    """The auxiliary state z for which the estimated velocity is zero at the measured position `y`."""
    return -c[0] * y


def step(z: float, y: float, u: float, c: tuple[float, float, float, float]) -> tuple[float, float]:
    """Estimated velocity now (mm/s) and next z, from measured position `y` and the voltage `u` held from now on."""
    L, F, G, H = c
    return L * y + z, F * z + G * y + H * u
