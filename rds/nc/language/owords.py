"""O words as they are read: their kind, what they name, and the values that they are given."""

from __future__ import annotations

import re

from rds.nc.language.expressions import Fault, Reader
from rds.nc.language.parameters import ARGUMENTS, Parameters

_KINDS = (
    *("sub", "endsub", "call", "do", "while", "repeat", "if", "elseif", "else", "endif"),
    *("break", "continue", "endwhile", "endrepeat", "return"),
)
KIND = re.compile("|".join(sorted(_KINDS, key=len, reverse=True)))
GLOBAL = frozenset(("sub", "endsub", "call", "return", "program"))
FANUC = re.compile(r"m0*9([89])(?![0-9.\[#])")  # M98 calls a program by its number, M99 ends it
TESTS = frozenset(("while", "repeat", "if", "elseif"))


class Word:
    """An O word that has been read. `kind` is "" when there is nothing to do; `name`, of labels inside subroutines, is
    `sub#label`; `spelled` is for messages; `at` where it begins in its block.
    """

    __slots__ = ("arguments", "at", "kind", "name", "spelled", "test", "times", "value")

    def __init__(self, kind: str = "", name: str = "", spelled: str = "", at: int = 0):
        self.kind = kind
        self.name = name
        self.spelled = spelled
        self.at = at
        self.test = 0.0
        self.arguments: list[float] = []
        self.value: float | None = None  # that RETURN or ENDSUB gives back
        self.times = 1  # that M98 calls


def read_word(text: str, at: int, parameters: Parameters, *, scope: str, defining: str, skipping: str) -> Word:
    """The O word that begins at `at`. Raises Fault.

    `scope`: the subroutine that labels belong to; `defining`: the one that is being defined; `skipping`: the label up
    to which blocks are passed over, so that only what ends that is worked out ("": none).
    """
    reader = Reader(text, parameters, at + 1)
    try:
        label = reader.name() if reader.peek() == "<" else str(reader.integer())
    except Fault:
        if skipping:
            return Word(at=at)  # worked out from parameters that have no value yet
        raise
    match = KIND.match(text, reader.at)
    word = Word(match[0] if match else "", at=at)
    if not match and reader.peek() in ("", "(", ";") and not defining:
        word.kind = "program"  # O1000 alone, as Fanuc's programs begin
    word.spelled = spelled(label)
    word.name = label if word.kind in GLOBAL else f"{scope}#{label}"
    if match:
        reader.at = match.end()
    elif not defining and not word.kind:
        said = f"{word.spelled} is followed by no control word; write one of {', '.join(_KINDS).upper()} after it"
        raise Fault(said if skipping else f"{said}, or nothing where a program of that number begins", at=at)
    _read_values(word, reader, defining, skipping)
    if not skipping:
        while reader.peek() == "(":
            reader.at = text.index(")", reader.at) + 1
        if reader.peek() not in ("", ";"):
            said = f"{word.spelled} {word.kind.upper()}"
            raise reader.fault(f"only a comment can follow {said}; move the rest to a new line")
    return word


def spelled(label: str) -> str:
    """An O word's number or name as programs write it: O100, O<pocket>."""
    return f"O{label if label.lstrip('-').isdigit() else f'<{label}>'}"


def _read_values(word: Word, reader: Reader, defining: str, skipping: str) -> None:
    if word.kind == "sub":
        if defining:
            raise nested(defining, word)
    elif word.kind in ("endsub", "return"):
        if not skipping and reader.peek() == "[":
            word.value = reader.expression()
    elif defining or (word.kind == "call" and skipping):
        word.kind = ""  # passed over now
    elif word.kind == "call":
        _read_arguments(word, reader)
    elif word.kind in TESTS and skipping in ("", word.name):
        if reader.peek() != "[":
            raise reader.fault(f"{word.kind.upper()} needs an expression in brackets; add [...]")
        word.test = reader.expression()


def nested(outer: str, word: Word) -> Fault:
    return Fault(f"a subroutine inside the subroutine {outer!r}; end that one with ENDSUB first", at=word.at)


def _read_arguments(word: Word, reader: Reader) -> None:
    while reader.peek() in ("[", "("):
        if reader.peek() == "(":
            reader.at = reader.text.index(")", reader.at) + 1
            continue
        if len(word.arguments) >= ARGUMENTS:
            raise reader.fault(f"more than {ARGUMENTS} arguments; hand the rest over in parameters from #31 on")
        word.arguments.append(reader.expression())


def read_fanuc(text: str, at: int, parameters: Parameters, within: str, skipping: str) -> Word:
    """M98 P (program number) L (how often), or M99: the first word of a block. Raises Fault.

    `within` is the program that M99 ends.
    """
    match = FANUC.match(text, at)
    assert match is not None  # as the caller has seen
    word = Word(f"m9{match[1]}", at=at, spelled=f"M9{match[1]}")
    if skipping and match[1] == "8":
        return Word(at=at)
    reader = Reader(text, parameters, match.end())
    if match[1] == "9":
        word.name = within
        if not skipping:
            _check_comment(reader, "M99")
        return word
    found: dict[str, float] = {}
    while (letter := reader.peek()) in ("p", "l"):
        reader.at += 1
        if letter in found:
            raise Fault(f"two {letter.upper()} words on one line; leave one", at=reader.at - 1)
        found[letter] = reader.integer()
        if found[letter] < 0:
            raise Fault(f"{letter.upper()}{found[letter]} is negative; write a number from 0", at=reader.at - 1)
    _check_comment(reader, "M98")
    if "p" not in found:
        raise Fault("M98 without P; write the number of the program to call, M98 P1000", at=at)
    word.name, word.times = str(int(found["p"])), int(found.get("l", 1))
    return word


def _check_comment(reader: Reader, said: str) -> None:
    while reader.peek() == "(":
        reader.at = reader.text.index(")", reader.at) + 1
    if reader.peek() not in ("", ";"):
        more = " P, L and" if said == "M98" else ""
        raise reader.fault(f"only{more} a comment can follow {said}; move the rest to a line of its own")


def read_gr(text: str, at: int, parameters: Parameters) -> Word:
    """GR100 or GR<name>, with arguments in brackets: the same as O100 CALL (dcs-thesis, table 6.1)."""
    reader = Reader(text, parameters, at + 2)
    label = reader.name() if reader.peek() == "<" else str(reader.integer())
    word = Word("call", label, f"GR{label}", at)
    _read_arguments(word, reader)
    if reader.peek() not in ("", ";"):
        raise reader.fault("only arguments [...] and a comment can follow GR; move the rest to a new line")
    return word
