"""What holds a program's motion back: the feed, or which limit of which axis, where; and what would save a second."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.interpolators.motion.least_time import LeastTime
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.pieces import BEND, DISTANCE, RATIO, SLOPE, TWIST
from rds.interpolators.motion.planner import plan
from rds.interpolators.motion.segments import AXES, LINE, SEGMENT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = ("velocity", "acceleration", "jerk")
PER = ("/s", "/s²", "/s³")
FEED, PATH, REST = "programmed feed", "corners and ends ahead", "at rest"
NEAR = 0.95  # of a limit: it holds the motion back
EVEN = 0.75  # of the even speed that a bend allows: it does so too; the planner keeps some of the jerk for ramps
NO_WAY = 2e-9  # mm in X, Y and Z: of a move of rotary axes
TINY = 1e-9  # of a derivative of the path: what is less asks nothing of an axis
SAVED = 1.0  # s
ASKED = 3  # limits
MOST_TIMES = 16.0  # that a limit is raised to, when a second is looked for
_ROUNDS = 10
_PLANS = 2 + _ROUNDS  # that one limit takes at most; one that saves nothing takes two


@dataclass(frozen=True)
class Limiting:
    """Of each planned sample: time (s), way along the programmed path (mm), programmed and planned speed (mm/s; nan
    and the planned one in rapids), the highest even speed at which the axes can go along its piece of the path (mm/s),
    its line, and what holds it back (index into `causes`). Where rotary axes move alone, way and speeds are in degrees.
    least_time: of the whole, without a limit of the jerk, s.
    """

    time: np.ndarray
    way: np.ndarray
    programmed: np.ndarray
    planned: np.ndarray
    allowed: np.ndarray
    line: np.ndarray
    cause: np.ndarray
    causes: tuple[str, ...]
    T: float
    least_time: float

    @property
    def seconds(self) -> dict[str, float]:
        """How long each cause holds the motion back, the longest first."""
        count = np.bincount(self.cause, minlength=len(self.causes)) * self.T
        pairs = sorted(zip(self.causes, count.tolist(), strict=True), key=lambda pair: -pair[1])
        return {name: seconds for name, seconds in pairs if seconds > 0.0}

    def lines_of(self, cause: str, most: int = 3) -> list[int]:
        """The lines that a cause holds back for longest."""
        rows = self.cause == self.causes.index(cause)
        lines, count = np.unique(self.line[rows], return_counts=True)
        return [int(line) for line in lines[np.argsort(-count, kind="stable")][:most]]

    def draw(self, top: Axes, below: Axes) -> None:
        """Programmed, allowed and planned speed along the path, and below them what holds the motion back."""
        from rds.core.figure import BLUE, GREY, ORANGE, dress, legend

        every = max(len(self.time) // 20000, 1)
        way = self.way[::every]
        allowed: dict[str, Any] = {"color": GREY, "linewidth": 1.0, "linestyle": (0, (4, 2))}
        top.plot(way, self.allowed[::every], label="allowed by velocity, acceleration and jerk", **allowed)
        top.plot(way, self.programmed[::every], color=ORANGE, linewidth=2.0, alpha=0.6, label="programmed")
        top.plot(way, self.planned[::every], color=BLUE, linewidth=1.2, label="planned")
        dress(top, "speed [mm/s]", None)
        legend(top)
        names = list(self.seconds)
        rank = np.array([names.index(name) if name in names else len(names) for name in self.causes])
        below.plot(way, rank[self.cause][::every], "|", color=BLUE, markersize=7)
        below.set_yticks(range(len(names)), names)
        below.invert_yaxis()
        dress(below, "held back by", "way along the program [mm]")


class _Pieces(LeastTime):
    """Keeps of each piece where it begins, what even speed its axes allow (programmed mm/s), and by which limit."""

    def __init__(self, limits: Limits, T: float):
        super().__init__(limits, T)
        self._table: list[np.ndarray] = []
        self._most = np.concatenate([getattr(limits, kind) for kind in KINDS])

    def extend(self, f: np.ndarray, u: np.ndarray) -> None:
        super().extend(f, u)
        derivatives = np.column_stack([f[:, first : first + 6] for first in (SLOPE, BEND, TWIST)])
        asks = np.where(derivatives > TINY, derivatives, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.where(asks > 0.0, (self._most / asks) ** np.repeat([1.0, 1.0 / 2.0, 1.0 / 3.0], 6), np.inf)
        by = speeds.argmin(axis=1)
        self._table.append(np.column_stack((f[:, DISTANCE], speeds.min(axis=1) * f[:, RATIO], by)))

    def at(self, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Allowed speed and limit (6 × kind + axis) of the pieces at these places along the programmed path."""
        if not self._table:
            return np.full(len(way), np.nan), np.zeros(len(way), int)
        table = np.concatenate(self._table)
        piece = (np.searchsorted(table[:, 0], way, side="right") - 1).clip(0)
        return table[piece, 1], table[piece, 2].astype(int)


