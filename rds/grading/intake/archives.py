"""The files in a zip: listed, and read one by one up to a limit. Nothing is ever extracted to a disk."""

from __future__ import annotations

import io
import stat
import zipfile
import zlib
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import IO

from rds.core.errors import InputError
from rds.grading.intake.items import ARCHIVE, CODE, DEEPEST, MOST_FILES, Item, Refusal, faulty, is_clutter

LARGEST_OWN = 4 << 20  # bytes of a zip that a student hands in
MOST_OWN = 200  # files in it
LARGEST_RATIO = 200.0  # unpacked to packed; text packs ten times
_RATIO_COUNTS_FROM = 1 << 20  # bytes; small files of blanks pack as well

_Broken = (zipfile.BadZipFile, OSError, ValueError, EOFError, NotImplementedError, zlib.error, OverflowError)


def files_in(path: Path) -> tuple[list[Item], list[str]]:
    """The files of an exported zip in the order of their names, and the names of its outermost folders.

    InputError if it is not a zip.
    """
    try:
        archive = zipfile.ZipFile(path)
    except _Broken as error:
        raise InputError(f"is not a zip that can be read ({error}); export it once more", str(path)) from error
    entries = archive.infolist()
    if len(entries) > MOST_FILES:
        raise InputError(f"holds more than {MOST_FILES} files", str(path))
    return _items(archive, entries)


def files_in_own(item: Item) -> list[Item]:
    """The files of a zip that a student handed in. Refusal if it cannot be read, is a bomb, or holds further zips."""
    data = item.read(LARGEST_OWN)
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except _Broken as error:
        raise Refusal(f"it is not a zip that can be read ({error})") from None
    entries = [entry for entry in archive.infolist() if not is_clutter(_parts(entry))]
    if len(entries) > MOST_OWN:
        raise Refusal(f"its zip holds {len(entries)} files, more than {MOST_OWN}; hand in one Python file or notebook")
    unpacked = sum(
        entry.file_size for entry in entries if entry.filename.lower().endswith(CODE)
    )  # nothing else is read
    if unpacked > max(LARGEST_RATIO * len(data), _RATIO_COUNTS_FROM):
        raise Refusal(f"its zip of {len(data)} bytes says that it unpacks to {unpacked}; hand in one Python file")
    items, _ = _items(archive, entries)
    if any(each.name.lower().endswith(ARCHIVE) for each in items):
        raise Refusal("its zip holds another zip; hand in one Python file or notebook")
    return [Item(each.parts, each.read, item.time, each.fault) for each in items]  # times inside are the student's word


def _items(archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo]) -> tuple[list[Item], list[str]]:
    found: list[Item] = []
    folders: set[str] = set()
    seen: set[tuple[str, ...]] = set()
    for entry in sorted(entries, key=lambda entry: entry.filename):
        name, parts = entry.filename.replace("\\", "/"), _parts(entry)
        if not parts or is_clutter(parts[:1]):
            continue
        if _leads_out(name, parts):
            found.append(faulty((name,), "its name leads out of the zip"))
            continue
        if entry.is_dir() or len(parts) > 1:
            folders.add(parts[0])  # whatever is in it: it is a student's
        if entry.is_dir() or is_clutter(parts):
            continue
        if fault := _fault(entry, parts, seen):
            found.append(faulty(parts, fault))
        else:
            found.append(Item(parts, partial(_read, archive, entry), _time(entry)))
        seen.add(parts)
    return found, sorted(folders)


def _parts(entry: zipfile.ZipInfo) -> tuple[str, ...]:
    return tuple(part for part in entry.filename.replace("\\", "/").split("/") if part not in ("", "."))


def _leads_out(name: str, parts: tuple[str, ...]) -> bool:
    return ".." in parts or name.startswith("/") or (len(parts[0]) == 2 and parts[0][1] == ":")


def _fault(entry: zipfile.ZipInfo, parts: tuple[str, ...], seen: set[tuple[str, ...]]) -> str:
    mode = entry.external_attr >> 16
    if stat.S_IFMT(mode) not in (0, stat.S_IFREG):
        return "it is a link or a device in the zip; hand in one Python file or notebook"
    if entry.flag_bits & 1:
        return "it is encrypted"
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "it is packed in an unusual way; pack it with deflate"  # others ask for as much memory as they say
    if parts in seen:
        return "the zip holds two files of this name"
    return f"it lies more than {DEEPEST} folders deep" if len(parts) > DEEPEST else ""


def _read(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, most: int) -> bytes:
    """Unpacked as far as `most` bytes, whatever the entry says of its size."""
    try:
        stream: IO[bytes]
        with archive.open(entry) as stream:
            data = stream.read(most + 1)
    except (*_Broken, RuntimeError) as error:
        raise Refusal(f"it cannot be unpacked: {error}") from None
    if len(data) > most:
        raise Refusal(f"it unpacks to more than {most} bytes; keep data out of it")
    return data


def _time(entry: zipfile.ZipInfo) -> datetime | None:
    """A zip's times have no time zone, and steps of two seconds."""
    try:
        return datetime(*entry.date_time)
    except ValueError:
        return None
