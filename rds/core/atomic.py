"""Files that are either whole or not there, and that only their user can read (see `core.private_files`)."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, cast

from rds.core.errors import InputError
from rds.core.private_files import make_folder, open_private

_HEAD = 2000  # bytes


def write_files(contents: Mapping[Path, bytes | Callable[[BinaryIO], None]]) -> None:
    """Write bytes to their paths, or let a writer fill the file there; the files appear complete, together, or not at
    all.

    Each is written to a temporary file beside its place and synced; only when all are on disk do they take
    their names. A failure or a kill before that leaves what was there before. Missing directories are made.
    Raises InputError where the system refuses to write.
    """
    staged: dict[Path, Path] = {}
    path = Path()
    try:
        for path, content in contents.items():
            make_folder(path.parent)
            temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.part")
            with cast(BinaryIO, open_private(temporary, "xb")) as stream:
                staged[path] = temporary
                if isinstance(content, bytes):
                    stream.write(content)
                else:
                    content(stream)
                stream.flush()
                os.fsync(stream.fileno())
        for path, temporary in staged.items():
            os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"cannot write: {error.strerror or error}; choose a place that can be written to", str(path)
        ) from error
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)
    for directory in {path.parent for path in staged}:
        _sync_directory(directory)


def write_whole(path: Path, data: bytes) -> Path:
    """Write one file so that it appears complete or not at all; see `write_files`. Returns its path."""
    write_files({path: data})
    return path


def keep_another(path: Path, mark: str, what: str) -> None:
    """InputError if what is at `path` would be lost, as it is no `what`: those have `mark` in their first lines."""
    try:
        with open(path, "rb") as stream:
            head = stream.read(_HEAD)
    except OSError:  # there is none, or writing tells
        return
    if head.strip() and mark.encode() not in head:
        raise InputError(f"is there already, and is no {what}; choose another name, or remove it", str(path))


def _sync_directory(directory: Path) -> None:
    if os.name != "posix":
        return  # Windows does not open directories; its rename is durable enough for a result
    handle = os.open(directory, os.O_RDONLY)
    try:
        with suppress(OSError):  # the files are there, and some disks, as of a network, do this by themselves
            os.fsync(handle)
    finally:
        os.close(handle)
