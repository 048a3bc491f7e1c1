"""Names that others chose: made printable, and made safe as names of folders."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Collection

_PLAIN = re.compile(r"[a-z0-9][a-z0-9_-]{0,59}")
_AGAIN = re.compile(r"(?P<stem>.+?)(?:-(?P<dash>\d{1,4})| ?\((?P<paren>\d{1,4})\))(?P<end>\.\w+)", re.DOTALL)
_RESERVED = re.compile(r"con|prn|aux|nul|com\d|lpt\d")  # that Windows keeps for devices
_ESCAPED = frozenset("\\\u115f\u1160\u2800\u3164\uffa0")  # the backslash, and what leaves white paper
_LONGEST = 200  # characters of an identifier that is shown


def shown(name: str) -> str:
    """`name` in printable characters on one line; different names stay different.

    What is not printable (control characters, marks that turn the direction of writing, bytes that are no text), or
    leaves no mark, is written as Python writes it, and so is the backslash itself.
    """
    text = "".join(each if each.isprintable() and each not in _ESCAPED else _escaped(each) for each in name)
    text = text if text.strip() else text.replace(" ", "\\x20")
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - 20]}…{_digest(name)}"


def safe_id(student: str) -> str:
    """A name of a folder for `student`, on any file system: the same each time, and another for every student.

    Short lower-case names are themselves; others are made of what they hold of that, with `~` and 16 hex digits of
    their hash behind. No name that is itself holds a `~`.
    """
    if _PLAIN.fullmatch(student) and not _RESERVED.fullmatch(student):
        return student
    kept = re.sub(r"[^a-z0-9_]+", "-", student.lower()).strip("-")[:40]
    return f"{kept}~{_digest(student)}"


def without_number(name: str, accepted: Collection[str]) -> tuple[str, int]:
    """A file's name without the number that a platform or browser puts behind it, and the number.

    The number of a name in `accepted` (`task-2.py`) is its own.
    """
    found = None if name in accepted else _AGAIN.fullmatch(name)
    return (name, 0) if found is None else (found["stem"] + found["end"], int(found["dash"] or found["paren"]))


def letters(name: str) -> str:
    """A name without what is written differently here and there: spaces, commas, capitals."""
    return "".join(each for each in compared(name) if each.isalnum())


def compared(text: str) -> str:
    """Without capitals, and with accents in the letters: a Mac keeps them apart in the names of files."""
    return unicodedata.normalize("NFC", text).strip().casefold()


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]
