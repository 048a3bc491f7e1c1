"""From the text of a part program to its canonical calls: block after block, in LinuxCNC's order of execution.

Our own, because LinuxCNC's `rs274` comes with LinuxCNC alone, and `gcodeparser` and `pygcode` read words but
execute no loops, cycles and compensation.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import IO, TYPE_CHECKING, Any, cast

from rds.nc.language.batch import Batch
from rds.nc.language.blocks import AXIS_SET, CHECKED, STOP, Block, check, settle_motion
from rds.nc.language.canon import Call, MotionBlock
from rds.nc.language.compiled_loops import GOES_ON, Loops
from rds.nc.language.context import Context
from rds.nc.language.control import Control
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.fast_lane import FastLane
from rds.nc.language.located import as_it_is_meant, located, place_in
from rds.nc.language.modes import execute
from rds.nc.language.moves import move
from rds.nc.language.names import known_names
from rds.nc.language.offsets import start
from rds.nc.language.owords import Word, spelled
from rds.nc.language.parameters import Parameters, read_parameters
from rds.nc.language.program_bounds import Bounds
from rds.nc.language.repeated_lines import Line, RepeatedLines
from rds.nc.language.saved_modes import SavedModes, lines_to_restore, modes_now
from rds.nc.language.source import LONGEST, Source, open_source
from rds.nc.language.state import State
from rds.nc.language.stream import Stream
from rds.nc.language.tools import Tool, ToolTable, read_tools
from rds.nc.language.words import fill, line_number, read_plain, read_words, tidy

if TYPE_CHECKING:
    from pathlib import Path

    from rds.machines.ncc import Script
    from rds.nc.compensation.moves import Stretch
    from rds.nc.language.contour_reading import ContourReading
    from rds.nc.language.fanuc_turning import FanucTurning
    from rds.nc.language.turning_contour import Piece

_USUAL = frozenset((0, 10, 20, 30))  # motions that no line goes on with wrongly but by words that are checked
_PROGRAM_NUMBER = re.compile(r"[po][0-9]+")
_MOTION_WORD = re.compile(r"(?:n[0-9]+)?(?!o).*?(g40(?![0-9])|[xyz]|m[0-9])")  # of a block that compensation refuses


def interpret(
    source: str | Path | IO[Any],
    *,
    tools: Path | Iterable[Tool] | None = None,
    parameters: Path | Mapping[int, float] | None = None,
    options: Dialect = Dialect(),  # noqa: B008 (frozen)
    name: str = "",
    stretches: list[Stretch] | None = None,
    remark: Callable[[ProgramError], None] | None = None,
) -> Iterator[MotionBlock | Call]:
    """The canonical calls of a program, as it is read.

    `source`: a Path is a file, a str is the program itself, a file object is read as it goes. Subroutine files are
    looked for beside a file. `tools` and `parameters`: LinuxCNC's files, or what they hold, in the machine's units.
    `name` stands for the program in messages. `stretches`, when given, gets what cutter compensation made of what;
    `remark` is called with what is no fault and worth a look: blocks after the program's end.
    Raises ProgramError at the first fault; what came before it has been handed out by then.
    """
    interpreter = Interpreter(
        source, tools=tools, parameters=parameters, options=options, name=name, stretches=stretches, remark=remark
    )
    try:
        yield from interpreter.run()
    finally:
        interpreter.close()


class Interpreter:
    """One run of one program. `context.state` is what the next block finds."""

    def __init__(
        self,
        source: str | Path | IO[Any] | Source,
        *,
        tools: Path | Iterable[Tool] | None = None,
        parameters: Path | Mapping[int, float] | None = None,
        options: Dialect = Dialect(),  # noqa: B008 (frozen)
        name: str = "",
        stretches: list[Stretch] | None = None,
        remark: Callable[[ProgramError], None] | None = None,
    ):
        table = ToolTable(read_tools(tools) if isinstance(tools, os.PathLike) else tools or ())
        kept = read_parameters(parameters) if isinstance(parameters, os.PathLike) else parameters
        self.options = options
        self.source = open_source(source, name, semicolons=options.program_numbers)
        self.out = Stream()
        state = State()
        self.context = Context(options, table, Parameters(state, kept), state, self.out, stretches)
        self.control = Control(self.source, self.context.parameters, options)
        self.context.parameters.known = known_names(self.context, self.control, lambda: self.control.source.line)
        self.context.saved_modes = self._saved_modes
        self.control.restore = self._restore
        self.context.contour = self._contour_of
        self.context.remark = self._remark_on
        self._fanuc: FanucTurning | None = None  # once a line of its form has been met
        self._contour: ContourReading | None = None  # while the moves of a contour's subroutine are gathered
        self.lane = FastLane(self.context, self.source)
        self._repeated = RepeatedLines(self.context.parameters)
        self._loops = Loops(self.context, self.control, self._repeated)
        self.by_line = False  # whether one line after the other is executed, and none together with others
        self._others = 0  # kept lines that the fast lane could not take, since it was tried
        self._remark = remark
        self._bounds = Bounds(self.context, self.control, remark)
        self._first = True  # no block has been executed
        self._text = ""
        self._places: dict[str, int] = {}

    def close(self) -> None:
        self.control.close()

    @property
    def configuration(self) -> Script | None:
        """What a script at the program's head says of the machine (option ncc)."""
        return self._bounds.configuration

    def run(self) -> Iterator[MotionBlock | Call]:
        """The canonical calls. Raises ProgramError."""
        return cast("Iterator[MotionBlock | Call]", self._run())

    def run_in_batches(self) -> Iterator[MotionBlock | Call | Batch]:
        """The same, with what compiled code has read in batches, which it can write. Raises ProgramError."""
        self.out.in_batches = True
        return self._run()

    def _run(self) -> Iterator[MotionBlock | Call | Batch]:
        out = self.out
        out.file = self.source.name
        start(self.context)
        out.call("SET_FEED_REFERENCE", "CANON_XYZ")
        out.call("ON_RESET")
        try:
            self._bounds.open()
            ended, wait = False, self.lane.wait
            while not ended:
                wait -= 1
                if wait < 0:
                    wait, self._others = self._others, 0
                    if not wait:
                        wait = self.lane.take(self.control)
                source = self.control.source
                raw = source.read_again() if self.control.repeats else source.read()
                if raw:
                    ended = self._line(raw)
                else:
                    self._bounds.file_ended()
                    ended = True
                if out.items:
                    yield from self._take()
        except ProgramError:
            out.flush()
            yield from self._take()  # what was right before the fault
            raise
        self._bounds.look_behind()
        out.line, out.digits = 0, 0
        out.call("ON_RESET")
        out.call("ON_RESET")
        yield from self._take()

    def _error(self, fault: Fault, raw: bytes) -> ProgramError:
        return located(fault, raw, self._text, self._places, self.control.source, self.context.state.motion)

    def _take(self) -> list[MotionBlock | Call | Batch]:
        items, self.out.items = self.out.items, []
        return items

    # -- lines --------------------------------------------------------------------------------------------------------

    def _line(self, raw: bytes) -> bool:
        """Read and execute a block. True when the program ends by it."""
        source, out = self.control.source, self.out
        self._text = ""
        self._places = {}
        try:
            if source.name != out.file:
                out.file = source.name
            kept = self._repeated.find(raw) if self.control.repeats else None
            if kept is not None and (ended := self._again(kept)) is not None:
                return ended
            if len(raw) > LONGEST + 1:
                raise Fault(f"the line is longer than {LONGEST} characters; break it")
            self._text = text = tidy(raw)
            out.line = source.line
            if self.options.program_numbers:
                text = text.rstrip(";")
            if not text or (text[0] == "/" and self.options.block_delete):
                return False
            ended = self._block(text)
            if self.control.repeats and not (self.control.skipping or self.options.program_numbers or self._fanuc):
                self._repeated.count(raw, text)
            return ended
        except Fault as fault:
            raise self._error(as_it_is_meant(fault, raw, self._text, self.options), raw) from None
        except ProgramError as error:
            if error.line:
                raise
            word = _MOTION_WORD.match(self._text)  # compensation knows moves, not words
            raise self._error(Fault(error.reason, at=word.start(1) if word else -1), raw) from None

    def _again(self, line: Line) -> bool | None:
        """Execute a kept line. True when the program ends by it; None where it is to be read."""
        out, control = self.out, self.control
        self._text, self._places = line.text, line.places
        out.line, out.digits, out.n = control.source.line, line.digits, line.n
        self._others += not line.plain
        if line.word is not None:
            word = control.again(line, self._repeated)
            if word is not None:
                control.execute(word)
                if word.kind in GOES_ON and not self.by_line and not control.skipping:
                    self._loops.go_on(word.name)
            return None if word is None else False
        if control.skipping:
            return False
        if line.simple and self._contour is None and self._repeated.move(line, self.context):
            return False
        block = self._repeated.block(line)
        return None if block is None else self._execute(block)

    def _block(self, text: str) -> bool:
        if self.options.program_numbers and not self.control.skipping and self._program_number(text):
            return False
        plain = None if self.control.skipping or "g7" in text else read_plain(text)  # "g7": it may be Fanuc's G71
        if plain is None:
            return self._other(text)
        digits, words = plain
        if words and words[0][0] == "m" and words[0][1].lstrip("0") in ("98", "99"):
            return self._other(text)
        out = self.out
        out.digits, out.n = len(digits), 0
        if digits:
            if out.digits > 9:
                line_number(text)
            out.n = int(digits)
        block = Block()
        fill(block, words, text)
        return self._execute(block)

    def _other(self, text: str) -> bool:
        """A block with more than plain words: %, comments, parameters, expressions, O words; or one passed over."""
        control, out = self.control, self.out
        if text == "%" and self._bounds.percent:
            return self._bounds.percent_sign()
        out.digits, out.n, at = line_number(text)
        first = text[at : at + 1]
        if first == "m" and (fanuc := self.control.fanuc(text, at)) is not None:
            self._first = False
            self.control.execute(fanuc)
            return False
        if first == "o" or (self.options.gr and text.startswith("gr", at)):
            self._first = False
            word = control.read(text, at) if first == "o" else control.read_gr(text, at)
            control.execute(word)
            return False
        if control.skipping:
            return False
        if "g7" in text and self._fanuc_turning(text):
            return False
        block = Block()
        self._places = read_words(text, at, block, self.context.parameters)
        return self._execute(block)

    def _execute(self, block: Block) -> bool:
        context = self.context
        if self._contour is not None:
            block = self._contour.block(block)
        words = block.words
        self._first = False
        state = context.state
        if state.diameter and "x" in words:
            words["x"] /= 2.0
        if not block.g and not block.m and not block.comment and state.motion in _USUAL:
            if AXIS_SET.isdisjoint(words):
                settle_motion(block, state)
            else:
                block.motion = state.motion
            if CHECKED.isdisjoint(words) and "s" not in words and "t" not in words:
                if "f" in words and state.feed_mode != 1:
                    state.feed_rate = words["f"]
                    self.out.rate(words["f"])
                context.parameters.settle()
                if block.motion != -1:
                    move(context, block)
                return False
        else:
            settle_motion(block, state)
        if block.g or block.motion not in _USUAL or not CHECKED.isdisjoint(words):
            check(block, state)
        context.parameters.settle()
        ended = execute(context, block)
        if ended:
            self._bounds.after_end(f"M{block.m[STOP]}")
        return ended

    def _remark_on(self, said: str) -> None:
        """Say what is no fault of the block that is executed now, and worth a look."""
        if self._remark is not None:
            self._remark(ProgramError(said, file=self.out.file, line=self.out.line))

    def _fanuc_turning(self, text: str) -> bool:
        """Execute a line of Fanuc's G70 to G72; False, and nothing done, where it is none. Raises Fault."""
        if self._fanuc is None:
            from rds.nc.language.fanuc_turning import FanucTurning, is_line  # only lathe programs need it

            if not is_line(text):
                return False
            self._fanuc = FanucTurning()
        if self._contour is not None and self._fanuc.reads:
            raise Fault(f"the contour {self._fanuc.contour} has no end before this cycle; Q names its last block", at=0)
        block, start = self._fanuc.block(text, self.context.state), self.context.state.position()
        if block is not None:
            self._execute(block)
            self._fanuc.back(self.context, start)
        return block is not None

    def _contour_of(self, name: str) -> list[Piece]:
        """The contour that the subroutine `name` holds, for G70 to G72. Raises Fault, ProgramError."""
        from rds.nc.language.contour_reading import gathered  # with numpy

        text, places, out, remark, state = self._text, self._places, self.out, self._remark, self.context.state
        line, fanuc = out.line, self._fanuc

        def run(reading: ContourReading) -> None:
            self.out = self.context.out = reading.out
            self._contour = reading
            if fanuc is not None and fanuc.reads:
                self.control.begin_anew()
                fanuc.run(self.control, self._line)
                return
            depth = self.control.depth
            self.control.execute(Word("call", name, spelled(name), max(place_in("q", self._text, self._places), 0)))
            while self.control.depth > depth:
                if raw := self.control.source.read():
                    self._line(raw)
                else:
                    self._bounds.file_ended()

        try:
            pieces, passed_over = gathered(run, state)
        finally:
            self._text, self._places, self._contour = text, places, None
            self.out = self.context.out = out
        if passed_over and remark is not None:
            called = fanuc.contour if fanuc is not None and fanuc.reads else f"in subroutine {name}"
            said = f"the contour {called}: {', '.join(passed_over)} passed over; only its moves count"
            remark(ProgramError(said, file=out.file, line=line))
        return fanuc.moved(pieces, (state.z, state.x)) if fanuc is not None and fanuc.reads else pieces

    def _saved_modes(self, m: Context, code: int) -> None:
        """M70, M73 (save the modes), M71 (forget them), M72 (restore them). Raises Fault."""
        if code == 72:
            if self.control.saved is None:
                raise Fault("no modes are saved here; write M70, or M73 in a subroutine, before", "m72")
            self._restore(self.control.saved)
        else:
            before = self.control.saved
            again = (code == 73 and self.control.depth > 0) or (before is not None and before.again)
            self.control.saved = None if code == 71 else modes_now(m.state, m.parameters, again)

    def _restore(self, saved: SavedModes) -> None:
        """Bring saved modes back, by the words that differ. Raises Fault."""
        state, parameters = self.context.state, self.context.parameters
        try:
            if saved.units != ("G20" if state.inches else "G21"):
                self._obey(saved.units.lower())
            for line in lines_to_restore(saved, modes_now(state, parameters), bool(state.inches)):
                self._obey(line)
        except Fault as fault:
            raise Fault(f"the saved modes cannot be restored ({fault.message})") from None

    def _obey(self, text: str) -> None:
        """Execute a block of plain words that no line of the program holds. Raises Fault."""
        block = Block()
        plain = read_plain(text)
        assert plain is not None  # words that the interpreter has written itself
        fill(block, plain[1], text)
        settle_motion(block, self.context.state)
        execute(self.context, block)

    def _program_number(self, text: str) -> bool:
        """The option's program number, P001 or O001, on the first block."""
        if not _PROGRAM_NUMBER.fullmatch(text):
            return False
        if not self._first:
            raise Fault("a program number stands on the first block; remove it here", at=0)
        self._first = False
        self.out.digits = self.out.n = 0
        self.out.comment(f"program {text.upper()}")
        return True
