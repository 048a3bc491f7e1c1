"""A part program as the loop has it: planned samples of all axes, and what happens where the motion rests."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import TYPE_CHECKING, Any, NamedTuple

from rds.core.shared_quantities import FEED_SHARE
from rds.modes.loop.force_guard import COLUMN, ForceGuard
from rds.modes.loop.live_values import Channel

if TYPE_CHECKING:
    import numpy as np

OVERRIDE, HOLD, RESUME, HOME, OPTIONAL_STOP = "override", "hold", "resume", "home", "optional_stop"
SINGLE_STEP = "single_step"
STEP = 2.0  # value of a stop after a line, which single step asks for
COLUMNS = {"program_line": "", "program_sample": "", "program_override": "", "program_state": ""}
INTERPOLATED_COLUMNS = {"program_segment": "", "program_buffer": ""}


class ProgramEvent(NamedTuple):
    """What happens at a planned sample, by a line of the program.

    Kinds and values: "dwell" s; "spindle" rev/min, + clockwise (0: it stops); "stop" 0 (M0), 1 (M1, optional)
    or STEP (after a line, in single step); "tool" its number; "override" FREE_FEED, LOCKED_FEED or TIED_FEED; "end".
    """

    sample: int
    kind: str
    value: float
    line: int


@dataclass(frozen=True)
class Program:
    """Planned samples of the axes that a program moves, one sample period apart, and what happens among them.

    Row 0 is where the motion begins, at rest; dwells have their rows. `position` (m × n, mm or degrees), `velocity` and
    `acceleration` are in the order of `axes`; `line` (m) is the program line of each row. `spindle` is the axis
    that the words S, M3 and M4 drive. `home` (n) is where the axes go home to; `limits` (3 × n) are velocity,
    acceleration and jerk of the axes. `guard` lowers the feed where a force would be too large.
    """

    axes: tuple[str, ...]
    spindle: str | None
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    line: np.ndarray
    happenings: tuple[ProgramEvent, ...]
    home: tuple[float, ...]
    limits: np.ndarray
    name: str = ""
    guard: ForceGuard | None = None
    steps: bool = False  # whether it rests after each line, for single step
    origin: Any = None  # what an experiment's path was planned from (`rds.nc.run.prepare.Prepared`), for the result

    @property
    def samples(self) -> int:
        """Samples that the program takes at an override of 100 %, without what it waits for."""
        return len(self.position)

    @property
    def start(self) -> tuple[float, ...]:
        """Where the motion begins (n)."""
        return tuple(float(value) for value in self.position[0])


def program_columns(program: Program | InterpolatedProgram) -> dict[str, str]:
    """The columns of a record that say where in the program it is, with their units."""
    if isinstance(program, InterpolatedProgram):
        return COLUMNS | INTERPOLATED_COLUMNS
    return COLUMNS | (COLUMN if program.guard is not None else {})


Row = tuple[Sequence[float], Sequence[float], Sequence[float], int]
"""Position, velocity and acceleration of the axes (mm, mm/s, mm/s²), and the number of the segment."""


@dataclass(frozen=True)
class Stretch:
    """Motion from rest to rest: what makes its rows, one sample period apart, and what happens where they end."""

    rows: Callable[[], Iterator[Row]]
    happenings: tuple[ProgramEvent, ...] = ()  # their `sample` is not known before the rows are made


@dataclass(frozen=True)
class InterpolatedProgram:
    """A path whose samples an interpolator makes while they are carried out, one by one.

    `axes`, `spindle`, `home`, `limits` and `name` as of a `Program`. The motion begins at `start` (n), where `first` is
    due, and goes through the `stretches`. `line` has the program line of each segment; `feed` is the largest rate along
    the path, mm/s. `ahead` rows are made before they are needed. `samples` is how many it takes at the programmed
    feed, as far as that is known before the rows are made. `travel` (n × 2) is where the axes may go. `path` is the
    programmed path, rows of `SEGMENT`, for measuring; `about` says what made the rows, for the result. `blu` is the
    unit (mm) in which their positions are whole, 0 where they are not.
    """

    axes: tuple[str, ...]
    spindle: str | None
    start: tuple[float, ...]
    first: tuple[ProgramEvent, ...]
    stretches: tuple[Stretch, ...]
    line: tuple[int, ...]
    feed: float
    ahead: int
    samples: int
    home: tuple[float, ...]
    limits: np.ndarray
    travel: np.ndarray
    path: np.ndarray
    about: dict[str, Any]
    notes: tuple[str, ...] = ()
    name: str = ""
    blu: float = 0.0
    overrides: tuple[tuple[int, float], ...] = ()  # after which segment, and whose the feed is then: FREE_FEED, ...


def dwell_samples(seconds: float, T: float) -> int:
    """A dwell lasts for at least so long."""
    return ceil(seconds / T - 1e-9)


def program_channels(steps: bool = False) -> list[Channel]:
    """What may be changed while a program runs, besides the parameters of controllers.

    With `steps` it rests after each line.
    """
    switch = partial(Channel, low=0.0, high=1.0, whole=True)
    feed = "feed as a multiple of the programmed one; rapids only get slower"
    return [
        Channel(OVERRIDE, 1.0, feed, low=0.0, high=FEED_SHARE.high),
        switch(HOLD, 0.0, "1 brings the motion to rest on its path until it is 0 again"),
        Channel(RESUME, 0.0, "another number than before goes on after M0, M1 and a tool change", low=0.0, high=1e9),
        switch(HOME, 0.0, "1 ends the program where it is and moves the axes home"),
        switch(OPTIONAL_STOP, 1.0, "1: M1 waits, 0: it does not"),
        *([switch(SINGLE_STEP, 1.0, "1: waits after each line, 0: it does not")] if steps else []),
    ]
