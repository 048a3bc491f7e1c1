"""The groups of a DXF file, code and value line by line, and what its sections and entities are made of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import isfinite

import numpy as np

from rds.core.errors import InputError

_CODE_PAGE = re.compile(rb"\$DWGCODEPAGE\s+3\s+ANSI_([0-9]+)")
_ESCAPED = re.compile(r"\\U\+([0-9A-Fa-f]{4})")
Pairs = list[tuple[int, str]]


def sections_of(data: bytes, name: str) -> dict[str, Pairs]:
    """The groups of each section. InputError for what is no ASCII DXF, with the line."""
    return _sections(_pairs(_decoded(data), name))


def _decoded(data: bytes) -> str:
    """The text: UTF-8 since 2007, before that in the code page that the header names."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        page = _CODE_PAGE.search(data)
        try:
            text = data.decode(f"cp{page[1].decode()}" if page else "cp1252", "replace")
        except LookupError:
            text = data.decode("cp1252", "replace")
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), text).encode("utf-8", "replace").decode()  # no halves


def _pairs(text: str, name: str) -> Pairs:
    lines = re.split(r"\r\n?|\n", text)  # not splitlines(): texts may have other separators in them
    found: Pairs = []
    for k in range(0, len(lines) - 1, 2):
        code = lines[k].strip()
        if not re.fullmatch("-?[0-9]{1,5}", code):
            raise InputError(f"{code[:40]!r} is no group code; save it as ASCII DXF (R12 or later)", f"{name}:{k + 1}")
        found.append((int(code), lines[k + 1].strip()))
        if found[-1] == (0, "EOF"):
            break
    if not found:
        raise InputError("is empty; save it as ASCII DXF (R12 or later)", name)
    return found


def _sections(pairs: Pairs) -> dict[str, Pairs]:
    found: dict[str, Pairs] = {}
    current: Pairs | None = None
    for k, (code, value) in enumerate(pairs):
        if code == 0 and value == "SECTION":
            current = found.setdefault(pairs[k + 1][1] if k + 1 < len(pairs) else "", [])
        elif code == 0 and value in ("ENDSEC", "EOF"):
            current = None
        elif current is not None:
            current.append((code, value))
    return found


def entities_of(pairs: Pairs) -> Iterator[tuple[str, Pairs]]:
    kind, body = "", []  # type: str, Pairs
    for code, value in pairs:
        if code == 0:
            if kind:
                yield kind, body
            kind, body = value, []
        else:
            body.append((code, value))
    if kind:
        yield kind, body


def clips_of(objects: Pairs) -> set[str]:
    """Handles of the dictionaries that lead to a clip in force (XCLIP): an insert that has one of them is clipped."""
    clips: set[str] = set()
    leads: dict[str, set[str]] = {}
    for kind, body in entities_of(objects):
        if kind == "SPATIAL_FILTER" and number_of(body, 71, 1.0):
            clips.add(text_of(body, 5))
        elif kind == "DICTIONARY":
            leads[text_of(body, 5)] = {value for code, value in body if code in (350, 360)}
    for _ in range(2):  # the insert's dictionary names that of its filters, which names the clip
        clips |= {handle for handle, to in leads.items() if to & clips}
    return clips


def text_of(body: Pairs, code: int, default: str = "") -> str:
    return next((value for key, value in body if key == code), default)


def number_of(body: Pairs, code: int, default: float = 0.0) -> float:
    text = text_of(body, code)
    return value_of(code, text) if text else default


def value_of(code: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"group {code} of a DXF entity is {text[:40]!r}, not a number; save the drawing again")
    return value


def numbers_of(body: Pairs, code: int) -> list[float]:
    return [value_of(code, value) for key, value in body if key == code]


def places_of(body: Pairs, code: int) -> np.ndarray:
    """The places x, y in the groups `code` and `code` + 10; none where there are not as many of both."""
    x, y = numbers_of(body, code), numbers_of(body, code + 10)
    return np.column_stack((x, y)) if len(x) == len(y) else np.empty((0, 2))
