"""The flow of a program: subroutines and their calls, around its branches and loops, as LinuxCNC runs them.

While `skipping` names a label, every block is passed over but the one with that O word. Labels of branches and loops
belong to the subroutine that they stand in.

Other than in LinuxCNC, a subroutine ends only with its own name (RETURN may bear that of a branch or loop in it).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable

from rds.nc.language.branches import BRANCH_ACTIONS, Branches, Frame, Label
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.owords import FANUC, Word, nested, read_fanuc, read_gr, read_word, spelled
from rds.nc.language.parameters import Parameters
from rds.nc.language.repeated_lines import Line, RepeatedLines
from rds.nc.language.saved_modes import SavedModes
from rds.nc.language.source import Source, SourcePosition, open_file
from rds.nc.language.words import column_of, line_number, recoded, tidy

_ENDS = {"sub": "ENDSUB", "if": "ENDIF", "while": "ENDWHILE", "do": "WHILE [...]", "repeat": "ENDREPEAT"}
_FILE_NAME = re.compile(r"[^/\\\x00]+")


class Control(Branches):
    """The flow of one program."""

    def __init__(self, source: Source, parameters: Parameters, dialect: Dialect):
        super().__init__(source, parameters, dialect)
        self._since = Word()  # the call whose definition is being looked for
        self._main = source
        self._seeking = ""  # the subroutine whose definition is being looked for
        self._defining = ""
        self._opened: dict[str, Source] = {}
        self._saved: SavedModes | None = None  # by M70 in the main program
        self.restore: Callable[[SavedModes], None] = lambda _: None  # what M73 wants when a subroutine returns

    @property
    def depth(self) -> int:
        """Subroutine calls inside one another."""
        return len(self._frames)

    @property
    def repeats(self) -> bool:
        """Whether lines have been executed again, or may be."""
        return self._jumps > 0

    @property
    def scope(self) -> str:
        """The subroutine that labels belong to now; "" in the main program."""
        return self._frames[-1].name if self._frames else ""

    def again(self, line: Line, lines: RepeatedLines) -> Word | None:
        """The O word that a kept line is now; None where it is to be read."""
        return None if self._defining else lines.control(line, self.scope, self.skipping)

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
            times, number = divmod(int(name), 10_000) if by_number else (0, 0)
            counted = f"; as of Fanuc ({times} times O{number}), write M98 P{number} L{times}" if times else ""
            raise self._fault_at(
                label,
                word,
                f"the subroutine {name} is not defined in {self.source.name or 'the program'} after the call; define it"
                f" {begins}, or in a file {name}.ngc beside the program{counted}",
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
                known = self._labels[word.name]
                if known.source is self.source and known.place == self.source.place:
                    raise Fault(
                        f"the program runs into the subroutine {word.spelled}, which it has called before; end it"
                        " with M2 above that, or define it above its first call",
                        at=word.at,
                    )
                raise Fault(
                    f"the subroutine {word.spelled} is defined already, in line {known.place.line}; take another name",
                    at=word.at,
                )
            self._define(word)
            self._skip_to(word.name)
            self._defining = word.name
        elif word.name != self._frames[-1].name:
            raise nested(self._frames[-1].name, word)

    @property
    def deepest(self) -> int:
        """How many calls inside one another there may be."""
        return self._dialect.max_depth

    def enters(self, name: str, label: Label, arguments: list[float], behind: SourcePosition) -> bool:
        """Call a subroutine, to come back to `behind`; False, and nothing done, where there is more to it."""
        if len(self._frames) >= self._dialect.max_depth or not self.jumps_unseen(label):
            return False
        self._frames.append(Frame(name, self.source, behind, self._parameters.enter(arguments)))
        return True

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
        folder = self._main.folder
        if folder is None or not _FILE_NAME.fullmatch(word.name) or len(word.name.encode()) > 200:
            return None
        path = os.path.join(folder, f"{recoded(word.name)}.ngc")
        if not os.path.isfile(path):
            return None
        found = open_file(path, path, semicolons=self._dialect.program_numbers)
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
                found = "M99" if word.kind == "m99" else f"{word.spelled} {word.kind.upper()}"
                raise Fault(f"{found} does not end this; write {ends}", at=word.at)
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


_ACTIONS = {
    "sub": Control._sub,
    "endsub": Control._return,
    "return": Control._return,
    "call": Control._call,
    "program": Control._program,
    "m98": Control._call,
    "m99": Control._return,
    **BRANCH_ACTIONS,
}
