"""Which of a model's errors are within the bands, on one log."""

from __future__ import annotations

import numpy as np

from rds.identification.validate.assessment import Assessment
from rds.identification.validate.verdict import Bands


def passes(a: Assessment, bands: Bands) -> tuple[bool, bool]:
    """Whether the free run's position and velocity are within the band."""
    position = a.free_run is not None and a.free_run.fit_percent >= bands.fit_percent
    velocity = a.velocity is not None and a.velocity.fit_percent >= bands.fit_percent
    return position, velocity if a.velocity is not None else position


def skilled_at(a: Assessment, bands: Bands) -> list[int]:
    """The horizons, in samples, at which the model predicts clearly better than no model."""
    return [k for k, e in a.ahead.items() if k in a.naive and e.rmse < bands.skill * a.naive[k].rmse]


def foreseen_at(a: Assessment, bands: Bands) -> list[int]:
    """Those of `skilled_at` at which it foretells the way to the band of the fit, as a free run must."""
    share = 1.0 - bands.fit_percent / 100.0
    way = {k: float(np.sqrt(np.mean((a.measured[k:] - a.measured[:-k]) ** 2))) for k in skilled_at(a, bands)}
    return [k for k in way if a.ahead[k].rmse <= share * way[k]]
