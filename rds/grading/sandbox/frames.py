"""What crosses the sandbox's wall as text: JSON of bounded size and depth, a length before it; never a pickle.

Used on both sides. What comes out of a sandbox was written by whoever wrote the submission: it is read strictly, as
numbers, texts, lists and dicts, without NaN or infinity, and nothing in it is believed.
"""

from __future__ import annotations

import json
import struct
from math import isfinite
from typing import Any

HEADER = struct.Struct("<I")  # bytes that follow
LARGEST = 1 << 20  # bytes of one frame
DEEPEST = 20  # lists and dicts inside each other
LONGEST_INTEGER = 300  # digits: it fits into a double


class FrameError(ValueError):
    """Bytes that are no frame; the text says why."""


def encode(value: Any) -> bytes:
    """`value` as a frame. FrameError if it is not of JSON's own types, is too large, or holds NaN or infinity."""
    try:
        body = json.dumps(value, allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise FrameError(str(error)) from None
    if len(body) > LARGEST:
        raise FrameError(f"it takes {len(body)} bytes, more than {LARGEST}")
    return HEADER.pack(len(body)) + body


def size(header: bytes) -> int:
    """How many bytes follow the `header`; FrameError if more than a frame may have."""
    (count,) = HEADER.unpack(header)
    if count > LARGEST:
        raise FrameError(f"a frame of {count} bytes, more than {LARGEST}")
    return int(count)


def decode(body: bytes) -> Any:
    """The value in the `body` of a frame; FrameError for anything but finite, shallow JSON."""
    try:
        value = json.loads(body.decode(), parse_constant=_no_constant, parse_float=_finite, parse_int=_integer)
        _check(value, 0)
    except (ValueError, RecursionError) as error:
        raise FrameError(f"not JSON as it is agreed: {str(error)[:100]}") from None
    return value


def _no_constant(text: str) -> Any:
    raise ValueError(f"{text} is no number")


def _finite(text: str) -> float:
    number = float(text)
    if not isfinite(number):
        raise ValueError(f"{text[:30]} is too large for a number")
    return number


def _integer(text: str) -> int:
    if len(text) > LONGEST_INTEGER:
        raise ValueError(f"an integer of {len(text)} digits is too large for a number")
    return int(text)


def _check(value: Any, depth: int) -> None:
    if depth > DEEPEST:
        raise FrameError(f"more than {DEEPEST} lists inside each other")
    if isinstance(value, list):
        for part in value:
            _check(part, depth + 1)
    elif isinstance(value, dict):
        for key, part in value.items():
            _check(key, depth)
            _check(part, depth + 1)
    elif isinstance(value, str):
        value.encode()  # ValueError for half a character, which no file could hold
