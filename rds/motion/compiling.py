"""Compilation of the planner's kernels: by numba where it is installed (extra `fast`), else they run in Python as they
are.

Kept on disk by numba, so that only the first use after installing waits for the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

try:
    from numba import njit
except ImportError:  # the extra is not installed
    COMPILED = False
else:
    COMPILED = True


def kernel(function: F) -> F:
    """The function compiled, or itself. No reordering of sums: compiled and plain give the same samples."""
    compiled: Any = njit(cache=True)(function) if COMPILED else function
    return cast(F, compiled)
