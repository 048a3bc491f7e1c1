"""Compilation of kernels: by numba where it is installed (extra `fast`), else they run in Python as they are.

Kept on disk by numba, so that only the first use after installing waits for the compiler (some 15 s).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
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


def long_kernel(function: F) -> F:
    """The same of a kernel that goes on for long: other threads of the program go on meanwhile."""
    compiled: Any = njit(cache=True, nogil=True)(function) if COMPILED else function
    return cast(F, compiled)


def _forget_old() -> None:
    """Drop what was compiled before a file here changed: numba looks at a kernel's own file, not at those it calls."""
    folder = Path(__file__).parent
    with suppress(OSError):
        newest = max(file.stat().st_mtime for file in folder.glob("*.py"))
        for index in folder.glob("__pycache__/*.nbi"):
            if index.stat().st_mtime < newest:
                index.unlink()


if COMPILED:
    _forget_old()
