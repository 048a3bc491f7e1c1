"""Linear: equal weights. The velocity rises along a straight line for `time` s, and falls so: a = V / time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rds.core.quantities import Quantity

MULTIPLIERS = False
OPTIONS: Mapping[str, Quantity] = {"time": Quantity("how long the velocity rises or falls", "s", low=0.0)}
DEFAULTS = {"time": 0.05}  # chosen


def weights(T: float, params: Mapping[str, float]) -> np.ndarray:
    """As many as samples of `T` s are nearest to `time`, at least one; not yet divided by their sum."""
    return np.ones(max(1, round(params["time"] / T)))
