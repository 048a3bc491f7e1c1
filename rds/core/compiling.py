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

_CHANGED: dict[Path, float] = {}  # folders of kernels, and when a file there was last changed


def kernel(function: F) -> F:
    """The function compiled, or itself. No reordering of sums: compiled and plain give the same samples."""
    return _compiled(function) if COMPILED else function


def long_kernel(function: F) -> F:
    """The same of a kernel that goes on for long: other threads of the program go on meanwhile."""
    return _compiled(function, nogil=True) if COMPILED else function


def _compiled(function: F, **options: Any) -> F:
    compiled: Any = njit(cache=True, **options)(function)
    folder = Path(function.__code__.co_filename).parent
    if folder not in _CHANGED:
        with suppress(OSError):
            _CHANGED[folder] = max((file.stat().st_mtime for file in folder.glob("*.py")), default=0.0)
            _forget_old(Path(compiled.stats.cache_path))
    return cast(F, compiled)


def _forget_old(kept: Path) -> None:
    """Drop what a folder has of kernels compiled before a file changed: of its own folder, or of one whose kernels have
    been met, which it may call. Numba looks at a kernel's own file, not at those of the kernels that it calls.
    """
    newest = max(_CHANGED.values())
    for index in kept.glob("*.nbi"):
        with suppress(FileNotFoundError):  # another process was first
            if index.stat().st_mtime < newest:
                index.unlink()
