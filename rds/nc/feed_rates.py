"""The feed of each move: by minute, by turn of the spindle, as a thread's pitch, or a machine's default."""

from __future__ import annotations

import numpy as np

from rds.nc.language.canon import RATE
from rds.nc.language.errors import ProgramError
from rds.nc.language.frame import only_rotary
from rds.nc.passed_over import Report
from rds.nc.path_block import BY_PITCH, DefaultFeed


class FeedRates:
    """The words F so far. `report` gets moves without a feed, `assume` the first that takes the default feed."""

    def __init__(self, report: Report, assume: Report, default: DefaultFeed | None):
        self._report, self._assume, self._default = report, assume, default
        self._assumed = False
        self.per_revolution = False
        self.pitch = 0.0  # of a thread being cut, program units per turn; 0: none
        self._rate = (0.0, 0.0)  # program units/min (per revolution) and mm/min
        self._line = 0

    @property
    def by_speed(self) -> bool:
        """Whether the feed hangs on the speed of the spindle."""
        return self.per_revolution or self.pitch != 0.0

    def forget_line(self) -> None:
        """What gave the feed is in another file."""
        self._line = 0

    def of(self, rows: np.ndarray, unit: float, speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each row: mm/s, degrees/s for moves of rotary axes alone, and the line of its word F (or BY_PITCH).

        unit: mm of a program unit. speed: of the spindle, turns per minute.
        """
        given = rows["kind"] == RATE
        last = np.maximum.accumulate(np.where(given, np.arange(1, len(rows) + 1), 0))  # 0: from before
        plain = np.concatenate(([self._rate[0]], rows["values"][:, 0]))[last]
        linear = np.concatenate(([self._rate[1]], rows["values"][:, 0] * unit))[last]
        lines = np.concatenate(([self._line], rows["line"])).astype(np.int32)[last]
        self._rate, self._line = (float(plain[-1]), float(linear[-1])), int(lines[-1])
        if self.pitch:
            plain, linear = np.full(len(rows), self.pitch), np.full(len(rows), self.pitch * unit)
            lines = np.full(len(rows), BY_PITCH, np.int32)
        scale = (speed if self.by_speed else 1.0) / 60.0
        return linear * scale, plain * scale, lines

    def complete(self, segments: np.ndarray, lines: np.ndarray, file: str, turning: int, speed: float) -> np.ndarray:
        """The default feed for `segments` without one, or a report; returns the lines of their words F.

        turning: whether the spindle does, speed: as last said, turns per minute.
        """
        still = ~segments["rapid"] & ~(segments["rate"] > 0.0)
        if self._default is not None and not self.per_revolution and still.any():
            self._take_default(self._default, segments, still, file)
            lines = np.where(still, np.int32(0), lines)  # no word F gave it
            still &= ~(segments["rate"] > 0.0)
        still &= segments["length"] > 0.0
        if still.any():
            line = int(segments["line"][np.argmax(still)])
            self._report(ProgramError(self._no_feed(turning, speed), file=file, line=line))
        return lines

    def _take_default(self, feed: DefaultFeed, segments: np.ndarray, still: np.ndarray, file: str) -> None:
        rotary = only_rotary(segments[still]) & ((segments["length"][still] > 0.0) | (feed.linear == 0.0))
        segments["rate"][still] = np.where(rotary, feed.rotary, feed.linear) / 60.0
        if not self._assumed:
            self._assumed = True
            value, unit = (feed.rotary, "degrees/min") if rotary[0] else (feed.linear, "mm/min")
            message = (
                f"no feed rate is set before this move: the default feed of {feed.machine}, {value:g} {unit}, is "
                "assumed (option default-feed)"
            )
            line = int(segments["line"][np.argmax(still)])
            self._assume(ProgramError(message, file=file, line=line))

    def _no_feed(self, turning: int, speed: float) -> str:
        if self.pitch:  # the spindle is on, else its word is refused
            return "a thread at S0 moves nothing; give a spindle speed before"
        if self.per_revolution and not turning:
            return "a feed per revolution (G95) while the spindle stands still moves nothing; start it (S, M3)"
        if self.per_revolution and not speed:
            return "a feed per revolution (G95) at S0 moves nothing; give a spindle speed before"
        return "the move has no feed rate; give one (F) in this line or before it"
