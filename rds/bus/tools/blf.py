"""Whether a BLF file is whole: python-can's reader takes half of a container for all of it."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from rds.core.errors import InputError
from rds.core.limits import allow

_HEADER = struct.Struct("<4sL")  # signature, size of the header
_OBJECT = struct.Struct("<4sHHLL")  # signature, header size and version, size, type
_CONTAINER = struct.Struct("<H6xL4x")  # compression, size of the content
_WHOLE_HEADER = 72  # bytes of a header that are used
_LOG_CONTAINER, _DEFLATE = 10, 2
_LARGEST = 64 << 20  # bytes in a container; recorders make them of some 100 kB


def check_containers(path: Path) -> None:
    """Raise InputError, with the offset in bytes, where the file is cut off or a container is damaged.

    Layout after Tobias Lorenz' description of the format, on which python-can's reader is based.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size or head[:4] != b"LOGG":
            raise _fault(path, 0, "this is no BLF file: it must begin with 'LOGG'")
        at = _HEADER.unpack(head)[1]
        if not _WHOLE_HEADER <= at <= size:
            raise _fault(path, 4, f"a header of {at} bytes in a file of {size}: it is cut off or damaged")
        while at < size:
            file.seek(at)
            head = file.read(_OBJECT.size)
            if len(head) < _OBJECT.size:
                raise _fault(path, at, "the file is cut off")
            signature, _, _, length, kind = _OBJECT.unpack(head)
            if signature != b"LOBJ" or length < _OBJECT.size:
                raise _fault(path, at, "the file is damaged: an object must begin here with 'LOBJ'")
            body = file.read(length - _OBJECT.size)
            if len(body) < length - _OBJECT.size:
                raise _fault(path, at, f"the file is cut off: {length} bytes are announced, {size - at} are there")
            if kind == _LOG_CONTAINER:
                _check_content(path, at, body)
            at += length + length % 4


def _check_content(path: Path, at: int, body: bytes) -> None:
    if len(body) < _CONTAINER.size:
        raise _fault(path, at, "the container is too short")
    method, announced = _CONTAINER.unpack_from(body)
    if method != _DEFLATE:
        return
    allow(announced, _LARGEST, f"a container announces {announced} bytes", "record it again", f"{path}, byte {at}")
    try:
        content = zlib.decompressobj().decompress(body[_CONTAINER.size :], announced + 1)  # no more: it may be a bomb
    except zlib.error as error:
        raise _fault(path, at, f"the container is damaged ({error})") from error
    if len(content) != announced:
        held = f"more than {announced}" if len(content) > announced else f"{len(content)}"
        raise _fault(path, at, f"the container holds {held} bytes instead of {announced}")


def _fault(path: Path, at: int, problem: str) -> InputError:
    return InputError(f"byte {at}: {problem}; record it again, or use another log", str(path))
