"""The files below a folder. No link is followed, and nothing but regular files is ever opened."""

from __future__ import annotations

import errno
import os
import stat
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rds.core.errors import InputError
from rds.grading.intake.items import CODE, DEEPEST, MOST_FILES, Item, Refusal, Unreadable, faulty, is_clutter, refusal
from rds.grading.intake.names import shown
from rds.grading.sandbox.submission import UNFOLLOWED

_NOT_FOR_US = {errno.EACCES, errno.EPERM, errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.EMFILE, errno.ENFILE}
_REMEDY = "who grades must be able to read it; then go on with --resume"
_KINDS = {
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe (FIFO)",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def files_below(folder: Path) -> tuple[list[Item], list[str]]:
    """All files below `folder` in the order of their names, and the names of the folders just below it."""
    found: list[Item] = []
    for item in _walk(folder, (), folder):
        found.append(item)
        if len(found) > MOST_FILES:
            largest, count = Counter(item.parts[0] for item in found).most_common(1)[0]
            raise InputError(
                f"holds more than {MOST_FILES} files, {count} of them in {shown(largest)}; move that one away, or name "
                "the folder of the submissions",
                str(folder),
            )
    with os.scandir(folder) as entries:
        folders = sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))
    return found, [name for name in folders if not is_clutter((name,)) and not _looks_like_code(name)]


def read_regular(path: str | Path, most: int, within: Path | None = None) -> bytes:
    """At most `most` bytes of a regular file; Refusal for anything else, Unreadable where the computer is at fault.

    No link is followed, neither the file's own name nor a folder below `within`.
    """
    try:
        descriptor = _opened(path, within)
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise _fault("it cannot be opened", said, isinstance(error, OSError) and error.errno in _NOT_FOR_US) from None
    with os.fdopen(descriptor, "rb") as file:
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise Refusal("it is not a regular file; hand in one Python file or notebook")
        if about.st_nlink > 1:  # whose it is, and what it will hold tomorrow, another name decides
            raise Refusal("it is a hard link to another file; copy the files without links (cp --no-preserve=links)")
        try:
            data = file.read(most + 1)
        except OSError as error:
            raise Unreadable(f"it cannot be read: {error.strerror}; {_REMEDY}") from None
    if len(data) > most:
        raise Refusal(f"it has more than {most} bytes; keep data out of it")
    return data


def _opened(path: str | Path, within: Path | None) -> int:
    """The descriptor. Folders are opened one by one: their owner may put a link in the place of one that was seen."""
    if within is None or os.open not in os.supports_dir_fd:
        return os.open(path, UNFOLLOWED)
    *folders, name = Path(path).relative_to(within).parts
    at = os.open(within, os.O_RDONLY)
    try:
        for each in folders:
            inner = os.open(each, UNFOLLOWED, dir_fd=at)
            os.close(at)
            at = inner
        return os.open(name, UNFOLLOWED, dir_fd=at)
    finally:
        os.close(at)


def _fault(what: str, said: str | None, is_unreadable: bool) -> Refusal:
    return refusal(f"{what}: {said}; {_REMEDY}" if is_unreadable else f"{what}: {said}", is_unreadable)


def _walk(folder: Path, parts: tuple[str, ...], root: Path) -> Iterator[Item]:
    try:
        with os.scandir(folder) as entries:
            names = sorted(entries, key=lambda entry: os.fsencode(entry.name))
    except OSError as error:
        if not parts:
            raise InputError(f"cannot be read: {error.strerror}; check the path", str(folder)) from error
        yield faulty(parts, f"its folder cannot be opened: {error.strerror}; {_REMEDY}", is_unreadable=True)
        return
    for entry in names:
        inner = (*parts, entry.name)
        if is_clutter(inner):
            continue
        try:
            about = entry.stat(follow_symlinks=False)
        except OSError as error:
            yield faulty(inner, f"it cannot be looked at: {error.strerror}")
            continue
        if stat.S_ISDIR(about.st_mode):
            if _looks_like_code(entry.name):
                yield faulty(inner, "it is a folder that is called like a file; hand in one Python file or notebook")
            elif len(inner) > DEEPEST:
                yield faulty(inner, f"it lies more than {DEEPEST} folders deep")
            else:
                yield from _walk(Path(entry.path), inner, root)
        elif stat.S_ISREG(about.st_mode):
            yield Item(inner, partial(read_regular, entry.path, within=root))  # its date is whoever copied it's
        else:
            kind = _KINDS.get(stat.S_IFMT(about.st_mode), "no regular file")
            yield faulty(inner, f"it is {kind}; hand in one Python file or notebook")


def _looks_like_code(name: str) -> bool:
    return name.lower().endswith(CODE)
