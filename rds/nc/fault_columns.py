"""Where on its line the word stands that a fault of the machine is about."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from rds.nc.language.errors import ProgramError

_COMMENT = re.compile(r"\([^)]*\)|;.*")
_LONGEST = 1000  # characters of a line that are searched; one of more than 252 is a fault as a whole
_VALUE = r"\s*(?:[-+]?\s*[\d.][\d.\s]*|[-+]?#\s*(?:<[^>]*>|\d+)|\[[^\]]*\])"


def find_word(text: str, letters: str) -> tuple[int, str]:
    """Column (from 1) and text of the first word on a line that begins with one of `letters`; (0, "") without one.

    `letters` are tried in order; a digit after a letter (`G2`) asks for that word alone. Comments are passed over.
    """
    bare = _COMMENT.sub(lambda comment: " " * len(comment[0]), text)
    for wanted in letters.split():
        pattern = wanted if len(wanted) == 1 else rf"{wanted[0]}\s*0*{wanted[1:]}(?![\d.])"
        found = re.search(pattern + (_VALUE if len(wanted) == 1 else ""), bare, re.IGNORECASE)
        if found:
            return found.start() + 1, found[0].strip()
    return 0, ""


def located_at_words(faults: Iterable[tuple[ProgramError, str]]) -> list[ProgramError]:
    """Faults with the columns and words that they are about, given the letters to look for.

    Each file is read once, line by line; where it cannot be read (a program that is no file), faults stay as they are.
    """
    faults = list(faults)
    wanted: dict[str, set[int]] = {}
    for fault, _ in faults:
        wanted.setdefault(fault.file, set()).add(fault.line)
    texts = {file: _lines(file, lines) for file, lines in wanted.items()}
    placed = []
    for fault, letters in faults:
        column, word = find_word(texts[fault.file].get(fault.line, ""), letters)
        placed.append(fault.at(fault.file, fault.line, column, word) if column else fault)
    return placed


def _lines(file: str, wanted: set[int]) -> dict[int, str]:
    if not file or not Path(file).is_file():
        return {}
    last, texts = max(wanted), {}
    with open(file, encoding="utf-8-sig", errors="replace", newline="\n") as stream:
        for number, text in enumerate(stream, start=1):
            if number in wanted:
                texts[number] = text[:_LONGEST]
            if number >= last:
                break
    return texts
