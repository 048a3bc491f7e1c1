"""Loops and subroutines of kept lines as functions of Python, which do not go back to the program's text.

Taken are loops (WHILE, REPEAT) and subroutines of straight moves, feeds, settings, branches, calls and further loops,
that have been executed whole, or nearly. Wherever a line would do anything else now, or be wrong, the function stops
before it, and the interpreter reads on from there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rds.nc.language.canon import BLOCK_ROWS, FEED, RATE, TRAVERSE
from rds.nc.language.owords import GLOBAL, Word
from rds.nc.language.state import PER_MINUTE

if TYPE_CHECKING:
    from rds.nc.language.branches import Label
    from rds.nc.language.context import Context
    from rds.nc.language.control import Control
    from rds.nc.language.repeated_lines import Line, RepeatedLines
    from rds.nc.language.source import SourcePosition

_OFTEN = (6, 60, 600)  # rounds or calls after which it is tried, in vain perhaps, as not all has been executed
_MOST = 400  # lines of a loop or subroutine
_DEEPEST = 100  # calls inside one another that a program may have, for functions to call each other
_ENDS = {"while": "endwhile", "repeat": "endrepeat"}
_LOOP_ENDS = frozenset(_ENDS.values())
GOES_ON = _LOOP_ENDS | {"call"}  # words after which what follows may have been taken
_KINDS = frozenset((*_ENDS, *_LOOP_ENDS, "if", "else", "endif"))
_AXES = "xyzabc"
_HEAD = """\
def line(m, control, own, n, l, q):
 state, p, out, at = m.state, m.parameters, m.out, 0
 labels, places, words, calls = own.labels, own.places, own.words, own.calls
 x, y, z, a, b, c = state.position()
 kinds, digits, ns, lines, values = out.columns
 size, kind, digit, number, row = kinds.__len__, kinds.append, digits.append, ns.append, lines.append
 extend, unseen, begun, entered = values.extend, control.jumps_unseen, control.round_of, control.enters
 try:
"""
_TAIL = """
 except faults:
  return places[at]
