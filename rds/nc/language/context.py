"""What the parts of the interpreter share: state, parameters, tools, and where results go."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from rds.nc.language.blocks import AXES
from rds.nc.language.dialect import Dialect
from rds.nc.language.expressions import Fault
from rds.nc.language.parameters import Parameters
from rds.nc.language.state import INVERSE_TIME, PER_MINUTE, PER_REVOLUTION, State
from rds.nc.language.stream import Stream
from rds.nc.language.tools import ToolTable

if TYPE_CHECKING:
    from rds.nc.compensation.compensation import Compensation
    from rds.nc.compensation.moves import Stretch
    from rds.nc.language.turning_contour import Piece

INCH = 25.4
INCHES_PER_MM = 0.03937007874016  # as LinuxCNC's stand-alone interpreter has it


class Context:
    """Everything that executing a block needs."""

    def __init__(
        self,
        dialect: Dialect,
        tools: ToolTable,
        parameters: Parameters,
        state: State,
        out: Stream,
        stretches: list[Stretch] | None = None,
    ):
        self.dialect = dialect
        self.tools = tools
        self.parameters = parameters
        self.state = state
        self.out = out
        self.stretches = stretches  # gets what compensation made of what was programmed
        self.leaving: Compensation | None = None  # the compensation that G40 ended, until the move after it
        self.remark: Callable[[str], None] = lambda said: None  # gets what is no fault, and worth a look
        self.control_points: list[tuple[float, float, float]] = []  # x, y, weight: of the NURBS since G5.2
        self.order = 3  # of that NURBS
        self.saved_modes: Callable[[Context, int], None]  # does M70 to M73, which belong to subroutines
        self.contour: Callable[[str], list[Piece]]  # of G70 to G72: what a subroutine would move along
        self.left_turned = 0.0  # degrees, the rotation of the coordinates at that G40

    def from_machine(self, length: float) -> float:
        """A length in the machine's units in the program's."""
        mm = length / INCHES_PER_MM if self.dialect.inch_machine else length
        return mm / INCH if self.state.inches else mm

    def to_machine(self, length: float) -> float:
        """A length in the program's units in the machine's."""
        mm = length * INCH if self.state.inches else length
        return mm * INCHES_PER_MM if self.dialect.inch_machine else mm

    def vector_from_machine(self, index: int) -> list[float]:
        """Parameters index to index + 5 (X Y Z A B C) in program units."""
        numbers = self.parameters.numbers
        return [self.from_machine(numbers[index + k]) for k in range(3)] + numbers[index + 3 : index + 6]

    def vector_to_machine(self, index: int, vector: list[float]) -> None:
        """Keep a vector X Y Z A B C in parameters index to index + 5."""
        self.parameters.numbers[index : index + 6] = [self.to_machine(length) for length in vector[:3]] + vector[3:6]


def rotate(vector: list[float], degrees: float) -> None:
    """Turn X and Y of a vector, in place."""
    angle = degrees * (math.pi / 180.0)
    x, y = vector[0], vector[1]
    cosine, sine = math.cos(angle), math.sin(angle)
    vector[0] = x * cosine - y * sine
    vector[1] = x * sine + y * cosine


def given(words: dict[str, float]) -> list[tuple[int, float]]:
    """Index (X Y Z A B C) and value of the axis words of a block."""
    return [(index, words[letter]) for index, letter in enumerate(AXES) if letter in words]


def check_feed(m: Context, words: dict[str, float], key: str) -> None:
    """Raises Fault when a move by feed has no feed rate, and the machine's default is not to be taken."""
    state = m.state
    if state.feed_mode == INVERSE_TIME:
        if "f" not in words:
            raise Fault("in inverse time (G93) every move by feed needs F on its line, 1/minutes; add it", key)
    elif state.feed_rate == 0.0:
        if m.dialect.default_feed and state.feed_mode == PER_MINUTE:
            return
        if state.feed_mode == PER_REVOLUTION:
            raise Fault("no feed rate is set; write F, in units per revolution", key)
        own = "or take the machine's own (`--with default-feed`)"
        raise Fault(f"no feed rate is set; write F, in units per minute, {own}", key)
    elif state.feed_mode == PER_REVOLUTION and state.speed == 0.0:
        raise Fault("a feed per revolution (G95) and the spindle's speed is 0; write S", key)
