"""Gains from a recorded step by the reaction curve (Ziegler and Nichols' first method; oacs-thesis 7.2, table 11).

The tangent at the steepest point of an S-shaped response meets the initial value after the delay L, and the final
value after L + T:

    controller   Kp           Ki              Kd
    P            T/L          0               0
    PI           0.9 T/L      0.27 T/L²       0
    PID          1.2 T/L      0.6 T/L²        0.6 T

The table holds for a process of gain 1; for a gain K (output per input) each is divided by K. Trial and error has its
own table 10, here as `ADVICE`; its four columns are what `quality` measures of a recorded step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rds.core.errors import InputError
from rds.results import Result

ADVICE = {  # what raising a gain does: rise time, overshoot, settling time, steady error (table 10)
    "Kp": ("decreases", "increases", "hardly changes", "decreases"),
    "Ki": ("decreases", "increases", "increases", "goes away"),
    "Kd": ("hardly changes", "decreases", "decreases", "hardly changes"),
}
_SETTLED = 0.05  # the end's slope against the steepest one
_BAND = 0.02  # of the step, about the point, in which a response counts as settled
_OVERSHOOT = 0.05  # of the step
_QUANTA = 10  # smallest steps of the record that a slope is taken over


class Quality(NamedTuple):
    """How well a response follows its step: the columns of table 10. None: it never came so far."""

    rise_time: float | None  # s, from 10 % to 90 % of the step
    overshoot: float  # % of the step, beyond the point
    settling_time: float | None  # s, after which it stays within 2 % of the step
    steady_error: float  # in the axis's unit: the point less where it stands at the end

    def words(self, unit: str) -> str:
        """One line."""
        rise, settling = (
            "never" if value is None else f"{value:.3g} s" for value in (self.rise_time, self.settling_time)
        )
        return (
            f"rise time {rise}, overshoot {self.overshoot:.3g} %, settling time {settling}, "
            f"steady error {self.steady_error:.3g} {unit}"
        )


class Gains(NamedTuple):
    """Of a controller Kp e + Ki ∫e + Kd ė."""

    Kp: float
    Ki: float
    Kd: float


class ReactionCurve(NamedTuple):
    """What the tangent says."""

    delay: float  # L, s
    time_constant: float  # T, s
    gain: float = 1.0  # K: change of output per change of input


def ziegler_nichols(curve: ReactionCurve, controller: str = "PID") -> Gains:
    """The gains of table 11 for `controller` P, PI or PID. InputError for a curve without delay."""
    L, T, K = curve
    if not L > 0 or not T > 0 or not K > 0:
        raise InputError(
            f"a reaction curve with delay {L:g} s, time constant {T:g} s and gain {K:g} has no gains by table 11; "
            "all three must be more than 0: record with a shorter period, or tune by trial and error"
        )
    table = {
        "P": Gains(T / L, 0.0, 0.0),
        "PI": Gains(0.9 * T / L, 0.27 * T / L**2, 0.0),
        "PID": Gains(1.2 * T / L, 0.6 * T / L**2, 0.6 * T),
    }
    if controller.upper() not in table:
        raise InputError(f"controller {controller!r} must be P, PI or PID")
    return Gains(*(gain / K for gain in table[controller.upper()]))


def reaction_curve(time: ArrayLike, output: ArrayLike, step: float | None = None) -> ReactionCurve:
    """Delay, time constant and gain of a recorded response to a step at time 0.

    `time` in s, `output` in any unit, of one length; `step` is the change of the input (default: the output's own
    change, gain 1). The slope is taken over as many samples as it takes to rise by ten of the record's smallest steps,
    so that an encoder's counts do not make it. Raises InputError for a response that the method is not for: one that
    oscillates, or does not settle.
    """
    t, y = np.asarray(time, dtype=float), np.asarray(output, dtype=float)
    if t.shape != y.shape or t.ndim != 1 or len(t) < 10 or not (np.isfinite(t).all() and np.isfinite(y).all()):
        raise InputError(
            f"a reaction curve needs ten samples at least, finite, of one length; got {t.shape}, {y.shape}"
        )
    change = y[-1] - y[0]
    if change == 0.0:
        raise InputError("the response ends where it began; take a larger step")
    rise = (y - y[0]) / change
    if rise.max() > 1.0 + _OVERSHOOT or rise.min() < -_OVERSHOOT:
        raise InputError(
            f"the response overshoots by {100 * max(rise.max() - 1.0, -rise.min()):.0f} %; table 11 is for S-shaped "
            "ones without overshoot: lower the gains, or tune by trial and error"
        )
    half = _half_window(rise)
    slope = (rise[2 * half :] - rise[: -2 * half]) / (t[2 * half :] - t[: -2 * half])
    steepest = int(slope.argmax())
    middle, m = steepest + half, float(slope[steepest])
    if slope[-1] > _SETTLED * m:
        raise InputError(
            "the response has not settled at its end (an axis under constant voltage never does); table 11 is for "
            "responses that do: record for longer, or step the position of a closed loop"
        )
    delay = float(t[middle] - rise[middle] / m)
    return ReactionCurve(delay, 1.0 / m, 1.0 if step is None else abs(float(change) / step))


def _half_window(rise: np.ndarray) -> int:
    """Half the number of samples over which a slope is taken: from one sample to a tenth of the record."""
    steps = np.abs(np.diff(rise))
    enough = min(_QUANTA * float(steps[steps > 0].min()), 0.25)
    half = 1
    while half < len(rise) // 20 and (rise[2 * half :] - rise[: -2 * half]).max() < enough:
        half += 1
    return half


def gains_from_step(result: Result, axis: str, controller: str = "PID") -> Gains:
    """The gains of table 11 from a recorded step response (`remote.Module.step`) of `axis`."""
    return ziegler_nichols(reaction_curve(result["time"], result[f"{axis}_measured"]), controller)


def quality(result: Result, axis: str) -> Quality:
    """What table 10 speaks of, measured of a recorded step (`remote.Module.step`) of `axis`.

    InputError for a record whose reference is where the axis was: no step.
    """
    t, y, point = (np.asarray(result[name]) for name in ("time", f"{axis}_measured", f"{axis}_reference"))
    step = float(point[-1] - y[0])
    if step == 0.0:
        raise InputError("the record has no step: its reference is where the axis was; step it by more")
    share = (y - y[0]) / step
    reached = [_reached(t, share, level) for level in (0.1, 0.9)]
    outside = np.flatnonzero(np.abs(share - 1.0) > _BAND)
    settled = None if outside.size and outside[-1] == len(t) - 1 else float(t[outside[-1] + 1] if outside.size else 0.0)
    return Quality(
        None if reached[1] is None or reached[0] is None else reached[1] - reached[0],
        max(0.0, 100.0 * (float(share.max()) - 1.0)),
        settled,
        float(point[-1] - y[-1]),
    )


def _reached(t: np.ndarray, share: np.ndarray, level: float) -> float | None:
    """When the response first reaches this share of the step, s, between two samples."""
    above = np.flatnonzero(share >= level)
    if not above.size:
        return None
    k = int(above[0])
    if k == 0:
        return float(t[0])
    return float(t[k - 1] + (level - share[k - 1]) / (share[k] - share[k - 1]) * (t[k] - t[k - 1]))
