"""From a line of the program to the words of a block."""

from __future__ import annotations

import re

from rds.nc.language.blocks import Block
from rds.nc.language.expressions import FUNCTION, Fault, Reader
from rds.nc.language.parameters import Parameters
from rds.nc.language.unknown_words import GR_IS_OFF, no_such_letter

_BLANKS = b" \t\r"
_LOWER = bytes.maketrans(b"ABCDEFGHIJKLMNOPQRSTUVWXYZ", b"abcdefghijklmnopqrstuvwxyz")
_COMMENT = re.compile(rb"(\([^()]*\)|;.*)", re.DOTALL)
# Digits in one way only: if the point were optional by itself, a line of many words that is not plain would take hours.
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
_PLAIN = re.compile(rf"/?(?:n([0-9]+)(?:\.[0-9]+)?)?((?:[a-mp-z@^]{_NUMBER})*)")
_WORD = re.compile(rf"([a-z@^])({_NUMBER})")
_LINE_NUMBER = re.compile(r"/?(?:n([0-9]*)(\.?)([0-9]*))?")
OTHERS = frozenset("abcdefhijklpqrstxyz@^")
_DIGITS_MOST = 9
_NO_VALUE = re.compile(r"$|[(;]|[a-z][-+.0-9\[#]")  # behind a letter: nothing, a comment, or the next word
_ANYTHING = re.compile(
    rf"gr[0-9]*|(?:{FUNCTION.pattern})(?=\[)|[a-z@^]?{_NUMBER}|#(?:<[^>]*>|[0-9]+)|[\x80-\xff]+|.",
    re.DOTALL,
)


def tidy(raw: bytes) -> str:
    """The line without blanks and in lower case, as LinuxCNC reads it; comments stay as they are. Raises Fault."""
    raw = raw.rstrip()
    if b"(" not in raw and b";" not in raw:
        return raw.translate(_LOWER, _BLANKS).decode("latin-1")
    parts = _COMMENT.split(raw)
    for index in range(0, len(parts), 2):
        if b"(" in parts[index]:
            raise Fault("a comment is opened and not closed before the line's end or another (; write ( ... )", at=-2)
        parts[index] = parts[index].translate(_LOWER, _BLANKS)
    return b"".join(parts).decode("latin-1")


def columns(raw: bytes) -> list[int]:
    """Of each character of tidy(raw), which character of the line it is (from 1)."""
    found: list[int] = []
    base = 0
    for index, part in enumerate(_COMMENT.split(raw.rstrip())):
        found += [base + at + 1 for at, byte in enumerate(part) if index % 2 or byte not in _BLANKS]
        base += len(part)
    return found


def recoded(text: str) -> str:
    """Text of a program, which is read byte by byte, as it was meant: UTF-8, where it is that."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


def column_of(raw: bytes, at: int) -> int:
    """Which character of the line (from 1) character `at` of tidy(raw) is; one after the last where `at` is its end."""
    places = columns(raw)
    column = places[at] if at < len(places) else len(raw.rstrip()) + 1
    return len(raw[: column - 1].decode("utf-8", "replace")) + 1  # characters, not bytes


def line_number(text: str) -> tuple[int, int, int]:
    """Digits and value of the word N that the line begins with, and where the rest begins. Raises Fault."""
    match = _LINE_NUMBER.match(text)
    assert match is not None  # everything in it is optional
    digits, point, fraction = match[1], match[2], match[3]
    if digits is None:
        return 0, 0, match.end()
    if not digits or (point and not fraction):
        raise Fault("a line number is digits; write for example N10", at=match.start(1) - 1)
    if len(digits) > _DIGITS_MOST:
        raise Fault(f"a line number of {len(digits)} digits; write at most {_DIGITS_MOST}", at=match.start(1) - 1)
    return len(digits), int(digits), match.end()


def read_plain(text: str) -> tuple[str, list[tuple[str, str]]] | None:
    """Digits of the line number and the words of a line of letters with plain numbers; None for any other line."""
    match = _PLAIN.fullmatch(text)
    if match is None:
        return None
    return match[1] or "", _WORD.findall(match[2])


def fill(block: Block, words: list[tuple[str, str]], text: str) -> None:
    """Put the plain words of a line into a block. Raises Fault."""
    found = block.words
    letter = digits = ""
    try:
        for letter, digits in words:
            if letter == "g":
                block.add_g(float(digits))
            elif letter in "xyzijkabcr" and letter not in found:
                found[letter] = float(digits)
            elif letter == "m":
                block.add_m(float(digits))
            elif letter in OTHERS:
                block.add(letter, float(digits))
            else:
                raise Fault(no_such_letter(letter, text))
    except Fault as fault:
        fault.at = [match.start() for match in _WORD.finditer(text) if match.groups() == (letter, digits)][-1]
        fault.key = ""
        raise


def read_words(text: str, at: int, block: Block, parameters: Parameters) -> dict[str, int]:
    """Read any words, comments and parameter settings from `at` to the end into a block.

    Returns where each word begins. Raises Fault.
    """
    reader = Reader(text, parameters, at)
    places: dict[str, int] = {}
    while reader.at < len(text):
        start, letter = reader.at, text[reader.at]
        reader.at += 1
        if letter == "(":
            end = text.index(")", start)
            block.comment = text[start + 1 : end]
            reader.at = end + 1
        elif letter == ";":
            break
        elif letter == "#":
            _read_setting(reader, parameters)
        elif letter in OTHERS or letter in "gm":
            if letter == "g" and reader.peek() == "r":
                raise Fault(GR_IS_OFF, at=start)
            if _NO_VALUE.match(text, reader.at):
                word = letter.upper()
                said = f"{word} has no number; write one, as {word}2, a parameter #... or an expression [...]"
                raise Fault(said, at=start)
            value = reader.value()
            try:
                if letter == "g":
                    block.add_g(value)
                    places.setdefault(f"g{round(10 * value)}", start)
                elif letter == "m":
                    block.add_m(value)
                    places.setdefault(f"m{round(value)}", start)
                else:
                    block.add(letter, value)
                    places[letter] = start
            except Fault as fault:
                fault.at, fault.key = start, ""
                raise
        else:
            raise Fault(no_such_letter(letter, text), at=start)
    return places


def _read_setting(reader: Reader, parameters: Parameters) -> None:
    start = reader.at - 1
    try:
        name: str | int
        if reader.peek() == "<":
            name = reader.name()
            parameters.declare(name)
        else:
            name = reader.integer()
            parameters.check_settable(name)
    except Fault as fault:
        if fault.at < 0:
            fault.at = start
        raise
    reader.expect("=", "a parameter alone does nothing; set it with #... = value or use it after a letter")
    parameters.set_later(name, reader.value())


def place_of(key: str, text: str) -> int:
    """Where a word with plain numbers stands in a line; -1 when it is not found."""
    for match in _WORD.finditer(text):
        letter, value = match[1], float(match[2])
        if key in (letter, f"{letter}{round(10 * value) if letter == 'g' else round(value)}"):
            return match.start()
    return -1


def word_at(text: str, at: int) -> str:
    """The word, parameter or character that begins at `at`, as far as it is plain, in upper case."""
    match = _ANYTHING.match(text, at)
    return match[0].encode("latin-1").upper().decode("latin-1") if match else ""  # ÿ stays ÿ
