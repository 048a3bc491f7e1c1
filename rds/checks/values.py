"""Values of a student's making, compared, measured and shown without trusting their own methods."""

from __future__ import annotations

import numbers
from collections import deque
from collections.abc import Mapping, Set
from enum import Enum
from math import isclose, isnan
from types import BuiltinFunctionType, FunctionType
from typing import Any

import numpy as np

RELATIVE = 1e-9  # two runs of the same matrix product may differ in their last bits
ABSOLUTE = 1e-12
_DEEPEST = 40
_MOST = 10**9  # values of a state: where counting ends
Seen = dict[tuple[int, int], tuple[Any, Any]]  # values by their id(), which are kept so that no other gets it


def same(a: Any, b: Any, depth: int = 0, seen: Seen | None = None) -> bool:
    """Whether two values hold the same, to rounding; NaN is NaN, a list is a tuple, equally named classes are one.

    Classes are compared by name because two freshly loaded copies of a file define each of them twice. `seen` has the
    pairs that are being compared, so that what holds itself, or a part many times, is gone through once.
    """
    if a is b or depth > _DEEPEST:
        return True
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (isnan(a) and isnan(b)) or isclose(a, b, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b, depth, seen)
    if isinstance(a, Enum) or isinstance(b, Enum):
        return str(a) == str(b)
    if isinstance(a, numbers.Number) and isinstance(b, numbers.Number):
        return _same_numbers(a, b)
    seen = {} if seen is None else seen
    if (id(a), id(b)) in seen:
        return True
    seen[id(a), id(b)] = a, b
    if isinstance(a, list | tuple | deque) and isinstance(b, list | tuple | deque):
        return len(a) == len(b) and all(same(p, q, depth + 1, seen) for p, q in zip(a, b, strict=True))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return len(a) == len(b) and all(key in b and same(a[key], b[key], depth + 1, seen) for key in a)
    if type(a).__qualname__ != type(b).__qualname__:
        return False
    if isinstance(a, str | bytes | Set | range | type(None)):
        return bool(a == b)
    if isinstance(a, type | FunctionType | BuiltinFunctionType):
        return getattr(a, "__qualname__", None) == getattr(b, "__qualname__", None)
    return same(_parts(a), _parts(b), depth + 1, seen)


def _same_numbers(a: Any, b: Any) -> bool:
    if isinstance(a, bool) != isinstance(b, bool):
        return False
    p, q = complex(a), complex(b)
    return same(p.real, q.real) and same(p.imag, q.imag)


def _same_arrays(a: Any, b: Any, depth: int, seen: Seen | None) -> bool:
    p, q = np.asarray(a), np.asarray(b)
    if p.shape != q.shape:
        return False
    if p.dtype.kind in "fcbiu" and q.dtype.kind in "fcbiu":
        if p.dtype == q.dtype and p.tobytes() == q.tobytes():  # allclose takes a hundred times as long
            return True
        return bool(np.allclose(p, q, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True))
    return same(p.tolist(), q.tolist(), depth + 1, seen)


def _parts(value: Any) -> Any:
    """What an object would be rebuilt from, or else its attributes."""
    try:
        return list(value.__reduce_ex__(4)[1:])
    except Exception:  # an iterator of the system's, or an object with a lock or a file in it
        return getattr(value, "__dict__", None)


def is_plain(value: Any, depth: int = 0, seen: set[int] | None = None) -> bool:
    """Whether it consists of numbers, texts, lists, tuples, dicts and arrays, with no class of a student's in it."""
    if value is None or type(value) in (bool, int, float, complex, str, bytes) or isinstance(value, np.generic):
        return True
    if type(value) is np.ndarray:
        return bool(value.dtype.kind in "fcbiu")
    if depth > _DEEPEST:
        return False
    seen = set() if seen is None else seen
    if id(value) in seen:
        return True
    seen.add(id(value))
    if type(value) in (list, tuple, deque):
        return all(is_plain(part, depth + 1, seen) for part in value)
    return type(value) is dict and all(is_plain(part, depth + 1, seen) for pair in value.items() for part in pair)


def size(value: Any, depth: int = 0, known: dict[int, int] | None = None) -> int:
    """How many single values it holds, of which a part that it holds many times counts as often."""
    if isinstance(value, np.ndarray):
        return int(value.size)
    if isinstance(value, str | bytes):
        return max(1, len(value))
    if depth > _DEEPEST or isinstance(value, numbers.Number | type(None) | Enum | type | FunctionType):
        return 1
    known = {} if known is None else known
    if id(value) not in known:
        known[id(value)] = 1  # while it is counted, for what holds itself
        known[id(value)] = min(_size(value, depth, known), _MOST)
    return known[id(value)]


def _size(value: Any, depth: int, known: dict[int, int]) -> int:
    if isinstance(value, Mapping):
        return sum(size(part, depth + 1, known) for part in value.values())
    if isinstance(value, list | tuple | deque | Set):
        return sum(size(part, depth + 1, known) for part in value)
    own = getattr(value, "__dict__", None)
    return size(own, depth + 1, known) if own else 1


def is_real(value: Any) -> bool:
    """Whether it is one real number, as `float()` takes it: not a bool, nor text, nor an array with dimensions."""
    if isinstance(value, bool | np.bool_):
        return False
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "fiu"
    return isinstance(value, numbers.Real)
