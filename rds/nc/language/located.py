"""Faults of blocks as errors of the program: with file, line, column and word."""

from __future__ import annotations

import re
from collections.abc import Mapping

from rds.nc.language.blocks import AXES
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.source import Source
from rds.nc.language.unknown_words import OLD_LINE_ENDS, other_language
from rds.nc.language.words import column_of, place_of, recoded, word_at

_SCRIPT = re.compile(r"(?:n[0-9]+)?(rf[0-9]|build)")
_NO_SCRIPT = "a configuration script stands at the program's head, before its first block; move this line there"
_SCRIPT_IS_OFF = "this is a line of a configuration script; read the program with the option ncc (--with ncc)"


def as_it_is_meant(fault: Fault, raw: bytes, text: str, options: Dialect) -> Fault:
    """The fault of a line `raw`, which is `text`; where it is of another language, told by its name."""
    if _SCRIPT.match(text):
        return Fault(_NO_SCRIPT if options.ncc else _SCRIPT_IS_OFF)  # of the line: its words mean nothing here
    if said := other_language(text):
        return Fault(said)
    return Fault(OLD_LINE_ENDS) if b"\r" in raw.strip() else fault


def place_in(key: str, text: str, places: Mapping[str, int]) -> int:
    """Where a word of a block stands in its text; -1 when it has none. `places`: of words that have been read."""
    place = places.get(key, -1)
    if place >= 0:
        return place
    return text.find("(") if key == "(" else place_of(key, text)


def located(
    fault: Fault, raw: bytes, text: str, places: Mapping[str, int], source: Source, motion: int
) -> ProgramError:
    """The fault with file, line, column and word. `motion`: the G word of motion in force, times ten."""
    at, message, word = fault.at, fault.message, ""
    if fault.key:
        at = place_in(fault.key, text, places)
        if at < 0 and fault.key == f"g{motion}":  # of a motion that an earlier line has set
            message = f"G{motion / 10:g} is still in force: {message}"
            at = min((place for axis in AXES if (place := place_in(axis, text, places)) >= 0), default=-1)
    column = 0
    if at == -2:
        column = len(raw[: raw.rfind(b"(")].decode("utf-8", "replace")) + 1 + source.column
        word = "("
    elif at >= 0 and text:
        column = column_of(raw, at) + source.column
        word = word_at(text, at).encode("latin-1").decode("utf-8", "replace")
    return ProgramError(recoded(message), file=source.name, line=source.line, column=column, word=word)
