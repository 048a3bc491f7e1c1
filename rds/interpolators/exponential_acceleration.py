"""Exponential: weights that fall as e^(-t/τ), so that the velocity comes near its final one as 1 - e^(-t/τ).

The weights end where what is left of them is 10⁻⁵ of their sum; divided by their sum they conserve the distance
exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log

import numpy as np

from rds.core.quantities import Quantity

MULTIPLIERS = False
OPTIONS: Mapping[str, Quantity] = {"time_constant": Quantity("time constant τ of the velocity", "s", above=0.0)}
DEFAULTS = {"time_constant": 0.02}  # chosen
_LEFT = 1e-5


def weights(T: float, params: Mapping[str, float]) -> np.ndarray:
    """Not yet divided by their sum, for samples of `T` s."""
    tau = params["time_constant"]
    return np.exp(-T / tau * np.arange(max(1, ceil(-log(_LEFT) * tau / T))))
