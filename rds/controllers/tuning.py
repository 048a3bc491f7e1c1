"""Default gains from the axis's time constant and gain, so that any axis is well damped at any sample period.

A position axis K/(s (τ s + 1)) in a sampled loop lags by τ, by half a period for the hold and by up to one more
period for the bus. The sum τ_Σ = τ + 1.5 T takes the place of τ; every gain below follows from K and τ_Σ alone,
so the shape of the response is the same for every axis and its speed falls as T grows. A spindle K/(τ s + 1) has
the dead time θ = 1.5 T beside its lag.
"""

from __future__ import annotations

from rds.controllers.axis_data import AxisData

BANDWIDTH = 0.7  # ω τ_Σ of the position loop's pair of poles
DAMPING = 0.8  # of that pair: as the paper's poles -32 ± 24i
SLOW_POLE = 0.4  # of ω: the third pole, which the integral brings
SPINDLE_LOOP_GAIN = 9.0  # at most: a steady error of 10 % under P alone
SPINDLE_SPEED_UP = 5.0  # closed loop at most this many times faster than the spindle itself


def lag(axis: AxisData) -> float:
    """τ_Σ, s."""
    return axis.tau + 1.5 * axis.T


def proportional_gain(axis: AxisData) -> float:
    """P alone, V/mm.

    Axis: K P = 1/(2 τ_Σ), the modulus optimum: damping 0.71, overshoot about 4 %. Spindle: K P = τ/(2 θ), which
    leaves a phase margin above 60°, and at most 9.
    """
    if axis.spindle:
        return min(SPINDLE_LOOP_GAIN, axis.tau / (3.0 * axis.T)) / axis.K
    return 0.5 / (axis.K * lag(axis))


def pid_gains(axis: AxisData) -> dict[str, float]:
    """Pgain, Igain, Dgain and the derivative's filter time.

    Axis: the PID that places the poles of K/(s (τ_Σ s + 1)) at ω(-0.8 ± 0.6i) and -0.4 ω with ω = 0.7/τ_Σ, its
    derivative filtered with τ_Σ/8. A step overshoots by about a quarter, as it must where two integrators meet a
    constant; `set_point_weight` avoids that. Spindle: PI by internal-model control, Igain = Pgain/τ and
    K P = τ/(λ + θ), for a closed loop 1/(λ s + 1) with λ = τ/5, but not below θ: no overshoot.
    """
    if axis.spindle:
        dead_time = 1.5 * axis.T
        wanted = max(axis.tau / SPINDLE_SPEED_UP, dead_time)
        P = axis.tau / (axis.K * (wanted + dead_time))
        return {"Pgain": P, "Igain": P / axis.tau, "Dgain": 0.0, "derivative_filter": 0.0}
    total = lag(axis)
    omega = BANDWIDTH / total
    return {
        "Pgain": total * omega**2 * (1.0 + 2.0 * DAMPING * SLOW_POLE) / axis.K,
        "Igain": total * omega**3 * SLOW_POLE / axis.K,
        "Dgain": (BANDWIDTH * (2.0 * DAMPING + SLOW_POLE) - 1.0) / axis.K,
        "derivative_filter": total / 8.0,
    }


def set_point_weight(axis: AxisData) -> float:
    """The share b of the reference that passes through Pgain.

    Axis: the zero -Igain/(b Pgain) then lies on the slow pole, so that a step is answered by the well-damped pair
    alone, with 2 % of overshoot. Spindle: 1, as its PI does not overshoot.
    """
    return 1.0 if axis.spindle else 1.0 / (1.0 + 2.0 * DAMPING * SLOW_POLE)


def cascade_gains(axis: AxisData, resistance: float, speed_filter: float | None = None) -> dict[str, float]:
    """Gains of the servo cascade: Kpp (1/s), Kp, Ki, Kd, the speed's filter (s) and the speed feedforward.

    The current amplifier leaves the speed an integrator, τ v̇ = K R i, behind a delay σ: half a period for the hold,
    up to one more for the bus, half a period for the difference of positions, and the filter. The lag of its back-EMF
    makes τ + σ of τ. Kp places the crossover at ω = 1/(4 σ), Ki = Kp ω/20 gives the two poles a damping of 2.2, so
    that a step of the speed overshoots by less than 5 %. Kpp = ω/4: four times slower than the speed loop.
    """
    time = speed_filter if speed_filter is not None else 0.0 if axis.spindle else lag(axis) / 8.0
    sigma = (1.5 if axis.spindle else 2.0) * axis.T + time
    omega = 0.25 / sigma
    Kp = omega * (axis.tau + sigma) / (axis.K * resistance)
    gains = {"Kp": Kp, "Ki": Kp * omega / 20.0, "Kd": 0.0, "speed_filter": time}
    return gains if axis.spindle else gains | {"Kpp": omega / 4.0, "speed_feedforward": 1.0}
