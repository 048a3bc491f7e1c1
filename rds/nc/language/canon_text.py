"""Canonical calls as text: the lines that LinuxCNC's `rs274 -g` prints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rds.nc.language.batch import Batch
from rds.nc.language.call_text import UNWRITTEN, call_text
from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE, Call, MotionBlock
from rds.nc.language.fast_lane import LONG_TEXT, LONG_TEXT_SHARED, is_loaded, kernel, stored, worth

if TYPE_CHECKING:
    from rds.nc.language.fast_lane_native import Kernels
    from rds.nc.language.motion_rows import Columns

MANY = 64  # rows that are worth writing by compiled code

_STRAIGHT = "(%.4f, %.4f, %.4f, %.4f, %.4f, %.4f)"
_ROW_FORMATS = {
    TRAVERSE: ("STRAIGHT_TRAVERSE" + _STRAIGHT, 6),
    FEED: ("STRAIGHT_FEED" + _STRAIGHT, 6),
    ARC: ("ARC_FEED(%.4f, %.4f, %.4f, %.4f, %d, %.4f, %.4f, %.4f, %.4f)", 9),
    RATE: ("SET_FEED_RATE(%.4f)", 1),
    SPEED: ("SET_SPINDLE_SPEED(0, %.4f)", 1),
}
_LINE_FORMATS = {kind: (f"%5d N..... {pattern}\n", count) for kind, (pattern, count) in _ROW_FORMATS.items()}


def _row_texts(columns: Columns) -> Iterator[tuple[str, str]]:
    rows = zip(columns.kinds, columns.digits, columns.ns, columns.value_rows(), strict=True)
    for kind, digits, n, values in rows:
        pattern, count = _ROW_FORMATS[kind]
        yield (str(n).zfill(digits) if digits else ""), pattern % tuple(values[:count])


def texts(items: Iterable[MotionBlock | Call]) -> Iterator[tuple[str, str]]:
    """Of each call, the digits of its line's word N ("" without) and its text: `SELECT_PLANE(CANON_PLANE_XY)`."""
    for item in items:
        if isinstance(item, Call):
            if item.name not in UNWRITTEN:
                yield item.n, call_text(item)
        else:
            yield from _row_texts(item.columns)


def text(items: Iterable[MotionBlock | Call | Batch]) -> Iterator[str]:
    """The lines that LinuxCNC's `rs274 -g` prints: running number, the program's line number (or N.....), the call.

    Of (PRINT, ...) it prints the text alone.
    """
    for portion in written(items):
        yield from portion[:-1].split("\n")


def written(items: Iterable[MotionBlock | Call | Batch]) -> Iterator[str]:
    """The same as text with its line breaks, in portions of some lines."""
    number = 1
    for item in items:
        if isinstance(item, Call):
            if item.name == "PRINT":
                yield f"{item.args[0]}\n"
            elif item.name not in UNWRITTEN:
                yield _line(number, item.n, call_text(item))
                number += 1
        elif (compiled := _compiled(number, item)) is not None:
            first, columns = 0, item.columns
            quoted = item.text if isinstance(item, Batch) else b""
            for count, portion in compiled.written(columns, number, quoted):
                yield portion or "".join(_lines(item, columns.part(first, first + 1), number))
                first += count
                number += count
        else:
            yield "".join(_lines(item, item.columns, number))
            number += len(item)


def _compiled(number: int, item: MotionBlock | Batch) -> Kernels | None:
    """What writes many rows at once, when loading it is worth the time: it is loaded already, or the text is long."""
    rows = len(item)
    if isinstance(item, MotionBlock) and rows < MANY:
        return None
    if is_loaded():
        return kernel()
    return stored() if number + rows > worth(LONG_TEXT, LONG_TEXT_SHARED) else None


def _lines(item: MotionBlock | Batch, columns: Columns, number: int) -> Iterator[str]:
    """Rows of an item as Python writes them, numbered from `number`."""
    if isinstance(item, MotionBlock):
        yield from _lines_of(columns, number)
        return
    for at, (n, call) in enumerate(texts(Batch(columns, item.text, item.file).parts()), start=number):
        yield _line(at, n, call)


def _lines_of(columns: Columns, number: int) -> Iterator[str]:
    """The lines of rows, numbered from `number`; of those without a word N, which most are, by one format each."""
    if any(columns.digits):
        for at, (n, row) in enumerate(_row_texts(columns), start=number):
            yield _line(at, n, row)
        return
    for kind, values in zip(columns.kinds, columns.value_rows(), strict=True):
        pattern, count = _LINE_FORMATS[kind]
        yield pattern % (number, *values[:count])
        number += 1


def _line(number: int, n: str, call: str) -> str:
    return f"{number:5d} {f'N{n:<6s}' if n else 'N..... '}{call}\n"
