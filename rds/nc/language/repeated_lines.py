"""Lines of loops and recursion: taken apart once, and executed from then on by the code made of them.

A line is kept by its text once it has been executed some times. What a kept line does is what the reader would do; a
line that it would fault, or that has anything rare, is left to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from rds.nc.language.blocks import AXIS_SET, MOTION, Block
from rds.nc.language.canon import FEED, TRAVERSE
from rds.nc.language.compiled_values import FAULTS, Compiler, Refused, checked, names_of
from rds.nc.language.owords import FANUC, GLOBAL, KIND, TESTS, Word, spelled
from rds.nc.language.parameters import ARGUMENTS, Parameters
from rds.nc.language.state import PER_MINUTE
from rds.nc.language.targets import target
from rds.nc.language.words import OTHERS, line_number, read_plain

if TYPE_CHECKING:
    from rds.nc.language.context import Context

_OFTEN = 3  # executions after which a line is worth being taken apart
_MOST = 20_000  # lines kept at once
_WHOLE = frozenset("hlt")  # words that are whole
_FIRST_OF_USE = 5000  # parameters below are nothing but the program's
_NOTHING = Word()
_SIMPLE = frozenset("xyzabcf")
_STRAIGHT: tuple[dict[int, int], ...] = ({}, {MOTION: 0}, {MOTION: 10})
_KINDS = TESTS | frozenset(
    ("sub", "call", "endsub", "return", "do", "endwhile", "endrepeat", "break", "continue", "else", "endif")
)


class Parts(NamedTuple):
    """Code of a line: what is worked out, the variables of words and of settings, the values of O words."""

    steps: list[str]
    words: dict[str, str]
    settings: list[tuple[str, str]]
    values: Sequence[str] = ()


class Line:
    """A kept line: its text as tidy() gives it, and the digits, number and end of its word N."""

    __slots__ = (
        *("axes", "code", "comment", "digits", "g", "m", "motion", "n", "places", "plain", "ready", "scope", "simple"),
        *("parts", "text", "word"),
    )

    def __init__(self, text: str):
        self.text = text
        self.digits = self.n = 0
        self.g: dict[int, int] = {}
        self.m: dict[int, int] = {}
        self.comment = ""
        self.places: dict[str, int] = {}
        self.plain = read_plain(text) is not None  # a line that the fast lane may take
        self.word: Word | None = None  # the O word that the line is
        self.ready, self.scope = Word(), ""  # that word with its name in a subroutine (the scope)
        self.simple = False  # nothing but settings, F, and a straight move: its G word, or -1, and its axis words
        self.motion, self.axes = -1, False
        self.code: Callable[..., Any] | None = None
        self.parts = Parts([], {}, [])  # what that is made of


class RepeatedLines:
    """The kept lines of one run of a program, by their bytes."""

    def __init__(self, parameters: Parameters):
        self._parameters = parameters
        self._names: dict[str, Any] = {}
        self._lines: dict[bytes, Line | int | None] = {}

    def find(self, raw: bytes) -> Line | None:
        """The line, if it is kept."""
        found = self._lines.get(raw, 0)
        return found if isinstance(found, Line) else None

    def count(self, raw: bytes, text: str) -> None:
        """The line has been executed by the reader, without a fault."""
        found = self._lines.get(raw, 0)
        if not isinstance(found, int):
            return
        if len(self._lines) >= _MOST:
            self._lines.clear()
        self._lines[raw] = found + 1 if found < _OFTEN else self._take_apart(text)

    def block(self, line: Line) -> Block | None:
        """The block that a line with words is now, its settings noted; None where the reader says what is wrong."""
        found = self._values(line)
        if found is None:
            return None
        block, parameters = Block(), self._parameters
        (block.words, settings), block.comment = found, line.comment
        if line.g:
            block.g = line.g.copy()
        if line.m:
            block.m = line.m.copy()
        for name, value in settings:
            parameters.set_later(name, value)
        return block

    def move(self, line: Line, m: Context) -> bool:
        """Execute a simple line, where the modes make no more of it than settings, F and a straight move.

        False, and nothing done, for any other, and where the reader is to say what is wrong.
        """
        state, out = m.state, m.out
        motion = state.motion if line.motion == -1 else line.motion
        if (
            state.feed_mode != PER_MINUTE
            or out.compensation is not None
            or m.leaving is not None
            or not state.arc_allowed
            or state.unplaced
            or state.tcp
            or state.diameter
            or (line.axes and motion != 0 and (motion != 10 or state.feed_rate == 0.0))
        ):
            return False
        found = self._values(line)
        if found is None:
            return False
        words, settings = found
        if "f" in words and words["f"] == 0.0:
            return False  # a move by feed says that it is missing
        if settings:
            m.parameters.settle_now(settings)
        if "f" in words:
            state.feed_rate = words["f"]
            out.rate(words["f"])
        if line.axes:
            get = words.get
            if state.absolute:
                state.x, state.y, state.z = get("x", state.x), get("y", state.y), get("z", state.z)
                state.a, state.b, state.c = get("a", state.a), get("b", state.b), get("c", state.c)
            else:
                state.move_to(target(state, words))
            out.straight(TRAVERSE if motion == 0 else FEED, (state.x, state.y, state.z, state.a, state.b, state.c))
            state.motion, state.cycle_series = motion, 0
        return True

    def _values(self, line: Line) -> tuple[dict[str, float], tuple[tuple[int | str, float], ...]] | None:
        """The words and settings of a line as its code gives them; None where that is a fault."""
        parameters = self._parameters
        try:
            assert line.code is not None
            found: tuple[dict[str, float], tuple[tuple[int | str, float], ...]]
            found = line.code(parameters.numbers, parameters.locals[-1], parameters.globals)
        except FAULTS:
            return None
        return found

    def control(self, line: Line, scope: str, skipping: str) -> Word | None:
        """The O word that a line is now; None where the reader is to say what is wrong."""
        kept, parameters = line.word, self._parameters
        assert kept is not None
        word = line.ready
        if not word.kind or line.scope != scope:
            name = kept.name if kept.kind in GLOBAL else f"{scope}#{kept.name}"
            word = line.ready = Word(kept.kind, name, kept.spelled, kept.at)
            line.scope = scope
        if skipping and kept.kind == "call":
            return _NOTHING
        elif line.code is not None and skipping in ("", word.name):
            try:
                values = line.code(parameters.numbers, parameters.locals[-1], parameters.globals)
            except FAULTS:
                return None
            if kept.kind == "call":
                word.arguments = values
            else:
                word.test = values[0]
        return word

    # -- taking apart -------------------------------------------------------------------------------------------------

    def _take_apart(self, text: str) -> Line | None:
        """None for a line that is left to the reader."""
        line = Line(text)
        try:
            line.digits, line.n, at = line_number(text)
            if text[:1] in ("/", "%") or text.startswith("gr", at) or FANUC.match(text, at):
                return None
            take = self._control_code if text.startswith("o", at) else self._words_code
            source = take(line, at)
            line.code = self.compiled(source) if source else None
        except (Refused, *FAULTS, SyntaxError, RecursionError, MemoryError):
            return None
        return line

    def compiled(self, source: str) -> Callable[..., Any]:
        """The function `line` of code made here, with what that may use."""
        if not self._names:
            self._names = names_of(self._parameters)
        found: dict[str, Any] = {}
        exec(compile(source, "<lines of a part program>", "exec", dont_inherit=True), self._names, found)
        return found["line"]

    def _control_code(self, line: Line, at: int) -> str:
        """The code of an O word's values, and the word; "" where it has none."""
        reader, text = Compiler(line.text, self._parameters, at + 1), line.text
        label = reader.name() if reader.peek() == "<" else str(int(reader.index()))
        match = KIND.match(text, reader.at)
        if match is None or match[0] not in _KINDS:
            raise Refused
        reader.at = match.end()
        line.word = Word(match[0], label, spelled(label), at)
        values: list[str] = []
        if match[0] in TESTS:
            values.append(reader.expression())
        while reader.peek() in ("[", "("):
            if reader.peek() == "(":
                reader.at = text.index(")", reader.at) + 1
            elif match[0] == "call" and len(values) < ARGUMENTS:
                values.append(reader.expression())
            else:
                raise Refused
        if reader.peek() not in ("", ";"):
            raise Refused
        line.parts = Parts([], {}, [], values)
        return f"def line(n, l, q):\n return [{', '.join(values)}]" if values else ""

    def _words_code(self, line: Line, at: int) -> str:
        reader, text = Compiler(line.text, self._parameters, at), line.text
        template = Block()
        steps: list[str] = []
        words: dict[str, str] = {}
        settings: list[tuple[str, str]] = []
        while reader.at < len(text):
            start, letter = reader.at, text[reader.at]
            reader.at += 1
            if letter == "(":
                reader.at = text.index(")", start) + 1
                line.comment = text[start + 1 : reader.at - 1]
                continue
            if letter == ";":
                break
            if letter == "#":
                settings.append(self._setting(reader, steps))
                continue
            value = reader.value()
            if letter in "gm":
                code = float(value[1:-1])  # ValueError: it is worked out, and left to the reader
                (template.add_g if letter == "g" else template.add_m)(code)
                line.places.setdefault(f"{letter}{round(10 * code if letter == 'g' else code)}", start)
            elif letter in OTHERS and letter not in template.words:
                template.words[letter] = 0.0
                line.places[letter] = start
                variable = f"v{len(steps)}"
                steps.append(f"{variable} = {checked(value)}")
                if letter in _WHOLE:
                    steps.append(f"{variable} = whole({variable})")
                if letter in _WHOLE or letter in "fs":
                    steps.append(f"not_negative({variable})")
                words[letter] = variable
            else:
                raise Refused
        line.g, line.m = template.g, template.m
        line.motion, line.axes = line.g.get(MOTION, -1), not AXIS_SET.isdisjoint(template.words)
        simple = line.g in _STRAIGHT and not line.m and not line.comment and template.words.keys() <= _SIMPLE
        line.simple = simple and (line.axes or line.motion == -1)
        line.parts = Parts(steps, words, settings)
        found = ", ".join(f"{letter!r}: {variable}" for letter, variable in words.items())
        given = "".join(f"({name}, {value}), " for name, value in settings)
        return "\n ".join(["def line(n, l, q):", *steps, f"return {{{found}}}, ({given})"])

    def _setting(self, reader: Compiler, steps: list[str]) -> tuple[str, str]:
        """The steps of #... = value; code of what is set, and of its value."""
        if reader.peek() == "<":
            name = reader.name()
            if name in self._parameters.known:
                raise Refused
            steps.append(f"declare({name!r})")
            place = repr(name)
        else:
            place = reader.index()
            if not (place.isdecimal() and 1 <= int(place) < _FIRST_OF_USE):
                steps.append(f"p{len(steps)} = {place}\n settable(p{len(steps)})")
                place = f"p{len(steps) - 1}"
        reader.expect("=")
        variable = f"v{len(steps)}"
        steps.append(f"{variable} = {checked(reader.value())}")
        return place, variable
