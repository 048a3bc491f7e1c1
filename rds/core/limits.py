"""Limits on what a file may cost to read: a small file can be made to fill the memory, or to keep a reader busy.

Every reader has its own limits and says them in one way. The environment variable RDS_FILE_LIMITS multiplies them all,
for a file that is to be trusted.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from rds.core.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

LIFT = "RDS_FILE_LIMITS"
_MOST_LIFTED = 1e6
UNPACKED = 1 << 30  # bytes of numbers that one file is unpacked to: 2^27 values
_UNSUSPECTED = 1 << 28  # bytes that any file may be unpacked to, however small it is
PACKED = 200  # times that a recording is packed at most; its times alone hardly pack
LINE = 1 << 20  # bytes of a line of text: a row of a thousand columns has some ten thousand
DESCRIPTION = 16 << 20  # bytes of a text (JSON, parameters, points) that is read whole
TABLE = 64 << 20  # bytes of a text table that is read whole


def lifted() -> float:
    """By how much the limits are multiplied: 1 unless RDS_FILE_LIMITS says more. InputError where that is no number."""
    said = os.environ.get(LIFT, "").strip() or "1"
    try:
        factor = float(said)
    except ValueError:
        factor = math.nan
    if not 1.0 <= factor <= _MOST_LIFTED:  # false for NaN too
        raise InputError(
            f"{LIFT}={said[:40]!r} must be a number from 1 to {_MOST_LIFTED:g}, by which the limits on files are "
            "multiplied; correct or unset it"
        )
    return factor


def allow(value: float, most: float, what: str, remedy: str, where: str | Path | None = None) -> None:
    """InputError if `value` is above the limit `most`, lifted as the user said.

    `what` says the value: "it has 5 bytes". The message goes on with the limit, the remedy, and how that is lifted.
    """
    factor = lifted()
    if value > most * factor:
        raise refusal(what, most, remedy, value / most, where)


def refusal(
    what: str, most: float, remedy: str, times: float | None = None, where: str | Path | None = None
) -> InputError:
    """The error that a limit is exceeded, `times` as far as is known; the limit is said as it is now, lifted or not."""
    factor = lifted()
    needed = 2.0 * factor if times is None else max(times, factor)
    lift = f"or set {LIFT}={math.ceil(needed)} if you trust the file" if needed <= _MOST_LIFTED else "it cannot be read"
    return InputError(
        f"{what}; the limit is {most * factor:.10g}: {remedy}, {lift}", None if where is None else str(where)
    )


def allow_unpacked(size: float, packed: int, where: str | Path | None = None, counting: bool = False) -> None:
    """InputError if a file of `packed` bytes unpacks to more than is read, or to so much more that it is a bomb.

    `counting`: it unpacks to `size` so far, and was not read on.
    """
    more = " or more" if counting else ""
    remedy = "save time, command and position only"
    allow(size, UNPACKED, f"what it holds takes {size:.10g} bytes{more} in memory", remedy, where)
    if size > _UNSUSPECTED * lifted():
        times = size / max(packed, 1)
        what = f"its {packed} bytes unpack to {size:.10g}{more}, {times:.0f} times as many, as files made to do harm do"
        allow(times, PACKED, what, "take another copy", where)


def most_unpacked(packed: int) -> float:
    """Bytes that a file of `packed` bytes is unpacked to at most."""
    return min(UNPACKED, max(_UNSUSPECTED, PACKED * packed)) * lifted()


def read_limited(path: str | Path, most: int, what: str, remedy: str) -> bytes:
    """The bytes of a file. InputError if there are more than `most`, of which no more are read; OSError as always.

    `what` is what the file should be: "a parameter file".
    """
    limit = int(most * lifted())
    with open(os.fspath(path), "rb") as stream:  # for a number, open takes what has it, and closes that in the end
        data = stream.read(limit + 1)
        if len(data) > limit:
            size = max(os.fstat(stream.fileno()).st_size, limit + 1)  # a device has none
            raise refusal(f"it has {size} bytes, too many for {what}", most, remedy, size / most, path)
    return data
