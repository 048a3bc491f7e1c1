"""G71 and G72 as Fanuc's lathes write them: on two lines, and with the blocks from P to Q behind them as the contour.

    G71 U2. R1.                    cuts 2 mm deep, 1 mm back out (of G72 W in place of U)
    G71 P100 Q200 U0.4 W0.1 F0.3   the contour; what is left on it along X (under G7: of the diameter) and Z; the feed
    N100 G0 X20.
    ...
    N200 X40.
    G70 P100 Q200                  finishes it

Nothing but blank lines and comments stands before the block of P. The cuts are those of turning_cycles.py, along the
contour moved by what is left on it; at the end of a cycle the tool goes back to where it began. The program goes on
behind the block of Q; behind G70 it goes on with the next.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rds.nc.language.blocks import MOTION, Block
from rds.nc.language.canon import TRAVERSE
from rds.nc.language.expressions import Fault
from rds.nc.language.source import Source, SourcePosition
from rds.nc.language.turning_contour import Piece, Point
from rds.nc.language.words import line_number, tidy

if TYPE_CHECKING:
    from rds.nc.language.context import Context
    from rds.nc.language.control import Control
    from rds.nc.language.state import State

_LINE = re.compile(r"(?:n[0-9]+)?g7([012])((?:[a-z][-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))+)$")
_COMMENT = re.compile(r"\([^)]*\)|;.*")
_WORD = re.compile(r"([a-z])([-+0-9.]+)")


def is_line(text: str) -> bool:
    """Whether a line may be one of these: G70 to G72 with plain numbers, and no word before it but N."""
    return _LINE.match(_COMMENT.sub("", text)) is not None


@dataclass
class _Contour:
    """The blocks from `first` to `last`; `left` on them (z, x); where the first stands, once that is known."""

    first: int
    last: int
    left: Point
    along_x: bool = False  # roughed by G72
    place: SourcePosition | None = None
    file: str = ""

    @property
    def name(self) -> str:
        """How messages call it."""
        return f"N{self.first} to N{self.last}"


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

    @property
    def contour(self) -> str:
        """What messages call the contour of the cycle that is executed now."""
        return "" if self._now is None else self._now.name

    def block(self, text: str, state: State) -> Block | None:
        """The block that a line is, in the words of turning_cycles.py; None for another line. Raises Fault."""
        self._now = None
        match = _LINE.match(_COMMENT.sub("", text))
        if match is None:
            return None
        code, pairs = 700 + 10 * int(match[1]), _WORD.findall(match[2])
        words = {letter: float(value) for letter, value in pairs}
        deep = "w" if code == 720 else "u"
        block = Block()
        if code != 700 and words.keys() == {deep, "r"}:
            _check_once(pairs)
            if words[deep] <= 0.0 or words["r"] < 0.0:
                raise Fault(
                    f"{deep.upper()}, the depth of each cut, must be above 0, and R, the way back, from 0", deep
                )
            self._cut = words[deep], words["r"]
            return block
        if self._cut is None or not {"p", "q"} <= words.keys() <= set("pqf" if code == 700 else "pquwf"):
            return None
        _check_once(pairs)
        first, last = words["p"], words["q"]
        for letter, number in (("p", first), ("q", last)):
            if number < 0.0 or number != int(number):
                raise Fault(f"{letter.upper()}{number:g} is no block's number; write that of a word N", letter)
        if first == last:
            raise Fault(f"P and Q name the same block, N{first:g}; write the contour's first and its last", "q")
        if code == 700:
            self._now = self._roughed.get((first, last))
            if self._now is None:
                raise Fault(f"no G71 or G72 P{first:g} Q{last:g} stands before; G70 finishes what one has roughed", "p")
        else:
            across = words.get("u", 0.0) / (2.0 if state.diameter else 1.0)
            self._now = self._roughed[first, last] = _Contour(
                int(first), int(last), (words.get("w", 0.0), across), code == 720
            )
            block.words["i"], block.words["r"] = self._cut
        self._code = code
        block.g[MOTION] = code
        block.words["q"] = first
        if "f" in words:
            block.words["f"] = words["f"]
        return block

    def run(self, control: Control, execute: Callable[[bytes], bool]) -> None:
        """Execute the contour's blocks, each by its text; `execute` says whether it ends the program. Raises Fault."""
        contour, source, depth = self._now, control.source, control.depth
        assert contour is not None
        behind, line = source.following(), source.line
        try:
            if contour.place is None:
                contour.place, contour.file = _first(source, contour.first), source.name
            elif contour.file != source.name:
                raise Fault(f"the contour {contour.name} stands in {contour.file}; write G70 there, behind it", "p")
            source.go_to(contour.place)
            while raw := control.source.read():
                is_own = control.depth == depth and not control.skipping
                number = line_number(tidy(raw))[1] if is_own else 0
                if execute(raw) or control.depth < depth:
                    break
                if number == contour.last:
                    if self._code == 700:
                        source.go_to(behind)
                    return
            raise Fault(f"the contour ends before a block N{contour.last}; Q names the last of its blocks", "q")
        except BaseException:
            if control.source is source:
                source.go_to(behind)
            raise
        finally:
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

        height = 0 if self._now.along_x else 1
        if _side(pieces, start, height) != _side(
            [replace(piece, start=by(piece.start), end=by(piece.end)) for piece in pieces], start, height
        ):
            letter = "w" if self._now.along_x else "u"
            raise Fault(f"{letter.upper()} leaves more on the contour than there is of material; write less", letter)
        found = [
            replace(piece, start=by(piece.start), end=by(piece.end), centre=piece.centre and by(piece.centre))
            for piece in pieces
        ]
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


def _check_once(pairs: list[tuple[str, str]]) -> None:
    letters = [letter for letter, _ in pairs]
    for letter in letters:
        if letters.count(letter) > 1:
            raise Fault(f"the word {letter.upper()} stands twice on the line; write it once", letter)


def _first(source: Source, number: int) -> SourcePosition:
    """Where the block N of this number begins: the next but for blank lines and comments. Raises Fault."""
    while raw := source.read():
        text = _COMMENT.sub("", tidy(raw))
        if text and line_number(text)[1] == number:
            return source.place
        if text:
            break
    raise Fault(f"the block N{number} does not follow this line; the contour from P to Q stands right behind it", "p")


def _side(pieces: list[Piece], start: Point, height: int) -> bool:
    """Whether the contour lies above the start, by its point that is farthest from it."""
    places = [piece.end[height] for piece in pieces] + [pieces[0].start[height]]
    return max(places, key=lambda place: abs(place - start[height])) > start[height]
