"""S-shape: weights that rise and fall (1 2 3 2 1), so that the curve of the velocity is an S.

The multipliers may be given, one for each sample; equal ones make the linear type of them. Else they are those of a
triangle over `time` s: acceleration has no jump, and a velocity V is reached with at most 2 V / time.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rds.core.quantities import Quantity

MULTIPLIERS = True
OPTIONS: Mapping[str, Quantity] = {"time": Quantity("how long the velocity rises or falls", "s", low=0.0)}
DEFAULTS = {"time": 0.05}  # chosen


def weights(T: float, params: Mapping[str, float]) -> np.ndarray:
    """1, 2, ... 2, 1 over as many samples of `T` s as are nearest to `time`; not yet divided by their sum."""
    k = np.arange(max(1, round(params["time"] / T)))
    return np.minimum(k + 1.0, len(k) - k)
