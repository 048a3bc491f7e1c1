"""G76: a thread cut in passes on a lathe, move for move as LinuxCNC makes it."""

from __future__ import annotations

import math

from rds.nc.language.blocks import Block
from rds.nc.language.canon import FEED, TRAVERSE
from rds.nc.language.context import Context
from rds.nc.language.expressions import Fault

_MOST = 10_000  # passes of a thread


def threading(m: Context, block: Block, end: list[float]) -> None:
    """G76 P (pitch) Z I (from the drive line to the thread's crest) J (first cut) K (whole depth) and, where given,
    R (how the cuts become smaller), Q (angle of infeed, degrees), H (spring passes), E and L (tapered ends). Raises
    Fault.
    """
    state, words = m.state, block.words
    if state.comp_side:
        raise Fault("G76 does not go with cutter compensation; write G40 before", "g760")
    if not state.spindle:
        raise Fault("the spindle stands still; G76 follows it: write S and M3 or M4 before", "g760")
    for letter, name in (("p", "P"), ("i", "I"), ("j", "J"), ("k", "K")):
        if letter not in words:
            raise Fault(f"G76 without {name}; each G76 names P, I, J and K", "g760")
    if state.position()[3:] != end[3:]:
        raise Fault("rotary axes do not move in G76; turn them on a line before", "g760")
    if words["i"] == 0.0:
        raise Fault("I0 is no way to the thread; negative for one outside, positive for one inside", "i")
    if words["j"] <= 0.0:
        raise Fault("the first cut J must be above 0", "j")
    if words["k"] <= words["j"]:
        raise Fault("the whole depth K must be more than the first cut J", "k")
    state.arc_allowed, state.motion = 1, 760
    _Thread(m, words, end).cut()
    m.out.straight(TRAVERSE, tuple(end))  # type: ignore[arg-type]
    state.move_to(end)


class _Thread:
    """One thread: all its passes begin at the tool's place (the drive line)."""

    def __init__(self, m: Context, words: dict[str, float], end: list[float]):
        state = m.state
        half = 2.0 if state.diameter else 1.0
        self._m, self._rotary = m, tuple(end[3:])
        self._crest, self._first, self._depth = (abs(words[letter] / half) for letter in "ijk")
        self._inward = 1.0 if words["i"] > 0.0 else -1.0  # an inside thread is cut outward in X
        self._x, self._y, self._z = state.x, state.y, state.z
        self._end = self._crest + self._depth
        forward = end[2] <= self._z
        angle = words.get("q", 0.0)
        angle = 0.0 if angle == -1.0 else angle
        self._slope = math.tan((angle if forward else -angle) * (math.pi / 180.0))
        self._springs = int(words.get("h", 0.0))
        self._degression = max(1.0, words.get("r", 1.0))
        taper = max(0.0, words.get("e", 0.0))
        self._pitch = words["p"]
        self._taper_pitch = self._pitch * math.hypot(taper, self._depth) / taper if taper > 0.0 else self._pitch
        self._taper = taper if forward else -taper
        ends = int(words.get("l", 0.0))
        self._enters, self._leaves = bool(taper and ends & 1), bool(taper and ends & 2)
        self._target = end[2] + self._depth * self._slope
        if self._degression * math.log(self._depth / self._first) > math.log(_MOST):
            raise Fault(f"more than {_MOST:,} cuts; write a larger first cut J, or a smaller R", "j")
        if self._springs > _MOST:
            raise Fault(f"more than {_MOST:,} spring passes; write a smaller H", "h")

    def cut(self) -> None:
        depth, number = self._crest + self._first, 1
        while depth < self._end:
            self._pass(depth)
            number += 1
            depth = self._crest + self._first * math.pow(number, 1.0 / self._degression)
        for _ in range(self._springs + 1):
            self._pass(self._end)

    def _pass(self, depth: float) -> None:
        out = self._m.out
        aside = (depth - self._crest) * self._slope
        start, target = self._z - aside, self._target - aside
        self._go(TRAVERSE, depth - self._end, start)
        if self._enters:
            out.call("DISABLE_FEED_OVERRIDE")
            out.call("START_SPEED_FEED_SYNC", self._taper_pitch, 0)
            self._go(FEED, depth - self._depth, start)
            self._go(FEED, depth, start - self._taper)
            out.call("START_SPEED_FEED_SYNC", self._pitch, 0)
        else:
            self._go(TRAVERSE, depth, start)
            out.call("DISABLE_FEED_OVERRIDE")
            out.call("START_SPEED_FEED_SYNC", self._pitch, 0)
        if self._leaves:
            self._go(FEED, depth, target + self._taper)
            out.call("START_SPEED_FEED_SYNC", self._taper_pitch, 0)
            self._go(FEED, depth - self._depth, target)
        else:
            self._go(FEED, depth, target)
        out.call("STOP_SPEED_FEED_SYNCH")
        self._go(TRAVERSE, depth - self._end, target)
        out.call("ENABLE_FEED_OVERRIDE")

    def _go(self, kind: int, depth: float, z: float) -> None:
        self._m.out.straight(kind, (self._x + self._inward * depth, self._y, z, *self._rotary))  # type: ignore[arg-type]
