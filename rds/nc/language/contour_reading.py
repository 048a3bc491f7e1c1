"""What the subroutine of G70 to G72 would move along: run as any other, with its moves gathered instead of made.

As in LinuxCNC only its moves count, G0 to G3, and the words A (fillet) and C (chamfer) at their ends: feeds, speeds and
all other words are passed over, but for those that would change what the moves mean. Parameters, branches and loops
work as anywhere.
"""

from __future__ import annotations

from collections.abc import Callable

from rds.nc.language.blocks import MOTION, Block
from rds.nc.language.canon import ARC, FEED, TRAVERSE, MotionBlock
from rds.nc.language.expressions import Fault
from rds.nc.language.state import XZ, State
from rds.nc.language.stream import Stream
from rds.nc.language.turning_contour import Corner, Piece, Point, with_corners

_MOVES = frozenset((0, 10, 20, 30))
_WORDS = frozenset("xyzijkrp")
# codes that say what the words of a move mean, and whether that is so already
_MEANING: dict[int, Callable[[State], bool]] = {
    **{code: lambda state: False for code in (100, 170, 190, 520, 530, *range(540, 594), 920, 921, 922, 923)},
    70: lambda state: bool(state.diameter),
    80: lambda state: not state.diameter,
    180: lambda state: state.plane == XZ,
    200: lambda state: bool(state.inches),
    210: lambda state: not state.inches,
    900: lambda state: bool(state.absolute),
    910: lambda state: not state.absolute,
    901: lambda state: bool(state.arc_absolute),
    911: lambda state: not state.arc_absolute,
}


class ContourReading:
    """One contour being gathered: `block` makes of each block of the subroutine the one that is executed."""

    def __init__(self, state: State):
        self.out = Stream()
        self._state = state
        self._kept = state.values()
        self._corners: dict[int, Corner] = {}
        self._moves = 0
        self.passed_over: list[str] = []
        state.feed_mode, state.feed_rate = 0, 1.0

    def restore(self) -> None:
        """The state before the contour, but for where it was read to be."""
        for name, value in zip(self._state.__slots__, self._kept, strict=True):
            setattr(self._state, name, value)

    def block(self, block: Block) -> Block:
        """The block with its move alone. Raises Fault for another motion than G0 to G3, and for a change of modes."""
        kept = Block()
        motion = block.g.get(MOTION, -1)
        if motion != -1:
            if motion not in _MOVES:
                raise Fault(f"G{motion / 10:g} is no part of a contour; write G0, G1, G2 and G3", f"g{motion}")
            kept.g[MOTION] = motion
        for code in block.g.values():
            if code in _MEANING and not _MEANING[code](self._state):
                name = f"G{code / 10:g}"
                raise Fault(f"{name} in a contour changes what its moves mean; write it before the cycle", f"g{code}")
        kept.words = {letter: value for letter, value in block.words.items() if letter in _WORDS}
        for letter in "ac":
            if letter in block.words:
                if len({"a", "c"} & block.words.keys()) == 2:
                    raise Fault("A is a fillet and C a chamfer at the end of a contour's move; write one of them", "c")
                self._corners[self._moves] = Corner(block.words[letter], letter == "a")
        self.passed_over += [f"G{code / 10:g}" for group, code in block.g.items() if group != MOTION]
        self.passed_over += [f"M{code}" for code in block.m.values()]
        self.passed_over += [letter.upper() for letter in block.words if letter not in _WORDS and letter not in "ac"]
        if not kept.words.keys().isdisjoint("xz"):
            self._moves += 1
        return kept

    def pieces(self, start: Point) -> list[Piece]:
        """The contour, from the end of its first move on; `start` (z, x) is where the cycle starts. Raises Fault."""
        self.out.flush()
        found: list[Piece] = []
        at = start
        for item in self.out.items:
            if not isinstance(item, MotionBlock):
                continue
            columns = (item.rows[name].tolist() for name in ("kind", "line", "values"))
            for kind, line, values in zip(*columns, strict=True):
                if kind == ARC:
                    end = values[0], values[1]
                    found.append(Piece(at, end, (values[2], values[3]), int(values[4]), line))
                elif kind in (TRAVERSE, FEED):
                    end = values[2], values[0]
                    found.append(Piece(at, end, line=line))
                else:
                    continue
                at = end
        if found and found[0].centre is not None:
            raise Fault(f"line {found[0].line} of the contour: its first move goes to its start; write it as G0 or G1")
        corners = {index - 1: corner for index, corner in self._corners.items()}
        if -1 in corners:
            raise Fault(f"line {found[0].line} of the contour: A and C do not go with the move to its start")
        moving = [k for k, piece in enumerate(found[1:]) if piece.centre is not None or piece.start != piece.end]
        renumbered = {moving.index(k): corner for k, corner in corners.items() if k in moving}
        return with_corners([found[1 + k] for k in moving], renumbered)


def gathered(run: Callable[[ContourReading], None], state: State) -> tuple[list[Piece], list[str]]:
    """The contour that `run` gathers, and the words that were passed over. Raises Fault, ProgramError."""
    start = state.z, state.x
    reading = ContourReading(state)
    try:
        run(reading)
    finally:
        reading.restore()
    return reading.pieces(start), sorted(set(reading.passed_over))
