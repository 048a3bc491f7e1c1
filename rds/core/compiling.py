"""Compilation of kernels: by numba where it is installed (extra `fast`), else they run in Python as they are.

Kept on disk by numba, so that only the first use after installing waits for the compiler (some 40 s for the planner of
motion). Short work does not wait for it: the planner's kernels run in Python until they have taken some seconds.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from functools import cache
from math import inf
from pathlib import Path
from threading import local
from time import thread_time
from typing import Any, TypeVar, cast

import numpy as np

from rds.core.errors import Notice

F = TypeVar("F", bound=Callable[..., Any])

try:
    from numba import config, njit
except ImportError:  # the extra is not installed
    COMPILED = False
else:
    COMPILED = not vars(config)["DISABLE_JIT"]  # which a user sets to look into a kernel

# s of processor time that tiered kernels run in Python before one is compiled: a busy computer makes no program long
LONG = 20.0
LOADED = 0.1  # s, the same of a compiled one that is kept on disk: loading all of them takes some 0.4 s
_AGAIN = 0.5  # s in Python, after which they are looked for on disk again
_COMPILING = "the planner is being compiled, because this motion is long: that takes some 40 s, once"

_PYTHON = f"py{sys.version_info.major}{sys.version_info.minor}{getattr(sys, 'abiflags', '')}"  # in numba's file names

_CHANGED: dict[Path, float] = {}  # folders of kernels, and when a file there was last changed


def kernel(function: F) -> F:
    """The function compiled, or itself. No reordering of sums: compiled and plain give the same samples."""
    return _compiled(function) if COMPILED else function


def long_kernel(function: F) -> F:
    """The same of a kernel that goes on for long: other threads of the program go on meanwhile."""
    return _compiled(function, nogil=True) if COMPILED else function


def tiered_kernel(function: F) -> F:
    """The same, in Python until this process has spent LONG in such kernels: a short program never waits for the
    compiler. Compiled and plain give the same samples, so it does not matter when one takes the other's place.
    """
    return cast(F, TieredKernel(function, _compiled(function))) if COMPILED else function


def compile_tiered() -> None:
    """From here on, tiered kernels are compiled: what is to be done is known to be long."""
    TieredKernel.spent = inf


class _Within(local):
    """Of each thread: when it entered the kernel that it runs in Python and that no other one called; 0 outside."""

    since = 0.0


class TieredKernel:
    """Callable from Python in either way, and from compiled kernels as the compiled one.

    Kernels that one in Python calls look at the clock too: one call may take long, of which they do most of the work.
    """

    __slots__ = ("compiled", "enough", "is_kept", "looked", "plain")
    spent = 0.0  # s, of all of them in Python
    looks, next_look = 0, LOADED  # how often they were looked for on disk, and what is spent when they are next
    told = False  # that one is being compiled
    within = _Within()

    def __init__(self, plain: Callable[..., Any], compiled: Any) -> None:
        self.plain, self.compiled = plain, compiled
        self._look()

    def __call__(self, *values: Any, **named: Any) -> Any:
        of = TieredKernel
        if of.spent >= self.enough and (self.is_kept or of.told):
            return self.compiled(*values, **named)  # most calls of a long program, without a look at the clock
        now = thread_time()
        since = of.within.since
        spent = of.spent + (now - since if since else 0.0)
        if not self.is_kept and LOADED <= spent < LONG:
            self._look_again(spent)
        if spent >= self.enough:
            if not (self.is_kept or of.told):
                of.told = True
                warnings.warn(Notice(_COMPILING), stacklevel=2)
            return self.compiled(*values, **named)
        if since:
            return self.plain(*values, **named)
        of.within.since = now
        try:
            # In a context that ends with the call, else an interruption may leave numpy's warnings off.
            return copy_context().run(self._silently, *values, **named)
        finally:
            of.within.since = 0.0
            of.spent += thread_time() - now

    def _look(self) -> None:
        # Each for itself: while another process compiles them, or after it was interrupted, only some are there.
        kept = _kept(Path(self.compiled.stats.cache_path))
        named = f".{self.plain.__qualname__}-"
        self.is_kept = any(named in name and name.endswith(f".{_PYTHON}.nbi") for name in kept)
        self.enough = LOADED if self.is_kept else LONG
        self.looked = TieredKernel.looks

    def _look_again(self, spent: float) -> None:
        """Another process may have compiled it since."""
        of = TieredKernel
        if spent >= of.next_look:
            of.looks, of.next_look = of.looks + 1, spent + _AGAIN
            _kept.cache_clear()
        if self.looked != of.looks:
            self._look()

    def _silently(self, *values: Any, **named: Any) -> Any:
        with np.errstate(all="ignore"):  # compiled kernels say nothing either
            return self.plain(*values, **named)

    @property
    def _numba_type_(self) -> Any:
        """Numba asks for this where a compiled kernel calls this one."""
        return self.compiled._numba_type_


def _compiled(function: F, **options: Any) -> F:
    compiled: Any = njit(cache=True, **options)(function)
    folder = Path(function.__code__.co_filename).parent
    if folder not in _CHANGED:
        with suppress(OSError):
            _CHANGED[folder] = max((file.stat().st_mtime for file in folder.glob("*.py")), default=0.0)
            _forget_old(Path(compiled.stats.cache_path))
    return cast(F, compiled)


@cache
def _kept(folder: Path) -> list[str]:
    """The names of the indexes that numba has there, as they were when they were last looked for."""
    return [index.name for index in folder.glob("*.nbi")]


def _forget_old(kept: Path) -> None:
    """Drop what a folder has of kernels compiled before a file changed: of its own folder, or of one whose kernels have
    been met, which it may call. Numba looks at a kernel's own file, not at those of the kernels that it calls.
    """
    newest = max(_CHANGED.values())
    for index in kept.glob("*.nbi"):
        with suppress(FileNotFoundError):  # another process was first
            if index.stat().st_mtime < newest:
                index.unlink()
