"""The linear part of a controller about rest, from its own function: for costs, margins and poles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Controller, Reference
from rds.core.values import own_copy

_STEP = 1e-4  # mm of the position, and of each number of the state
_IN_PROPORTION = 1e-6
_SAMPLES_AT_REST = 2000  # at most, until the state stays: as that of a Kalman filter, whose gain settles
_SETTLED = 1e-9  # of each of its numbers
_REST = Reference(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Law:
    """A linear law with state z: u = H z + D y, z⁺ = F z + G y; one measurement, one voltage, each sample."""

    F: np.ndarray
    G: np.ndarray
    H: np.ndarray
    D: float

    @classmethod
    def gain(cls, K: float) -> Law:
        """u = K y."""
        return cls(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), K)


def linear_law(controller: Controller) -> Law:
    """u = H z + D y, z⁺ = F z + G y, from differences of `control` at rest on a reference of zero.

    z are those numbers of the state that y reaches and that reach u. InputError for a law of several axes, a state that
    is not made of numbers, and a law that does not answer in proportion (a limit, a deadband, friction compensated).
    """
    name = controller.source.name
    if controller.coupled:
        raise InputError(f"controller {name!r} drives several axes at once; the analysis is of one axis")
    state = own_copy(controller.initial_state, "initial_state", controller.source.path)
    shape, rest = _flat(state, name)
    for _ in range(_SAMPLES_AT_REST):  # what a law does at its first samples only is behind it
        before = rest
        _, state = _answer(controller, 0.0, state)
        shape, rest = _flat(state, name)
        if len(rest) == len(before) and all(map(_same, rest, before)):
            break
    u0, after = _answer(controller, 0.0, state)
    base = np.array([u0, *_flat(after, name)[1]])

    def change(size: float, index: int | None) -> np.ndarray:
        numbers = list(rest)
        if index is not None:
            numbers[index] += size
        u, following = _answer(controller, size if index is None else 0.0, _shaped(shape, numbers))
        with np.errstate(invalid="ignore"):  # of numbers that are infinite at rest
            slope: np.ndarray = (np.array([u, *_flat(following, name)[1]]) - base) / size
        return slope

    n = len(rest)
    F, G, H = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    answer = _in_proportion(change, None, name)
    if not np.any(answer):
        raise InputError(f"controller {name!r} does not answer small deviations about rest; it has no linear part")
    D, G[:, 0] = float(answer[0]), answer[1:]
    reached, left = set(np.flatnonzero(answer[1:])), list(np.flatnonzero(answer[1:]))
    while left:
        index = left.pop()
        answer = _in_proportion(change, int(index), name)
        H[0, index], F[:, index] = answer[0], answer[1:]
        further = set(np.flatnonzero(answer[1:])) - reached
        reached |= further
        left += further
    return _minimal(F, G, H, D, sorted(int(index) for index in reached))


def _same(a: float, b: float) -> bool:
    return a == b or abs(a - b) <= _SETTLED * abs(b)


def _in_proportion(change: Callable[[float, int | None], np.ndarray], index: int | None, name: str) -> np.ndarray:
    """The answer to a change of one number (None: of y); InputError where twice as much does not answer twice."""
    once, twice, back = (change(size, index) for size in (_STEP, 2.0 * _STEP, -_STEP))
    size = max(np.abs(once).max(), 1e-12)
    is_finite = np.isfinite([once, twice, back]).all()
    if not is_finite or max(np.abs(once - twice).max(), np.abs(once - back).max()) > _IN_PROPORTION * size + 1e-9:
        raise InputError(
            f"controller {name!r} does not answer in proportion about rest (a limit, friction compensated by "
            "direction); the analysis is of linear laws: leave that out for it"
        )
    return np.where(np.abs(once) > 1e-10, once, 0.0)


def _minimal(F: np.ndarray, G: np.ndarray, H: np.ndarray, D: float, reached: list[int]) -> Law:
    """Without the numbers that y does not reach (a flag, a clock, a covariance), or that do not reach u."""
    reaching = np.abs(H[0]) > 0.0
    for _ in range(len(F)):
        reaching = reaching | ((F != 0.0).T @ reaching)
    kept = [index for index in reached if reaching[index]]
    return Law(F[np.ix_(kept, kept)], G[kept], H[:, kept], D)


def _answer(controller: Controller, y: float, state: Any) -> tuple[float, Any]:
    answer = controller.control(0.0, _REST, y, state, dict(controller.params))
    return float(np.asarray(answer[0], dtype=float).reshape(())), answer[1]


def _flat(state: Any, name: str) -> tuple[Any, list[float]]:
    """The form of a state, and its numbers in order."""
    if isinstance(state, bool | int | float | np.generic):
        return None, [float(state)]
    if isinstance(state, np.ndarray):
        return ("array", state.shape), [float(value) for value in state.ravel()]
    if isinstance(state, tuple | list):
        parts = [_flat(part, name) for part in state]
        return (type(state), [part[0] for part in parts]), [number for part in parts for number in part[1]]
    raise InputError(f"the state of controller {name!r} holds a {type(state).__name__}; the analysis needs numbers")


def _shaped(shape: Any, numbers: Sequence[float]) -> Any:
    left = list(numbers)

    def build(shape: Any) -> Any:
        if shape is None:
            return left.pop(0)
        kind, inner = shape
        if kind == "array":
            return np.array([left.pop(0) for _ in range(int(np.prod(inner)))]).reshape(inner)
        parts = [build(part) for part in inner]
        return kind(parts) if kind in (tuple, list) else kind(*parts)

    return build(shape)
