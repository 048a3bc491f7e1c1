"""Predictions k samples ahead, and the errors of a prediction.

From each sample s the model moves on from the measured output y(s), with its own motion (velocity and friction state)
of the free run:

    ŷ(s + k | s) = y(s) + ŷ(s + k) - ŷ(s)

For an axis, whose motion does not depend on where it is, this is the free run with the position set right at s. So
short predictions are good whatever the model (nothing moves far in a millisecond), and only say something beside the
free run; measurement noise is in them twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan

import numpy as np

from rds.identification.fit.estimate import Errors
from rds.results.metrics import fit_percent

STEPS = (1, 10, 100)  # samples


def errors_of(measured: np.ndarray, modelled: np.ndarray, unit: str) -> Errors:
    """Model minus measurement; the fit is NaN where the measurement is constant."""
    error = modelled - measured
    fit = fit_percent(measured, modelled)
    rmse = float(np.sqrt(np.mean(error**2)))
    return Errors(nan if fit is None else fit, rmse, float(np.abs(error).max()), unit)


def ahead(measured: np.ndarray, modelled: np.ndarray, unit: str, steps: Sequence[int] = STEPS) -> dict[int, Errors]:
    """Errors of the predictions so many samples ahead, from every sample that has that many after it."""
    found = {}
    for k in steps:
        if 0 < k < len(measured):
            predicted = measured[:-k] + modelled[k:] - modelled[:-k]
            found[k] = errors_of(measured[k:], predicted, unit)
    return found


def over_noise(predicted: Mapping[int, Errors], noise: float) -> tuple[int, float] | None:
    """The farthest prediction, in samples ahead, and its RMSE over what `noise` alone makes of it; None for no noise.

    It begins at a measured position and ends at one, so noise alone makes √2 of it. Over so short a time the error of
    a free run without its controller hardly adds up: what is left, the model lacks, or its parameters are off.
    """
    if not predicted or noise <= 0.0:
        return None
    k = max(predicted)
    return k, predicted[k].rmse / (np.sqrt(2.0) * noise)