def limiting(blocks: Sequence[Any], limits: Limits, T: float) -> Limiting:
    """Plan the motion, and tell for each sample what holds it back. All samples are kept: some 200 bytes each."""
    pieces = _Pieces(limits, T)
    samples = list(plan(blocks, limits, T, start=np.zeros(6), least_time=pieces))
    path = np.concatenate([block.segments for block in blocks]) if blocks else np.empty(0, SEGMENT)
    if not len(path):
        raise InputError("nothing in it moves, so nothing holds it back")
    position = np.concatenate([block.position for block in samples])
    segment = np.concatenate([block.segment for block in samples]).clip(0, len(path) - 1)
    padded = np.concatenate((np.repeat(position[:1], 3, axis=0), position))
    velocity = np.diff(padded, axis=0)[2:] / T
    shares, names = [], []
    for order, kind in enumerate(KINDS, 1):
        values = np.abs(np.diff(padded, order, axis=0)[3 - order :]) / T**order
        limit = getattr(limits, kind)
        for i in np.flatnonzero(limits.present):
            shares.append(values[:, i] / limit[i])
            names.append(f"{kind} of {AXES[i]}")
    table = np.column_stack(shares)
    linear, rotary = (np.linalg.norm(velocity[:, some], axis=1) for some in (slice(3), slice(3, 6)))
    turns = np.linalg.norm(path["end"][:, :3] - path["start"][:, :3], axis=1) <= NO_WAY
    planned = np.where((turns & (path["plane"] == LINE))[segment], rotary, linear)
    rate = np.where(path["rapid"], np.nan, path["rate"])[segment]
    way = np.concatenate([block.distance for block in samples])
    allowed, by = pieces.at(way)
    causes = (FEED, PATH, REST, *names)
    axes = np.cumsum(limits.present) - 1
    bend = 3 + by // 6 * int(limits.present.sum()) + axes[by % 6]
    cause = np.where(table.max(axis=1) >= NEAR, 3 + table.argmax(axis=1), np.where(planned >= EVEN * allowed, bend, 1))
    cause = np.where(planned >= 0.98 * np.nan_to_num(rate, nan=np.inf), 0, cause)
    cause = np.where((velocity == 0.0).all(axis=1), 2, cause)
    return Limiting(
        time=np.arange(len(position)) * T,
        way=way,
        programmed=rate,
        planned=planned,
        allowed=allowed,
        line=np.concatenate([block.line for block in samples]),
        cause=cause,
        causes=causes,
        T=T,
        least_time=pieces.seconds,
    )


def to_save(
    blocks: Sequence[Any], limits: Limits, T: float, kind: str, axis: str, planned: Callable[[], None] = lambda: None
) -> float | None:
    """How many times a limit of an axis would have to be what it is to save a second; None where it never does.

    `planned` is called after each plan.
    """
    i = AXES.index(axis)

    def lasts(times: float) -> float:
        raised = getattr(limits, kind).copy()
        raised[i] *= times
        samples = sum(map(len, plan(blocks, replace(limits, **{kind: raised}), T, start=np.zeros(6))))
        planned()
        return T * samples

    goal = lasts(1.0) - SAVED
    if lasts(MOST_TIMES) > goal:
        return None
    low, high = 1.0, MOST_TIMES
    for _ in range(_ROUNDS):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if lasts(middle) <= goal else (middle, high)
    return high


class LimitingCauses(NamedTuple):
    """What holds a motion back, and a row for each cause: `cause`, `seconds`, `lines`, and of some limits what is
    `limit`, `unit` and `to_save_a_second` (None where no more of it ever does).
    """

    limiting: Limiting
    rows: list[dict[str, Any]]

    def sentences(self) -> list[str]:
        """A line for each cause, and one behind it that says what would save a second."""
        said = []
        for row in self.rows:
            lines = ", ".join(map(str, row["lines"]))
            said.append(f"{row['cause']}: {row['seconds']:.3f} s, most in line{'s' * (len(row['lines']) > 1)} {lines}")
            if "limit" in row:
                said.append(f"   it is {row['limit']:g} {row['unit']}: {_saving(row)}")
        return said

    def savings(self) -> list[str]:
        """What would save a second, as far as it has been looked for."""
        rows = [row for row in self.rows if "limit" in row]
        return [f"{row['cause']} is {row['limit']:g} {row['unit']}: {_saving(row)}" for row in rows]


def _saving(row: dict[str, Any]) -> str:
    more = row["to_save_a_second"]
    return "a larger one saves no whole second" if more is None else f"a second less takes {more:.4g} {row['unit']}"


def explained(
    blocks: Sequence[Any],
    limits: Limits,
    T: float,
    looked_for: int = ASKED,
    progress: Progress = lambda done, of: None,
) -> LimitingCauses:
    """What holds the motion of blocks of segments back, as `plan` takes them.

    Of the limits that do so for longest, `looked_for` at most, what each would have to be to save a second, up to the
    first that can; each takes some ten plans. `progress` gets how many plans are made, and how many there are at most.
    """
    most = 1 + 2 * max(looked_for - 1, 0) + _PLANS * min(looked_for, 1)
    done = count(1)

    def planned() -> None:
        progress(next(done), most)

    found = limiting(blocks, limits, T)
    planned()
    rows: list[dict[str, Any]] = []
    left = looked_for
    for cause, seconds in found.seconds.items():
        row: dict[str, Any] = {"cause": cause, "seconds": seconds, "lines": found.lines_of(cause)}
        kind, _, axis = cause.partition(" of ")
        if kind in KINDS and left:
            now = float(getattr(limits, kind)[AXES.index(axis)])
            times = to_save(blocks, limits, T, kind, axis, planned)
            left = left - 1 if times is None else 0
            row |= {
                "limit": now,
                "to_save_a_second": None if times is None else times * now,
                "unit": ("mm" if axis in AXES[:3] else "degrees") + PER[KINDS.index(kind)],
            }
        rows.append(row)
    return LimitingCauses(found, rows)
