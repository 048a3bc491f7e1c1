"""Labels and jumps, IF, WHILE, DO and REPEAT: the flow of a program within a subroutine, as LinuxCNC runs it.

Where LinuxCNC goes on in a strange way, this does not: a loop left by BREAK does not stop a later DO loop, a REPEAT
left early counts anew, and a BREAK that is passed over does nothing.
"""

from __future__ import annotations

from typing import NamedTuple

from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.owords import Word
from rds.nc.language.parameters import Parameters
from rds.nc.language.saved_modes import SavedModes
from rds.nc.language.source import Source, SourcePosition


class Label(NamedTuple):
    """Where an O word stands that can be jumped to: the file and the place of its block, and what kind it is."""

    kind: str
    source: Source
    place: SourcePosition


class Frame:
    """A subroutine being executed: where it was called from, and what it found.

    `kept`: the parameters of its caller; None: M98 called it, which shares them. `more`: how often M98 still calls it.
    """

    __slots__ = ("kept", "more", "name", "place", "repeats", "saved", "source")

    def __init__(self, name: str, source: Source, place: SourcePosition, kept: list[float] | None, more: int = 0):
        self.name = name
        self.source = source
        self.place = place
        self.kept = kept
        self.more = more
        self.saved: SavedModes | None = None  # by M70 or M73
        self.repeats: dict[str, int] = {}  # rounds left, by label


class Branches:
    """Labels, jumps back to them, branches and loops of one program."""

    def __init__(self, source: Source, parameters: Parameters, dialect: Dialect):
        self.source = source
        self.skipping = ""  # the label that execution goes on at
        self.value = 0.0  # what the last subroutine returned
        self.returned = False
        self._since_place = source.place  # the block at which skipping began
        self._parameters = parameters
        self._dialect = dialect
        self._labels: dict[str, Label] = {}
        self._frames: list[Frame] = []
        self._repeats: dict[str, int] = {}  # of the main program
        self._done_if = True  # whether a branch of the present IF has been executed
        self._breaking = self._continuing = False
        self._jumps = 0
        self._kept: tuple | None = None  # label, changes and what was visible at an earlier jump

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
                f"{word.spelled} belongs to {label.kind.upper()} in line {label.place.line} already;"
                " take another number",
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

    def label_of(self, name: str) -> Label | None:
        """Where the loop or branch `name` begins, once that has been executed."""
        return self._labels.get(name)

    def jumps_unseen(self, label: Label) -> bool:
        """Count a jump back to a label; False, and nothing done, where something is to be looked at or kept for it."""
        jumps, kept = self._jumps + 1, self._kept
        if (
            jumps > self._dialect.max_jumps
            or not jumps & (jumps - 1)
            or kept is None
            or (kept[1] == self._parameters.changes and kept[0] == label)
        ):
            return False
        self._jumps = jumps
        return True

    def round_of(self, name: str, label: Label, test: float) -> bool:
        """Whether a REPEAT loop has one more round, which begins."""
        rounds = self._rounds()
        left = rounds.get(name)
        if left is None:
            left = round(test)
        if left > 0:
            rounds[name] = left - 1
        else:
            rounds.pop(name, None)
        self._forget_rounds(label)
        return left > 0

    def has_left_branches(self) -> None:
        """The next block stands in none, or in the one of an IF that is executed."""
        self._done_if = True

    def begin_anew(self) -> None:
        """What is executed from now on, such as a contour for the second time, is no round of a loop."""
        self._kept = None

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
        frames = [(frame.name, frame.source, frame.place, frame.more, frame.kept) for frame in self._frames]
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
        self.skipping = ""
        if not self.round_of(word.name, label, word.test):
            self._skip_to(word.name)

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


BRANCH_ACTIONS = {
    "if": Branches._if,
    "elseif": Branches._elseif,
    "else": Branches._else,
    "endif": Branches._endif,
    "do": Branches._do,
    "while": Branches._while,
    "endwhile": Branches._endwhile,
    "repeat": Branches._repeat,
    "endrepeat": Branches._endrepeat,
    "break": Branches._break,
    "continue": Branches._continue,
}
