"""Dates, times of day and exponents as recorders write them, in the one form that Arrow reads.

Only forms that can mean one thing are turned. `03/04/2024` may be of March or April: it is taken for the American date,
and the reader refuses a log of more than two days. Within one day the order does not matter, and at midnight the other
order would be a month off. `13/04/2024` can be of April alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rds.identification.logs.csv_cells import split

_MONTHS = (b"jan", b"feb", b"mar", b"apr", b"may", b"jun", b"jul", b"aug", b"sep", b"oct", b"nov", b"dec")
_MONTH = rb"(" + b"|".join(_MONTHS) + rb")[a-z]{0,6}"
_CLOCK_FOLLOWS = rb"(?=\d{1,2}:\d\d)"
# an American date, which may be another's of the other order
_AMERICAN = re.compile(rb"(?<![\d/.])(\d{1,2})/(\d{1,2})/(\d{4}),?[T ]" + _CLOCK_FOLLOWS)

# both in the form that `uniform_cell` gives
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(?P<zone>Z|[+-]\d\d:?\d\d)?")
CLOCK = re.compile(r"\d\d:\d\d:\d\d(\.\d{1,9})?")  # a time of day


class _Rule(NamedTuple):
    find: re.Pattern[bytes]
    into: bytes | Callable[[re.Match[bytes]], bytes]
    is_short: bool = False  # of days and hours without zeros, which a log may come to after midnight


def _day(year: bytes, month: int, day: bytes) -> bytes:
    return b"%s-%02d-%02d " % (year, month, int(day))


def _month(name: bytes) -> int:
    return _MONTHS.index(name.lower()) + 1


def _slashed(found: re.Match[bytes]) -> bytes:
    month, day = sorted((found[1], found[2]), key=int) if int(found[1]) > 12 else (found[1], found[2])
    return _day(found[3], int(month), day) if int(month) <= 12 else found[0]  # no date: left as it is, which is refused


def _of_24_hours(found: re.Match[bytes]) -> bytes:
    hour, rest, half = found.groups()
    if not 1 <= int(hour) <= 12:
        return found[0]  # no hour of half a day: left as it is, which is refused
    return b"%02d%s" % (int(hour) % 12 + 12 * (half in b"pP"), rest)


_RULES = (
    _Rule(
        re.compile(rb"(?<![\d.])(\d\d)\.(\d\d)\.(\d{4})[T ](?=\d\d:\d\d)"), rb"\3-\2-\1 "
    ),  # the day is first, always
    _Rule(re.compile(rb"(?<![\d/])(\d{4})/(\d\d)/(\d\d)(?=[T ]\d\d:\d\d)"), rb"\1-\2-\3"),  # of Japanese controls
    _Rule(  # without zeros, or with another sign before the time
        re.compile(
            rb"(?<![\d/-])(?!\d{4}-\d\d-\d\d[T ])(\d{4})([-/])(\d{1,2})\2(\d{1,2})[T ._]" + _CLOCK_FOLLOWS,
        ),
        lambda m: _day(m[1], int(m[3]), m[4]),
        is_short=True,
    ),
    _Rule(
        re.compile(rb"(?<![\d.])(\d{1,2})\.(\d{1,2})\.(\d{4}),?[T ]" + _CLOCK_FOLLOWS),
        lambda m: _day(m[3], int(m[2]), m[1]),
        is_short=True,
    ),
    _Rule(  # MATLAB's 01-Mar-2024, and 1 March 2024
        re.compile(rb"(?<![\w.])(\d{1,2})[- ]" + _MONTH + rb"[- ](\d{4}),?[T ]" + _CLOCK_FOLLOWS, re.IGNORECASE),
        lambda m: _day(m[3], _month(m[2]), m[1]),
    ),
    _Rule(  # Mar 1 2024, March 1, 2024
        re.compile(rb"(?<!\w)" + _MONTH + rb"\.? {1,2}(\d{1,2}),? (\d{4}),?[T ]" + _CLOCK_FOLLOWS, re.IGNORECASE),
        lambda m: _day(m[3], _month(m[1]), m[2]),
    ),
    _Rule(_AMERICAN, _slashed),
    # a colon before milliseconds or microseconds; of two digits they may be frames of a film
    _Rule(re.compile(rb"(?<![\d:])(\d{1,2}:\d\d:\d\d):(\d{6}|\d{3})(?![\d:])"), rb"\1.\2"),
    _Rule(
        re.compile(rb"(?<![\d:])(\d{1,2})(:\d\d(?::\d\d(?:\.\d{1,9})?)?) ?([ap])\.?m\b\.?", re.IGNORECASE),
        _of_24_hours,
    ),
    _Rule(re.compile(rb"(?<![\d:.])(\d:\d\d:\d\d)(?![\d:])"), rb"0\1", is_short=True),
    # the exponents of Fortran's double precision; 1D5 may be a number to the base of 16
    _Rule(re.compile(rb"(?<=\d)([.,]\d*)[dD]([+-]\d{2,3})(?![\w.])"), rb"\1E\2"),
)
_COMMA_TIME = _Rule(re.compile(rb"(?<!\d)(\d{1,2}:\d\d:\d\d),(\d)"), rb"\1.\2")


def rules(sample: bytes, delimiter: str, short: bool = False) -> Sequence[_Rule]:
    """The rules that change something in the first rows of a file; the others are not worth their time.

    A rule that joins cells is none for this file: there date, time and PM stand in columns of their own.
    short: those of days and hours without zeros too, as 0:00:00 after a head of 23:59:59.
    """
    every = _RULES if delimiter == "," else (_COMMA_TIME, *_RULES)  # else 12:00:00,5 is a time and a five
    found = []
    for rule in every:
        turned = rule.find.sub(rule.into, sample)
        is_of_use = turned != sample or (short and rule.is_short)
        if is_of_use and _widths(turned, delimiter) == _widths(sample, delimiter):
            found.append(rule)
            sample = turned
    return found


def _widths(rows: bytes, delimiter: str) -> list[int]:
    return [len(split(line, delimiter)) for line in rows.decode("latin-1").split("\n")]


def uniform(data: bytes, by: Sequence[_Rule]) -> bytes:
    """The text with its dates as 2024-03-01, its times of day as 14:00:00.5, its exponents as 1.0E+02."""
    for rule in by:
        data = rule.find.sub(rule.into, data)
    return data


def uniform_cell(cell: str) -> str:
    """A cell in the form that `uniform` gives it."""
    return uniform(cell.encode(), (_COMMA_TIME, *_RULES)).decode() if ":" in cell or "d" in cell.lower() else cell


def is_american(cell: str) -> bool:
    """Whether a date may be of the third of April or of the fourth of March."""
    return _AMERICAN.match(cell.encode()) is not None


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date with a time of day, or a time of day alone."""
    if ":" not in cell:
        return False
    same = uniform_cell(cell)
    return bool(DATE.fullmatch(same) or CLOCK.fullmatch(same))
