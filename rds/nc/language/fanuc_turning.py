"""G71 and G72 as Fanuc's lathes write them: on two lines, and with the blocks from P to Q behind them as the contour.

    G71 U2. R1.                    cuts 2 mm deep, 1 mm back out (of G72 W in place of U)
    G71 P100 Q200 U0.4 W0.1 F0.3   the contour; what is left on it along X (under G7: of the diameter) and Z; the feed
    N100 G0 X20.
    ...
    N200 X40.
    G70 P100 Q200                  finishes it

The cuts are those of turning_cycles.py, along the contour moved by what is left on it; at the end of a cycle the tool
goes back to where it began. The program goes on behind the block of Q; behind G70 it goes on with the next.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rds.nc.language.blocks import MOTION, Block
from rds.nc.language.canon import TRAVERSE
from rds.nc.language.expressions import Fault
from rds.nc.language.source import Place, Source
from rds.nc.language.turning_contour import Piece, Point

if TYPE_CHECKING:
    from rds.nc.language.context import Context
    from rds.nc.language.state import State

LINE = re.compile(r"(?:n[0-9]+)?g7([012])((?:[a-z][-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))+)$")
_WORD = re.compile(r"([a-z])([-+0-9.]+)")
_NUMBER = re.compile(rb"[ \t/]*[nN][ \t]*([0-9]+)")


@dataclass
class _Contour:
    """The blocks from `first` to `last`; `left` on them (z, x); `place` of the first, once it is known."""

    first: int
    last: int
    left: Point
    along_x: bool = False  # roughed by G72
    place: Place | None = None


class FanucTurning:
    """What these lines of one program have said so far."""

    def __init__(self) -> None:
        self._cut: tuple[float, float] | None = None  # depth of each cut, and the way back out
        self._roughed: dict[tuple[float, float], _Contour] = {}
        self._now: _Contour | None = None
        self._code = 0  # of the cycle that is executed now

    @property
    def reads(self) -> bool:
        """Whether the cycle that is executed now is one of these lines."""
        return self._now is not None

    def block(self, text: str, state: State) -> Block | None:
        """The block that a line is, in the words of turning_cycles.py; None for another line. Raises Fault."""
        self._now = None
        match = LINE.match(text)
        if match is None:
            return None
        code, pairs = 700 + 10 * int(match[1]), _WORD.findall(match[2])
        words = {letter: float(value) for letter, value in pairs}
        deep = "w" if code == 720 else "u"
        block = Block()
        if code != 700 and words.keys() == {deep, "r"}:
            if words[deep] <= 0.0 or words["r"] < 0.0:
                raise Fault(
                    f"{deep.upper()}, the depth of each cut, must be above 0, and R, the way back, from 0", deep
                )
            self._cut = words[deep], words["r"]
            return block
        named = words.get("p", -1.0), words.get("q", -1.0)
        if len(words) != len(pairs) or not words.keys() <= set("pqf" if code == 700 else "pquwf") or -1.0 in named:
            return None
        if code == 700:
            self._now = self._roughed.get(named)
        elif self._cut is not None:
            across = words.get("u", 0.0) / (2.0 if state.diameter else 1.0)
            self._now = self._roughed[named] = _Contour(
                int(named[0]), int(named[1]), (words.get("w", 0.0), across), code == 720
            )
            block.words["i"], block.words["r"] = self._cut
        if self._now is None:
            return None
        self._code = code
        block.g[MOTION] = code
        block.words["q"] = named[0]
        if "f" in words:
            block.words["f"] = words["f"]
        return block

    def run(self, source: Source, execute: Callable[[bytes], int]) -> None:
        """Execute the contour's blocks, each by its text; `execute` returns the number of its word N. Raises Fault."""
        contour, behind, line = self._now, source.following(), source.line
        assert contour is not None
        if contour.place is not None:
            source.go_to(contour.place)
        while raw := source.read():
            match = _NUMBER.match(raw)
            if contour.place is None and (match is None or int(match[1]) != contour.first):
                continue
            contour.place = contour.place or source.place
            if execute(raw) == contour.last:
                break
        else:
            missing = contour.last if contour.place else contour.first
            source.go_to(behind)
            source.line = line
            raise Fault(f"no block N{missing} stands behind this line; P and Q name the contour's first and last", "q")
        if self._code == 700:
            source.go_to(behind)
        source.line = line  # which the cuts are of

    def moved(self, pieces: list[Piece], start: Point) -> list[Piece]:
        """The contour that is cut along: for G71 and G72 moved by what they leave on it.

        A line at its end that would lead beyond the height of the cycle's start (z, x) by this ends there.
        """
        assert self._now is not None
        if self._code == 700 or not pieces:
            return pieces
        dz, dx = self._now.left

        def by(point: Point) -> Point:
            return point[0] + dz, point[1] + dx

        found = [
            replace(piece, start=by(piece.start), end=by(piece.end), centre=piece.centre and by(piece.centre))
            for piece in pieces
        ]
        height = 0 if self._now.along_x else 1
        (a, b), top = (found[-1].start, found[-1].end), start[height]
        if found[-1].centre is None and (top - a[height]) * (b[height] - top) > 0.0:
            share = (top - a[height]) / (b[height] - a[height])
            found[-1] = replace(found[-1], end=(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
        return found

    def back(self, m: Context, start: list[float]) -> None:
        """Out of the cut and to where the cycle began, by rapids."""
        if self._now is None:
            return
        for axis in (2, 0) if self._now.along_x else (0, 2):
            place = m.state.position()
            place[axis] = start[axis]
            if place != m.state.position():
                m.out.straight(TRAVERSE, tuple(place))  # type: ignore[arg-type]
                m.state.move_to(place)
