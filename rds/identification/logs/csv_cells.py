"""The cells of a text table: how a line is cut into them, and which are numbers, dates, blanks or remarks."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from pathlib import Path

from rds.core.limits import LINE

COMMENTS = ("#", "%", "//", "!")
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": " "}
BLANKS = frozenset(
    (
        *("", "nan", "+nan", "-nan", "na", "n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf"),
        *("∞", "-∞", "+∞", "over", "ol", "err", "error", "bad"),  # of meters and oscilloscopes, beyond their range
        *("#n/a", "#div/0!", "#value!", "#num!", "#ref!"),  # of spreadsheets
        *("-1.#ind", "1.#qnan", "1.#inf", "-1.#inf", "-nan(ind)", "nan(ind)"),  # of C on Windows
    )
)
# before each line that a terminal shows: `16:20:01.123 -> ` of the Arduino IDE, `[2024-01-01 16:20:01.123] ` of others
_DAY = r"(?:\d{4}-\d\d-\d\d[ T]|\w{3} \w{3} [ \d]\d )?"
_STAMP = re.compile(rf"\[?{_DAY}\d\d:\d\d:\d\d(?:[.,]\d+)?(?: \d{{4}})?\]?\s*(?:->|>)?\s+")
_WITH_UNIT = re.compile(r"(?!0[xX])[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?\s*([^\W\d_]|[°%]){1,4}(/[^\W\d_]{1,3})?")
_FORTRAN = re.compile(r"[+-]?\d+\.\d*[dD][+-]\d{2,3}")
_BLOCK = 1 << 22  # bytes


def not_in_utf_8(path: Path) -> tuple[int, bytes] | None:
    """Number and bytes of the first line that is not in UTF-8, but for a last one without its end; None for none."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with open(path, "rb") as stream:
        try:
            while block := stream.read(_BLOCK):
                decoder.decode(block)
            return None
        except UnicodeDecodeError:
            stream.seek(0)
        for number, line in enumerate(iter(lambda: stream.readline(LINE), b""), 1):
            try:
                line.decode()
            except UnicodeDecodeError:
                return (number, line) if line.endswith(b"\n") else None
    return None


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without blanks around them."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    return [cell.strip() for cell in line.split(delimiter)]


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number; neither NaN nor infinity is."""
    if decimal != ".":
        if "." in cell:
            return False
        cell = cell.replace(decimal, ".")
    try:
        float(cell)
    except ValueError:
        if not _FORTRAN.fullmatch(cell):
            return False
    return cell.lower() not in BLANKS and "_" not in cell and cell.isascii()  # Arrow knows no digits of other scripts


def has_unit(cell: str) -> bool:
    """Whether a cell is a number with its unit behind it: `2.0 V`, `20 %`."""
    return _WITH_UNIT.fullmatch(cell) is not None


def stamped(rows: Sequence[Sequence[str]], decimal: str) -> str:
    """The time stamp that stands before the number in the first cell of every row; "" where one has none."""
    found = [_STAMP.match(row[0]) for row in rows]
    if all(stamp and is_number(row[0][stamp.end() :], decimal) for stamp, row in zip(found, rows, strict=True)):
        return next((stamp[0] for stamp in found if stamp), "")
    return ""


def are_numbers(cells: Sequence[str]) -> bool:
    """Whether there are two cells or more, and each is a number with a point or a comma in it, or without."""
    return len(cells) > 1 and all(is_number(cell.strip(), ",") or is_number(cell.strip(), ".") for cell in cells)


def is_comment(line: str) -> bool:
    """Whether a line is a remark, and not a row."""
    return line.lstrip().startswith(COMMENTS)


def decoded(data: bytes) -> str:
    """The text, of whichever coding: UTF-8 or 16 by its mark, else Windows' code page 1252 where it is no UTF-8."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")
