"""The compiled program: machine motion on disk, beside the part program it was made of (oacs-thesis 7.3: a .dat file).

The file, format 2 (docs/part-programs.md): the line `RDS compiled part program 2`; a line of JSON, the header, which
names everything the motion depends on with its SHA-256; then of each block a line of JSON (`segments`: how many,
`file`, `tool`, `events`: [after, kind, value, line] each), its segments as they are in memory, records of dtype SEGMENT
in little-endian byte order, and their feed lines (int32 each); last a line of JSON with `"end": true` and the number of
blocks and segments, and the SHA-256 of all bytes before it as 64 characters, 64 more that only who has the user's own
key could write (HMAC of that SHA-256), and a line feed.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rds.core.errors import InputError
from rds.core.private_files import make_folder, state_folder, write_private
from rds.interpolators.motion.segments import SEGMENT
from rds.nc.path_block import Event, PathBlock

MAGIC = b"RDS compiled part program 2\n"
_STORED = SEGMENT.newbyteorder("<")
_LINES = np.dtype("<i4")
_DIGEST, _SEAL = 64, 64  # characters at the end, before a line feed
_END = _DIGEST + _SEAL + 1
_KEY = 32  # bytes
_CHUNK = 1 << 20
_LONGEST_LAST = 1 << 16  # bytes of the last line, which names the tools and has notes
_AGAIN = "compile it again with `rds nc check`"


def beside(program: Path) -> Path:
    """Where the compiled form of a program is: part.dat for part.ngc. InputError for a program that is called so."""
    if program.suffix.lower() == ".dat":
        raise InputError("the compiled form of a part program gets the name .dat; rename the program", str(program))
    return program.with_suffix(".dat")


def is_ours(path: Path) -> bool:
    """Whether a file is a compiled program, of whatever format, and no data of someone else."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(MAGIC) - 2) == MAGIC[:-2]


def file_sha256(path: Path) -> str:
    """Of a file's bytes. InputError when it can't be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); check the path", str(path)) from error


def write_compiled(
    header: Mapping[str, Any], blocks: Iterable[PathBlock], after: Callable[[], Mapping[str, Any]] = dict
) -> Callable[[BinaryIO], None]:
    """A writer for `rds.core.atomic.write_files`: the blocks, as they come, into a stream.

    `after`, asked when all blocks have passed, gives more words for the last line.
    """

    def write(stream: BinaryIO) -> None:
        digest = hashlib.sha256()

        def put(data: bytes) -> None:
            digest.update(data)
            stream.write(data)

        put(MAGIC)
        put(_line(header))
        count = segments = 0
        for block in blocks:
            head = {"segments": len(block), "file": block.file, "tool": block.tool, "events": block.events}
            put(_line(head))
            put(block.segments.astype(_STORED).tobytes())
            put(block.feed_lines.astype(_LINES).tobytes())
            count += 1
            segments += len(block)
        put(_line({"end": True, "blocks": count, "segments": segments, **after()}))
        found = digest.hexdigest()
        stream.write(f"{found}{_seal(found)}\n".encode())

    return write


def _seal(digest: str) -> str:
    return hmac.new(_own_key(), digest.encode(), hashlib.sha256).hexdigest()


def _own_key() -> bytes:
    """The user's, made when it is first asked for. Where it cannot be kept, another one each time: nothing is known."""
    place, made = state_folder() / "compiled.key", secrets.token_bytes(_KEY)
    try:
        with place.open("rb") as stream:
            key = stream.read(_KEY + 1)
            is_own = not hasattr(os, "getuid") or os.fstat(stream.fileno()).st_uid == os.getuid()
        if len(key) == _KEY or not is_own:
            return key if is_own else made
    except FileNotFoundError:
        pass
    except OSError:
        return made
    with suppress(OSError):
        make_folder(place.parent)
        write_private(place, made, is_own=True)
    return made


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode() + b"\n"


@dataclass(frozen=True)
class Compiled:
    """A compiled program, whole: its bytes have the checksum at its end. `trailer` is its last line.

    `is_own`: whether this user's rds has made it, and nobody else.
    """

    path: Path
    header: Mapping[str, Any]
    trailer: Mapping[str, Any]
    is_own: bool = False

    def blocks(self) -> Iterator[PathBlock]:
        """Its motion, block by block, read as it goes."""
        with self.path.open("rb") as stream:
            stream.readline()
            stream.readline()
            while not (head := json.loads(stream.readline())).get("end"):
                count = head["segments"]
                segments = np.frombuffer(stream.read(count * _STORED.itemsize), _STORED).astype(SEGMENT)
                feed_lines = np.frombuffer(stream.read(count * _LINES.itemsize), _LINES).astype(np.int32)
                events = [Event(*event) for event in head["events"]]
                yield PathBlock(segments, events, head["file"], head["tool"], feed_lines)


def open_compiled(path: Path) -> Compiled:
    """Open a compiled program and prove that it is whole. Raises InputError for what is none, or is damaged."""
    try:
        with path.open("rb") as stream:
            if stream.readline(len(MAGIC)) != MAGIC:
                raise InputError(f"is no compiled part program of this version; {_AGAIN}", str(path))
            header = _read_json(stream.readline(), path)
            is_own = _check(stream, path)
            trailer = _read_json(_last_line(stream), path)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); {_AGAIN}", str(path)) from error
    return Compiled(path, header, trailer, is_own)


def _check(stream: BinaryIO, path: Path) -> bool:
    """InputError where it is damaged; whether it is this user's own."""
    size = stream.seek(0, 2) - _END
    stream.seek(0)
    digest = hashlib.sha256()
    left = max(size, 0)
    while left:
        data = stream.read(min(left, _CHUNK))
        digest.update(data)
        left -= len(data)
    found, last = digest.hexdigest(), stream.read(_END)
    if size < 0 or last[:_DIGEST] != found.encode() or last[-1:] != b"\n":
        raise InputError(f"is damaged: its bytes do not have the checksum at its end; {_AGAIN}", str(path))
    return hmac.compare_digest(last[_DIGEST:-1], _seal(found).encode())


def _last_line(stream: BinaryIO) -> bytes:
    end = stream.seek(0, 2) - _END
    stream.seek(max(0, end - _LONGEST_LAST))
    data = stream.read(min(end, _LONGEST_LAST))
    return data[max(data.rfind(b'{"end":true'), 0) :]  # the records before it end with no line feed


def _read_json(line: bytes, path: Path) -> dict[str, Any]:
    try:
        value = json.loads(line)
    except ValueError:
        value = None
    if not isinstance(value, dict):
        raise InputError(f"is damaged; {_AGAIN}", str(path))
    return value
