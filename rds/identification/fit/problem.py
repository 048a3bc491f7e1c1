"""The least-squares problem of a simulation-error fit: which numbers are free, and the residuals they leave.

The free numbers are the parameters that are not fixed and, for each log, its initial state. A residual is measurement
minus free run. However long the logs, the solver sees one small triangular problem: with [J r] = Q R, the last column
of R stands for the residuals and the others for their derivatives, with the same sums of squares and products.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rds.identification.fit.triangle import triangle_of
from rds.identification.logs.log import Log
from rds.identification.structures.structure import Structure

# how near a bound that itself is no value may be come: 1 µs, and next to nothing of an inertia in kg·m²
_LEAST_TIME, _LEAST = 1e-6, 1e-15
_STEP = 1e-4  # of a number's size: for differences where a structure has no derivatives of its own


class Problem:
    """`structure` on `logs`, with `fixed` parameters held at their values.

    `names` are the free parameters; a point (n) holds them and then the states of each log in turn. The first `skip`
    samples of each log leave no residual: what was commanded before them still acts there, and is not known.
    """

    def __init__(
        self,
        logs: Sequence[Log],
        structure: Structure,
        fixed: Mapping[str, float],
        tick: Callable[[], None] = lambda: None,
        skip: int = 0,
    ):
        self.skip = skip
        self.logs, self.structure, self.fixed = tuple(logs), structure, dict(fixed)
        self.names = tuple(name for name in structure.parameters if name not in fixed)
        self.size = len(self.names) + structure.states * len(self.logs)
        self._order = list(structure.parameters)
        self._tick = tick
        self.runs = 0  # triangles that were made
        self._last: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def point(self, values: Mapping[str, float], states: Sequence[Sequence[float]]) -> np.ndarray:
        """The free numbers as one array."""
        return np.array([*(values[name] for name in self.names), *(x for state in states for x in state)])

    def values(self, point: np.ndarray) -> dict[str, float]:
        """All parameters, in the structure's order."""
        free = dict(zip(self.names, point.tolist(), strict=False))
        return {name: self.fixed[name] if name in self.fixed else free[name] for name in self._order}

    def state(self, point: np.ndarray, log: int) -> tuple[float, ...]:
        """The initial state of the log with this number."""
        first = len(self.names) + log * self.structure.states
        return tuple(point[first : first + self.structure.states].tolist())

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest of every free number."""
        pairs = [self.structure.bounds(name) for name in self.names]
        options = [self.structure.parameters[name] for name in self.names]
        least = [option.above + (_LEAST_TIME if option.unit == "s" else _LEAST) for option in options]
        pairs = [(max(low, above), high) for (low, high), above in zip(pairs, least, strict=True)]
        states = self.structure.state_bounds or ((-np.inf, np.inf),) * self.structure.states
        low, high = zip(*pairs, *(states * len(self.logs)), strict=True)
        return np.array(low), np.array(high)

    def columns(self, log: int) -> list[int]:
        """Which of the free numbers the log with this number depends on, in the order of its derivatives."""
        first = len(self.names) + log * self.structure.states
        return [*range(len(self.names)), *range(first, first + self.structure.states)]

    def response(self, point: np.ndarray, log: int) -> np.ndarray:
        """The free run of one log: the output (N)."""
        one = self.logs[log]
        return self.structure.respond(one.time, one.command, self.state(point, log), self.values(point))

    def residuals(self, point: np.ndarray, log: int) -> tuple[np.ndarray, np.ndarray]:
        """Measurement minus free run of one log (N), and the free run's derivatives (N, free parameters + states).

        Those of the last point are kept: what judges a fit asks for them again, where the search has ended.
        """
        last = self._last.get(log)
        if last is None or not np.array_equal(last[0], point):
            self._last[log] = last = (point.copy(), *self._run(point, log))
        return last[1], last[2]

    def _run(self, point: np.ndarray, log: int) -> tuple[np.ndarray, np.ndarray]:
        one, values, x0 = self.logs[log], self.values(point), self.state(point, log)
        with np.errstate(over="ignore", invalid="ignore"):
            if self.structure.sensitivities is None:
                y, by = self._differences(one, x0, values)
            else:
                y, all_by = self.structure.sensitivities(one.time, one.command, x0, values)
                keep = [i for i, name in enumerate(self._order) if name not in self.fixed]
                keep += range(len(self._order), len(self._order) + self.structure.states)
                by = all_by if len(keep) == all_by.shape[1] else all_by[:, keep]
        self._tick()
        error = one.position - y
        error[: self.skip] = 0.0
        by[: self.skip] = 0.0
        return error, by

    def rms(self, squares: float) -> float:
        """The root mean square of residuals with this sum of squares, in the output's unit."""
        return float(np.sqrt(squares / sum(len(log) - self.skip for log in self.logs)))

    def triangle(self, point: np.ndarray) -> np.ndarray:
        """R (n + 1, n + 1) of [J r]; NaN where the free run leaves the finite numbers."""
        n, blocks = self.size, []
        self.runs += 1
        for number in range(len(self.logs)):
            error, by = self.residuals(point, number)
            if not (np.isfinite(error).all() and np.isfinite(by).all()):
                return np.full((n + 1, n + 1), np.nan)
            columns = [*self.columns(number), n]
            wide = np.zeros((len(columns), n + 1))
            wide[:, columns] = triangle_of(by, error)
            blocks.append(wide)
        if len(blocks) == 1:
            return blocks[0]
        together = np.vstack(blocks)
        return triangle_of(together[:, :-1], together[:, -1])

    def _differences(self, log: Log, x0: Sequence[float], values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """The free run, and its central differences."""

        def run(parameters: Mapping[str, float], state: Sequence[float]) -> np.ndarray:
            return self.structure.respond(log.time, log.command, state, parameters)

        y = run(values, x0)
        by = np.empty((len(y), len(self.names) + len(x0)))
        for i, name in enumerate(self.names):
            low, high = self.structure.bounds(name)
            below, above = _around(values[name], low, high, abs(values[name]) or 1.0)
            by[:, i] = (run({**values, name: above}, x0) - run({**values, name: below}, x0)) / (above - below)
            self._tick()
        reach = float(np.ptp(log.position)) or 1.0
        for i, value in enumerate(x0):
            low, high = self.structure.state_bounds[i] if self.structure.state_bounds else (-np.inf, np.inf)
            below, above = _around(value, low, high, reach)
            plus, minus = [*x0], [*x0]
            plus[i], minus[i] = above, below
            by[:, len(self.names) + i] = (run(values, plus) - run(values, minus)) / (above - below)
            self._tick()
        return y, by


def _around(value: float, low: float, high: float, size: float) -> tuple[float, float]:
    step = _STEP * size
    return max(value - step, low), min(value + step, high)
