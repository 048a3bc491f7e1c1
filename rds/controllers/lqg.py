"""Linear-quadratic-Gaussian control of an axis through a known delay, with late and lost measurements.

    x' = A x + B (u(t - delay) + d) + noise        x = [position, velocity], d a disturbance voltage that drifts
    y_k = position + noise

Optimal for a constant delay is: estimate the state, predict it to the instant from which this sample's voltage acts,
and apply the gain of the loop without delay to that (separation). So the delay is in the prediction, whole samples
and fraction, and the gain is that of `lqg_design`. The estimate is a Kalman filter whose gain follows the measurements
as they come: one that is late by whole samples (its `age`) corrects the state of when it was measured, which is then
predicted on with the voltages that were sent since; without a new one the prediction goes on and its covariance grows.
The filter's gain is that of the measured instant, not the predictor's.

The reference is extrapolated over the delay by its velocity and acceleration.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.controllers.axis_data import axis_data, check_delayed
from rds.controllers.lqg_design import Design, designed
from rds.core.errors import InputError
from rds.core.options import read_options
from rds.core.quantities import Quantity, listed
from rds.core.types import NOT_LIVE, Controller, Reference, Source

NAME = "lqg"
SPINDLE = False
OPTIONS = {
    "delay": Quantity("from a sampling instant until its voltage acts", "s", 0.0, 1000.0),
    "error": Quantity("position error that costs as much as `voltage`", "mm", above=0.0),
    "voltage": Quantity("voltage that costs as much as `error`", "V", above=0.0),
    "disturbance": Quantity("white noise of the voltage, root of its intensity", "V√s", low=0.0),
    "drift": Quantity("drift of the disturbance that is estimated; 0: none, and no integral action", "V/√s", low=0.0),
    "noise": Quantity("noise of a measurement, rms", "mm", above=0.0),
}
DEFAULTS = {"delay": 0.0, "error": 0.01, "voltage": 1.0, "disturbance": 0.01, "drift": 1.0, "noise": 0.002}
REMEMBERED = 50  # samples without a measurement after which older voltages are forgotten
State = tuple[float, ...]


def control(t: float, r: Reference, y: float, state: State, params: Mapping[str, Any]) -> tuple[float, State]:
    """Voltage (V) and next state. `y.age`, where a measurement has it, says how many samples old it is.

    State: 1.0 once it has begun; samples since the last estimate; its position, velocity and disturbance; its
    covariance (six numbers); the voltages sent, the latest first.
    """
    design: Design = params["design"]
    age = getattr(y, "age", 0)
    begun, since, *rest = state
    estimate, covariance, sent = tuple(rest[:3]), tuple(rest[3:9]), rest[9:]
    n = int(since) + 1 if begun else 0
    if not begun:
        estimate, covariance = (float(y), 0.0, 0.0), design.covariance
    elif age < n:
        for i in range(n, age, -1):  # to the instant of the measurement
            estimate = design.onward(estimate, sent, i)
            covariance = design.spread(covariance)
        estimate, covariance = design.corrected(estimate, covariance, float(y))
        n = age
    while n > REMEMBERED:
        estimate, covariance, n = design.onward(estimate, sent, n), design.spread(covariance), n - 1
    now = estimate
    for i in range(n, 0, -1):
        now = design.onward(now, sent, i)
    u = design.voltage(design.ahead(now, sent), r)
    return u, (1.0, float(n), *estimate, *covariance, u, *sent[:-1])


def observe(y: float, state: State, following: State, params: Mapping[str, Any]) -> tuple[float, float]:
    """The estimated velocity (mm/s) and disturbance (V) at the last measurement."""
    return following[3], following[4]


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """The controller of one position axis; see `rds.controllers.library_controller` and `OPTIONS`.

    InputError for a spindle, and for a delay of more than 200 samples.
    """
    owner = f"controller {NAME!r}"
    given = DEFAULTS | read_options(options, OPTIONS, owner)
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    check_delayed(axis, given["delay"], owner)
    try:
        design = designed(axis.tau, axis.K, T, converter_range, given)
    except (ArithmeticError, ValueError) as error:  # ValueError: scipy's, of an equation without a solution
        numbers = listed({name: given[name] for name in OPTIONS})
        said = f"{owner}: there are no gains for {numbers}, tau = {axis.tau:g} s and K = {axis.K:g}"
        raise InputError(f"{said}; choose numbers that are less far from each other") from error
    start = (0.0, 0.0, 0.0, 0.0, 0.0, *design.covariance, *[0.0] * (REMEMBERED + design.whole + 2))
    params = {**given, "gains": list(design.gain), "design": design}
    signals = {"velocity": f"{unit}/s", "disturbance": "V"}
    return Controller(control, start, params, Source(NAME), retune=NOT_LIVE, signals=signals, observe=observe)
