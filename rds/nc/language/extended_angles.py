"""Angles in extended precision (80 bits where the processor has them), as LinuxCNC works them out.

From the fast lane's library, where there is one, else by numpy, whose import takes longer than a thousand lines.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

from rds.nc.language.fast_lane_files import library

NAMES = ("sin", "cos", "tan", "degrees")
_PI = "3.14159265358979323846264338327950288"


def functions() -> dict[str, Callable[[float], float]]:
    """sin, cos and tan of degrees; `degrees` of what 180 times an angle in radians is."""
    try:
        return {name: _native(name) for name in NAMES}
    except AttributeError:
        return _of_numpy()


def _native(name: str) -> Callable[[float], float]:
    function: Callable[[float], float] = getattr(library(), f"rds_{name}")
    function.restype, function.argtypes = ctypes.c_double, (ctypes.c_double,)  # type: ignore[attr-defined]
    return function


def _of_numpy() -> dict[str, Callable[[float], float]]:
    import numpy as np

    pi = np.longdouble(_PI)

    def circular(function: np.ufunc) -> Callable[[float], float]:
        return lambda degrees: float(function(np.longdouble(degrees) * pi / 180))

    found = {name: circular(getattr(np, name)) for name in NAMES[:3]}
    return found | {"degrees": lambda share: float(np.longdouble(share) / pi)}