"""


class _Refused(Exception):
    """There is a line that is not taken."""


class Loops:
    """The loops and subroutines of one run of a program that are functions, by their names."""

    def __init__(self, context: Context, control: Control, lines: RepeatedLines):
        self._context = context
        self._control = control
        self._lines = lines
        self._times: dict[str, int] = {}
        self._taken: dict[str, _Function] = {}

    def go_on(self, name: str) -> None:
        """The end of the loop `name`, or a call of the subroutine `name`, has been executed: do what follows in it."""
        times = self._times[name] = self._times.get(name, 0) + 1
        taken = self._taken.get(name)
        if taken is None and times not in _OFTEN:
            return
        control, m = self._control, self._context
        label = control.label_of(name)
        if label is None or label.source is not control.source or control.source.following() != label.place:
            return
        if taken is None:
            try:
                taken = _Function(name, label, control, self._lines, self._taken, bool(m.state.absolute))
            except (_Refused, SyntaxError, RecursionError, MemoryError):
                return
            finally:
                control.source.go_to(label.place)
            self._taken[name] = taken
        if taken.absolute == m.state.absolute and _is_plain(m):
            m.out.make_room(_MOST * 2)
            parameters = m.parameters
            stopped = taken.run(m, control, taken, parameters.numbers, parameters.locals[-1], parameters.globals)
            control.has_left_branches()
            if stopped is not None:
                control.source.go_to(stopped)


def _is_plain(m: Context) -> bool:
    """Whether straight moves, feeds and settings are nothing else now, as in `RepeatedLines.move`."""
    state = m.state
    return (
        state.feed_mode == PER_MINUTE
        and m.out.compensation is None
        and m.leaving is None
        and bool(state.arc_allowed)
        and not (state.unplaced or state.tcp or state.diameter)
    )


class _Function:
    """A loop or subroutine as a function, `run`, which gives the place where it stopped; None: a subroutine's end.

    `places`: of its lines. `labels`: of its loops and of what it calls. `words`: its ends. `calls`: what is taken.
    """

    def __init__(
        self,
        name: str,
        label: Label,
        control: Control,
        lines: RepeatedLines,
        calls: dict[str, _Function],
        absolute: bool,
    ):
        self.absolute = absolute
        self.places: list[SourcePosition] = []
        self.labels: list[Label] = []
        self.words: list[Word] = []
        self.calls = calls
        self._name = name if label.kind == "sub" else ""
        self._code: list[str] = []
        self._open: list[tuple[str, str, int]] = []  # kind, name, place of its label
        self._control = control
        self._ended = False  # by the ENDSUB of the subroutine
        source, scope = control.source, control.scope
        while not self.places or self._open or (self._name and not self._ended):
            self.places.append(source.following())
            raw = source.read_again()
            line = lines.find(raw)
            if not raw or len(self.places) > _MOST or (line is None and raw.strip()):
                raise _Refused
            if line is None:
                continue
            if any("known[" in step for step in (*line.parts.steps, *line.parts.values)):
                raise _Refused  # a name may ask for what is not kept up to date here
            if line.word is not None:
                kind, name = line.word.kind, line.word.name
                if kind in GLOBAL:
                    self._subroutine(line, kind, name, source.following())
                else:
                    self._branch(line, kind, f"{scope}#{name}")
            elif line.simple:
                self._simple(line, self.places[-1].line)
            else:
                raise _Refused
        self._put(f"return places[{len(self.places)}]")
        self.places.append(source.following())
        self.run: Callable[..., SourcePosition | None] = lines.compiled(_HEAD + "\n".join(self._code) + _TAIL)

    def _put(self, *lines: str) -> None:
        self._code += [" " * (2 + len(self._open)) + line for line in lines]

    def _subroutine(self, line: Line, kind: str, name: str, behind: SourcePosition) -> None:
        """SUB, which the function begins with, ENDSUB and RETURN, which leave it, and CALL."""
        k, label = len(self.places) - 1, self._control.label_of(name)
        if kind == "call":
            if label is None or label.source is not self._control.source or self._control.deepest > _DEEPEST:
                raise _Refused
            self.labels.append(label)
            self.places.append(behind)
            self._put(f"at = {k}", f"v, called = [{', '.join(line.parts.values)}], calls.get({name!r})")
            asked = f"entered({name!r}, labels[{len(self.labels) - 1}], v, places[{k + 1}])"
            self._put(f"if called is None or called.absolute != {int(self.absolute)} or not {asked}:")
            self._put(" return places[at]", "v = called.run(m, control, called, n, p.locals[-1], q)")
            self._put("if v is not None:", " return v", "x, y, z, a, b, c = state.position()")
        elif kind == "sub" and k == 0 and name == self._name:
            self._put(f"if size() > {BLOCK_ROWS - 2 * _MOST}:", " return places[at]")
        elif kind in ("endsub", "return") and name == self._name:
            self._ended = self._ended or (kind == "endsub" and not self._open)
            self.words.append(Word(kind, name, line.word.spelled if line.word else "", 0))
            self._put(f"control.execute(words[{len(self.words) - 1}])", "return None")
        else:
            raise _Refused

    def _branch(self, line: Line, kind: str, name: str) -> None:
        k, label = len(self.places) - 1, self._control.label_of(name)
        values = line.parts.values
        if label is None or kind not in _KINDS:
            raise _Refused
        if kind in _ENDS or kind == "if":
            if label.place != self.places[-1] or label.source is not self._control.source or label.kind != kind:
                raise _Refused
        elif not self._open or self._open[-1][1] != name:
            raise _Refused
        if kind in _ENDS:
            self.labels.append(label)
            self._put(f"at = {k}", "while True:")
            self._open.append((kind, name, len(self.labels) - 1))
            goes_on = (
                f"{values[0]} != 0.0" if kind == "while" else f"begun({name!r}, labels[{len(self.labels) - 1}], v)"
            )
            self._put(f"at = {k}", f"if size() > {BLOCK_ROWS - 2 * _MOST}:", " return places[at]")
            self._put(*([f"v = {values[0]}"] if kind == "repeat" else []), f"if not {goes_on}:")
            self._put(" break")
        elif kind == "if":
            self._put(f"at = {k}", f"if {values[0]} != 0.0:")
            self._open.append((kind, name, 0))
            self._put("pass")
        elif kind == "else":
            if self._open.pop()[0] != "if":
                raise _Refused
            self._put("else:")
            self._open.append((kind, name, 0))
            self._put("pass")
        elif kind == "endif":
            if self._open.pop()[0] not in ("if", "else"):
                raise _Refused
        else:
            opened, _, place = self._open[-1]
            if _ENDS.get(opened) != kind:
                raise _Refused
            self._put(f"at = {k}", f"if not unseen(labels[{place}]):", " return places[at]")
            self._open.pop()

    def _simple(self, line: Line, number: int) -> None:
        """Settings, F and a straight move, in the order of `RepeatedLines.move`."""
        steps, words, settings, _ = line.parts
        self._put(f"at = {len(self.places) - 1}", *(part for step in steps for part in step.split("\n ")))
        if line.axes:
            motion = "state.motion" if line.motion == -1 else str(line.motion)
            self._put(f"motion = {motion}")
            self._put("if motion != 0 and (motion != 10 or state.feed_rate == 0.0):", " return places[at]")
        if "f" in words:
            self._put(f"if {words['f']} == 0.0:", " return places[at]")
        for place, value in settings:
            named = place.startswith(("'", '"'))
            names = ("q" if place[1:2] == "_" else "l") if named else "n"
            self._put(f"if {names}[{place}] != {value}:", " p.changes += 1", f"{names}[{place}] = {value}")
        spelled = [f"digit({line.digits})", f"number({line.n})", f"row({number})"]
        if "f" in words:
            self._put(f"state.feed_rate = {words['f']}", f"extend(({words['f']}, {', '.join(['0.0'] * 8)}))")
            self._put(f"kind({RATE})", *spelled)
        if line.axes:
            for axis in _AXES:
                if axis in words:
                    value = words[axis] if self.absolute else f"{axis} + {words[axis]}"
                    self._put(f"{axis} = state.{axis} = {value}")
            self._put("extend((x, y, z, a, b, c, 0.0, 0.0, 0.0))", f"kind({FEED} if motion else {TRAVERSE})", *spelled)
            self._put("state.motion, state.cycle_series = motion, 0")
