"""The feed override that keeps cutting force and joint loads within their limits (mrm-control, section 7.1).

The paper scales the interpolation's cycle time, T_IPO = √(Δx² + Δy²)/(f K_override) (equation 5; a difference under the
root is a misprint), so that the feed becomes K f; here the override's rate is K. Forces grow with the feed to the
power α, and loads in proportion to the force: a plan that takes the share s of a limit keeps it at K = s^(-1/α).

What the plan takes is known ahead, so that the rate is down before the cut begins; what the load cell measures beside
it says by how much the work is harder than its law. Where the drivers hear no cell its signal is simulated. A machine's
cell lowers the rate only: where it measures less than the law, the tool may not be in the work yet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

AHEAD = 0.5  # s of the plan that are looked at: as long as a ramp of the rate may take
SETTLING = 0.05  # s: time constant with which the cell corrects the law
MARGIN = 0.97  # of the rate that the limit allows: a ramp of the rate swings over its end
RAISE = 1.05  # the rate is raised in steps of at least so much
LEAST, MOST = 0.01, 2.0  # rates
_HARDER, _SOFTER = 20.0, 0.05  # bounds of what the cell may say beside the law
_FELT = 0.02  # of the largest force: less says nothing about the material
COLUMN = {"cutting_force": "N"}
Cell = Callable[[], "float | None"]  # what a load cell measured last, N; None: it has not said anything


@dataclass(frozen=True)
class ForceGuard:
    """At each planned sample: cutting `force` (m,), N, and the largest `share` (m,) of a limit, at the planned feed.

    `exponent` is α. `hardness` is what the simulated cell measures of the force by the law.
    """

    force: np.ndarray
    share: np.ndarray
    exponent: float
    hardness: float = 1.0

    def start(self, T: float, cell: Cell | None = None) -> Guarding:
        """The guard of a run that begins, with samples of `T` s, and the machine's load `cell` if it has one."""
        return Guarding(self, T, cell)


class Guarding:
    """A guard at work: `measured` is the cell's signal now, N, and `factor` what it is of the force by the law."""

    def __init__(self, guard: ForceGuard, T: float, cell: Cell | None = None):
        import numpy as np

        views: list[Any] = [
            np.ascontiguousarray(column, dtype=float).data for column in (guard.force, ahead(guard.share, AHEAD, T))
        ]
        self._force, self._share = views
        self._last = len(guard.force) - 1
        self._exponent, self._hardness, self._cell = guard.exponent, guard.hardness, cell
        self._felt = _FELT * float(guard.force.max(initial=0.0))
        self._gain = T / (T + SETTLING)
        self.factor = 1.0
        self.measured = 0.0
        self._allowed = MOST

    def cell(self, place: float, rate: float) -> float:
        """What the load cell measures, N: the machine's, or simulated at a place of the plan passed at this rate."""
        measured = None if self._cell is None else self._cell()
        return self._hardness * self._expected(place, rate) if measured is None else measured

    def allowed(self, place: float, rate: float) -> float:
        """The rate that keeps the limits from here on, when the sample at `place` was passed at `rate`."""
        self.measured = self.cell(place, rate)
        expected = self._expected(place, rate)
        if expected > self._felt:
            least = _SOFTER if self._cell is None or self._cell() is None else 1.0
            said = min(max(self.measured / expected, least), _HARDER)
            self.factor += self._gain * (said - self.factor)
        share = self.factor * self._share[min(int(place), self._last)]
        keeps = MOST
        if share > 0.0:
            keeps = min(max(MARGIN * share ** (-1.0 / self._exponent), LEAST), MOST)
        if keeps < self._allowed or keeps >= RAISE * self._allowed or keeps == MOST:
            self._allowed = keeps
        return self._allowed

    def _expected(self, place: float, rate: float) -> float:
        return float(self._force[min(int(place), self._last)] * rate**self._exponent) if rate > 0.0 else 0.0


def ahead(values: np.ndarray, seconds: float, T: float) -> np.ndarray:
    """The largest of the values within the next `seconds`, at each sample of `T` s."""
    import numpy as np

    made = np.array(values, dtype=float)
    reach, wanted = 1, max(1, round(seconds / T))  # made[i] is the largest of `reach` values from i on
    while reach < wanted:
        step = min(reach, wanted - reach)
        made[:-step] = np.maximum(made[:-step], made[step:])
        reach += step
    return made
