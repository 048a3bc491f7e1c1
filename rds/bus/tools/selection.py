"""Which frames of a bus or a log are meant: identifiers as users write them."""

from __future__ import annotations

from collections.abc import Iterable

import can

from rds.core.errors import InputError

Span = tuple[int, int, bool]  # first and last identifier, extended


class Selection:
    """Frames by identifier; an empty selection has all of them.

    Each text is an identifier or a range: "0x021", "0x020-0x07F", "33". An identifier above 0x7FF, or written with
    eight hexadecimal digits ("0x00000021"), is an extended one. Error frames are selected if nothing is left out.

    Raises InputError naming the text that is no identifier.
    """

    def __init__(self, texts: Iterable[str] = ()):
        self._spans = [_span(text) for text in texts]

    def __contains__(self, message: can.Message) -> bool:
        if not self._spans:
            return True
        if message.is_error_frame:
            return False
        identifier, extended = message.arbitration_id, message.is_extended_id
        return any(first <= identifier <= last and kind == extended for first, last, kind in self._spans)


def _span(text: str) -> Span:
    first_text, dash, last_text = text.partition("-")
    first, extended = _identifier(first_text, text)
    last, also = _identifier(last_text, text) if dash else (first, extended)
    if last < first:
        raise InputError(f"the range {text!r} ends before it begins; swap its ends")
    return first, last, extended or also


def _identifier(digits: str, text: str) -> tuple[int, bool]:
    digits = digits.strip()
    try:
        value = int(digits, 0)
    except ValueError:
        value = -1
    if not 0 <= value <= 0x1FFFFFFF:
        raise InputError(f"{text!r} is no identifier; write 0x021, a range as in 0x020-0x07F, or 0x00000021 (extended)")
    return value, value > 0x7FF or (digits.lower().startswith("0x") and len(digits) == 10)
