"""The flow of a program: subroutines, branches and loops, as LinuxCNC runs them.

While `skipping` names a label, every block is passed over but the one with that O word. Labels of branches and loops
belong to the subroutine that they stand in.

Where LinuxCNC goes on in a strange way, this does not: a loop left by BREAK does not stop a later DO loop, a REPEAT
left early counts anew, a BREAK that is passed over does nothing, and a subroutine ends only with its own name (RETURN
may bear that of a branch or loop in it).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.owords import FANUC, Word, nested, read_fanuc, read_gr, read_word, spelled
from rds.nc.language.parameters import Parameters
from rds.nc.language.repeated_lines import Line, RepeatedLines
from rds.nc.language.saved_modes import SavedModes
from rds.nc.language.source import Place, Source, open_file
from rds.nc.language.words import column_of, line_number, recoded, tidy

_ENDS = {"sub": "ENDSUB", "if": "ENDIF", "while": "ENDWHILE", "do": "WHILE [...]", "repeat": "ENDREPEAT"}
_FILE_NAME = re.compile(r"[^/\\\x00]+")


@dataclass(slots=True)
class Label:
    """Where an O word stands that can be jumped to: the file and the place of its block, and what kind it is."""

    kind: str
    source: Source
    place: Place


@dataclass(slots=True)
class Frame:
    """A subroutine being executed: where it was called from, and what it found."""

    name: str
    source: Source
    place: Place
    kept: list[float] | None  # None: M98 called it, which has the parameters of its caller
    saved: SavedModes | None = None  # by M70 or M73
    more: int = 0  # how often M98 still calls it
    repeats: dict[str, int] = field(default_factory=dict)  # rounds left, by label


class Control:
    """The flow of one program."""

    def __init__(self, source: Source, parameters: Parameters, dialect: Dialect):
        self.source = source
        self.skipping = ""  # the label that execution goes on at
        self._since_place = source.place  # the block at which skipping began
        self._since = Word()  # the call whose definition is being looked for
        self._main = source
        self._parameters = parameters
        self._dialect = dialect
        self._labels: dict[str, Label] = {}
        self._frames: list[Frame] = []
        self._repeats: dict[str, int] = {}  # of the main program
        self._seeking = ""  # the subroutine whose definition is being looked for
        self._defining = ""
        self._done_if = True  # whether a branch of the present IF has been executed
        self._breaking = self._continuing = False
        self._jumps = 0
        self._kept: tuple | None = None  # label, changes and what was visible at an earlier jump
        self._opened: dict[Path, Source] = {}
        self._saved: SavedModes | None = None  # by M70 in the main program
        self.restore: Callable[[SavedModes], None] = lambda _: None  # what M73 wants when a subroutine returns
        self.value = 0.0  # what the last subroutine returned
        self.returned = False

    @property
    def depth(self) -> int:
        """Subroutine calls inside one another."""
        return len(self._frames)

    @property
    def repeats(self) -> bool:
        """Whether lines have been executed again, or may be."""
        return self._jumps > 0

    def again(self, line: Line, lines: RepeatedLines) -> Word | None:
        """The O word that a kept line is now; None where it is to be read."""
        scope = self._frames[-1].name if self._frames else ""
        return None if self._defining else lines.control(line, scope, self.skipping)

    def close(self) -> None:
        """Close the program and the files of its subroutines."""
        for source in (self._main, *self._opened.values()):
            source.close()

    # -- reading ------------------------------------------------------------------------------------------------------

    def read(self, text: str, at: int) -> Word:
        """The O word that begins at `at`. Raises Fault."""
        scope = self._frames[-1].name if self._frames else self._defining
        return read_word(text, at, self._parameters, scope=scope, defining=self._defining, skipping=self.skipping)

    def fanuc(self, text: str, at: int) -> Word | None:
        """M98 or M99, when it begins at `at`; M99 of the main program, which ends it, is a word like others."""
        match = FANUC.match(text, at)
        if match is None or (match[1] == "9" and not self._frames):
            return None
        within = self._frames[-1].name if self._frames else ""
        return read_fanuc(text, at, self._parameters, within, self.skipping)

    @property
    def saved(self) -> SavedModes | None:
        """The modes that M70 or M73 saved in the subroutine being executed, or in the main program."""
        return self._frames[-1].saved if self._frames else self._saved

    @saved.setter
    def saved(self, modes: SavedModes | None) -> None:
        if self._frames:
            self._frames[-1].saved = modes
        else:
            self._saved = modes

    def read_gr(self, text: str, at: int) -> Word:
        """The subroutine call GR. Raises Fault."""
        return Word() if self.skipping else read_gr(text, at, self._parameters)

    # -- executing ----------------------------------------------------------------------------------------------------

    def execute(self, word: Word) -> None:
        """Do what an O word says. Raises Fault."""
        if not word.kind or (self.skipping and self.skipping != word.name):
            return
        if self._seeking and word.kind not in ("sub", "program"):
            return
        _ACTIONS[word.kind](self, word)

    def check_end(self) -> None:
        """The file ends. Raises ProgramError when something is still open."""
        if self._seeking:
            name = self._seeking
            label = Label("call", self._frames[-1].source, self._since_place)
            by_number = self._since.kind == "m98"
            word = self._since.spelled if by_number else f"{self._since.spelled} CALL"
            begins = (
                f"by O{name} on a line of its own, ended by M99" if by_number else f"between O<{name}> SUB and ENDSUB"
            )
            raise self._fault_at(
                label,
                word,
                f"the subroutine {name} is not defined in {self.source.name or 'the program'} after the call; define it"
                f" {begins}, or in a file {name}.ngc beside the program",
            )
        if self.skipping:
            label = self._labels.get(self.skipping, Label("", self.source, self._since_place))
            name = spelled(self.skipping.rpartition("#")[2])
            end = _ENDS.get(label.kind, "ENDIF, ENDWHILE, ENDREPEAT or ENDSUB")
            word = f"{name} {label.kind.upper()}".rstrip()
            raise self._fault_at(label, word, f"is not closed before the file's end; write {name} {end} where it ends")

    def _fault_at(self, label: Label, word: str, message: str) -> ProgramError:
        """A fault at the O word of a block that was read before."""
        source, place = label.source, label.place
        source.go_to(place)
        raw = source.read()
        text = tidy(raw)
        column = column_of(raw, max(line_number(text)[2], 0)) + place.column
        return ProgramError(recoded(message), file=source.name, line=place.line, column=column, word=recoded(word))

    def _skip_to(self, name: str) -> None:
        self.skipping = name
        self._since_place = self.source.place

    def _define(self, word: Word) -> None:
        self._labels[word.name] = Label(word.kind, self.source, self.source.place)

    def _label(self, word: Word, *kinds: str) -> Label:
        label = self._labels.get(word.name)
        if label is None or label.kind not in kinds:
            names = " or ".join(kind.upper() for kind in kinds)
            found = f"; {word.spelled} is a {label.kind.upper()} in line {label.place.line}" if label else ""
            raise Fault(
                f"{word.spelled} {word.kind.upper()} has no {word.spelled} {names} before it{found}; write it with the"
                " same number or name",
                at=word.at,
            )
        return label

    def _new_label(self, word: Word, *others: str) -> None:
        """Remember a label; the same one elsewhere is a fault."""
        label = self._labels.get(word.name)
        if label is None:
            self._define(word)
        elif label.kind not in others and (label.place != self.source.place or label.source is not self.source):
            raise Fault(
                f"{word.spelled} is already a {label.kind.upper()} in line {label.place.line}; take another number",
                at=word.at,
            )

    def _jump(self, label: Label) -> None:
        self._jumps += 1
        if self._jumps > self._dialect.max_jumps:
            raise ProgramError(
                f"more than {self._dialect.max_jumps} calls and jumps back: the program does not seem to end; check its"
                " loops, or allow more (--max-jumps)"
            )
        self._look_for_progress(label)
        self.source = label.source
        self.source.go_to(label.place)

    def _look_for_progress(self, label: Label) -> None:
        """Raises ProgramError when everything that the program can see is as it was at an earlier jump to the label.

        Compared with one earlier jump: the last whose number is a power of two, so that a round of any length is found.
        """
        parameters, kept = self._parameters, self._kept
        if kept is not None and kept[:2] == (label, parameters.changes):
            if kept[2:] == self._visible():
                kind = label.kind.upper()
                raise ProgramError(
                    f"the {kind} loop in line {label.place.line} never ends: a round leaves everything as it was;"
                    " change in it what its test asks for, or leave it by BREAK"
                )
        elif kept is None or not self._jumps & (self._jumps - 1):
            self._kept = (label, parameters.changes, *self._visible())

    def _visible(self) -> tuple:
        """What a program can ask for or depend on, besides where it is."""
        parameters = self._parameters
        flags = (self._done_if, self._breaking, self._continuing, self.value, self.returned, len(self._labels))
        tool = parameters.known["_selected_tool"]() if "_selected_tool" in parameters.known else 0.0
        rounds = [sorted(frame.repeats.items()) for frame in self._frames] + [sorted(self._repeats.items())]
        frames = [id(frame) for frame in self._frames]
        return flags, tool, rounds, frames, parameters.state.values(), parameters.snapshot()

    def _rounds(self) -> dict[str, int]:
        return self._frames[-1].repeats if self._frames else self._repeats

    def _forget_rounds(self, label: Label) -> None:
        """A loop begins anew or is left: REPEAT loops inside it count anew."""
        rounds = self._rounds()
        for name in list(rounds):
            inner = self._labels[name]
            if inner.source is label.source and inner.place.offset > label.place.offset:
                del rounds[name]

    # -- subroutines --------------------------------------------------------------------------------------------------

    def _sub(self, word: Word) -> None:
        if self._frames and self._frames[-1].kept is None and word.name == self._frames[-1].name:
            raise Fault(
                f"{word.spelled} SUB is called by M98, which calls programs that begin with {word.spelled} alone and"
                f" end with M99; write {word.spelled} CALL",
                at=word.at,
            )
        if self.skipping:  # its definition was looked for, and is found
            self._seeking = self.skipping = ""
            self._define(word)
        elif not self._frames:
            if word.name in self._labels:
                line = self._labels[word.name].place.line
                raise Fault(
                    f"the subroutine {word.spelled} is defined already, in line {line}; take another name", at=word.at
                )
            self._define(word)
            self._skip_to(word.name)
            self._defining = word.name
        elif word.name != self._frames[-1].name:
            raise nested(self._frames[-1].name, word)

    def _call(self, word: Word) -> None:
        if len(self._frames) >= self._dialect.max_depth:
            raise Fault(
                f"more than {self._dialect.max_depth} subroutine calls inside one another; call fewer", at=word.at
            )
        by_number = word.kind == "m98"
        if by_number and not word.times:
            return
        kept = self._parameters.enter(None if by_number else word.arguments)
        frame = Frame(word.name, self.source, self.source.following(), kept, more=word.times - 1)
        place = self.source.place
        self._frames.append(frame)
        label = self._labels.get(word.name)
        if label is not None and label.kind in ("sub", "program"):
            self._jump(label)
            return
        self._jumps += 1
        found = self._file(word)
        if found is not None:
            self.source = found
        self._skip_to(word.name)
        self._since_place, self._since = place, word
        self._seeking = word.name

    def _file(self, word: Word) -> Source | None:
        """The file beside the program that is named like the subroutine."""
        folder: Path | None = self._main.folder
        if folder is None or not _FILE_NAME.fullmatch(word.name) or len(word.name.encode()) > 200:
            return None
        path = folder / f"{recoded(word.name)}.ngc"
        if not path.is_file():
            return None
        found = open_file(path, str(path), semicolons=self._dialect.program_numbers)
        self._opened[path] = found
        return found

    def _program(self, word: Word) -> None:
        """A program number alone: where M98 goes to, and nothing else."""
        if self._frames and self._frames[-1].name == word.name and self._frames[-1].kept is not None:
            raise Fault(
                f"the program {word.spelled} is called by {word.spelled} CALL; write M98 P{word.name}, or SUB after it",
                at=word.at,
            )
        if self.skipping:  # it was looked for, and is found
            self._seeking = self.skipping = ""
            self._define(word)

    def _return(self, word: Word) -> None:
        if self._frames:
            frame = self._frames[-1]
            if (frame.kept is None) != (word.kind == "m99"):
                ends = "M99" if frame.kept is None else f"{spelled(frame.name)} ENDSUB"
                raise Fault(f"{word.spelled} {word.kind.upper()} does not end this; write {ends}", at=word.at)
            # RETURN may bear the label of the branch or loop that it stands in: LinuxCNC's own examples are written so
            within = word.kind == "return" and f"{frame.name}#{word.name}" in self._labels
            if word.name != frame.name and not within:
                raise Fault(
                    f"{word.spelled} {word.kind.upper()} inside the subroutine {frame.name!r}; write its name",
                    at=word.at,
                )
            self.skipping = ""
            self.value, self.returned = word.value or 0.0, word.value is not None
            self._frames.pop()
            self._parameters.leave(frame.kept)
            if frame.more:
                self._again(frame, word)
            else:
                self.source = frame.source
                self.source.go_to(frame.place)
            if frame.saved is not None and frame.saved.again:
                self.restore(frame.saved)
        elif not self._defining:
            raise Fault(f"{word.spelled} {word.kind.upper()} outside of a subroutine; remove it", at=word.at)
        elif word.kind == "endsub":
            self.skipping = self._defining = ""

    def _again(self, frame: Frame, word: Word) -> None:
        """M98 with L: the program once more."""
        self._frames.append(Frame(frame.name, frame.source, frame.place, self._parameters.enter(None)))
        self._frames[-1].more = frame.more - 1
        self._jump(self._labels[word.name])

    # -- branches -----------------------------------------------------------------------------------------------------

    def _if(self, word: Word) -> None:
        self._new_label(word)
        self._done_if = word.test != 0.0
        if self._done_if:
            self.skipping = ""
        else:
            self._skip_to(word.name)

    def _elseif(self, word: Word) -> None:
        self._label(word, "if")
        if self._done_if:
            self._skip_to(word.name)
        elif word.test != 0.0:
            self.skipping = ""
            self._done_if = True

    def _else(self, word: Word) -> None:
        self._label(word, "if")
        if self._done_if:
            self._skip_to(word.name)
        elif self.skipping:
            self._done_if = True
            self.skipping = ""

    def _endif(self, word: Word) -> None:
        self._label(word, "if")
        self.skipping = ""
        self._done_if = True

    # -- loops --------------------------------------------------------------------------------------------------------

    def _do(self, word: Word) -> None:
        self.skipping = ""
        if word.name not in self._labels:
            self._define(word)

    def _while(self, word: Word) -> None:
        self._new_label(word, "do")
        label = self._labels[word.name]
        self.skipping = ""
        if label.kind != "do":
            if word.test == 0.0:
                self._skip_to(word.name)
            return
        breaking, self._breaking, self._continuing = self._breaking, False, False
        if word.test != 0.0 and not breaking:
            self._jump(label)

    def _endwhile(self, word: Word) -> None:
        label = self._label(word, "while")
        skipped, self.skipping = bool(self.skipping), ""
        continuing, self._continuing, self._breaking = self._continuing, False, False
        if not skipped or continuing:
            self._jump(label)

    def _repeat(self, word: Word) -> None:
        self._new_label(word)
        label = self._label(word, "repeat")
        rounds = self._rounds()
        self.skipping = ""
        left = rounds.get(word.name)
        if left is None:
            left = round(word.test)
        if left > 0:
            rounds[word.name] = left - 1
        else:
            rounds.pop(word.name, None)
            self._skip_to(word.name)
        self._forget_rounds(label)

    def _endrepeat(self, word: Word) -> None:
        label = self._label(word, "repeat")
        if self.skipping:
            self.skipping = ""
        else:
            self._jump(label)

    def _break(self, word: Word) -> None:
        label = self._label(word, "while", "do")
        if self.skipping:
            return
        self._forget_rounds(label)
        self._skip_to(word.name)
        self._breaking = True

    def _continue(self, word: Word) -> None:
        label = self._label(word, "while", "do")
        if self.skipping:
            return
        self._forget_rounds(label)
        self._skip_to(word.name)
        self._continuing = True


_ACTIONS = {
    "sub": Control._sub,
    "endsub": Control._return,
    "return": Control._return,
    "call": Control._call,
    "program": Control._program,
    "m98": Control._call,
    "m99": Control._return,
    "if": Control._if,
    "elseif": Control._elseif,
    "else": Control._else,
    "endif": Control._endif,
    "do": Control._do,
    "while": Control._while,
    "endwhile": Control._endwhile,
    "repeat": Control._repeat,
    "endrepeat": Control._endrepeat,
    "break": Control._break,
    "continue": Control._continue,
}
