"""MAT files of version 5 as far as results need them: real arrays and texts, without scipy.

The format: MathWorks, *MAT-File Format*, level 5. A file is a header of 128 bytes and elements: a tag (type, length)
and data padded to 8 bytes. A variable is an element of elements: flags, dimensions, name, data; it may be compressed.

Our own, because `scipy.io` takes half a second to import, and every run saves a MAT file.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from rds.core.errors import InputError

_HEAD = struct.Struct("<116s8xH2s")
_TAG = struct.Struct("<II")
_VERSION, _LITTLE = 0x0100, b"IM"
_INT8, _INT32, _UINT32, _DOUBLE, _INT64, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 9, 12, 14, 15, 16
_CHAR, _REAL, _OPAQUE, _IS_COMPLEX = 4, range(6, 16), 17, 0x08  # classes; a flag
_CLASSES = {"f": (6, _DOUBLE, "<f8"), "i": (14, _INT64, "<i8")}
_NUMBERS = {
    1: "<i1",
    2: "<u1",
    3: "<i2",
    4: "<u2",
    5: "<i4",
    6: "<u4",
    7: "<f4",
    9: "<f8",
    12: "<i8",
    13: "<u8",
}
_TEXTS = {1: "ascii", 2: "ascii", 4: "utf-16-le", 16: "utf-8", 17: "utf-16-le"}
_LONGEST = 2**32 - 1  # bytes of an element
_ENOUGH = 2048  # bytes of a variable that hold all before its data


class OtherFileError(Exception):
    """The file holds what this module does not read, or is damaged."""


def write(stream: BinaryIO, content: Mapping[str, np.ndarray | str]) -> None:
    """Write float64 and int64 vectors as columns, and texts, compressed. InputError for one that is too long."""
    stream.write(_HEAD.pack(b"MATLAB 5.0 MAT-file, written by RDS".ljust(116), _VERSION, _LITTLE))
    for name, value in content.items():
        if isinstance(value, str):
            of_class, kind, data, shape = _CHAR, _UTF8, value.encode(), (1, len(value))
        else:
            of_class, kind, dtype = _CLASSES[value.dtype.kind]
            data, shape = np.ascontiguousarray(value, dtype).tobytes(), (len(value), 1)
        if len(data) + _ENOUGH > _LONGEST:
            raise InputError(f"{name} is longer than the 4 GB of a MAT file's variable; save it as .csv or .parquet")
        parts = (
            _element(_UINT32, struct.pack("<II", of_class, 0)),
            _element(_INT32, struct.pack("<ii", *shape)),
            _element(_INT8, name.encode("ascii")),
            _element(kind, data),
        )
        packed = zlib.compress(_element(_MATRIX, b"".join(parts)))
        stream.write(_TAG.pack(_COMPRESSED, len(packed)) + packed)


def read(path: Path) -> dict[str, np.ndarray]:
    """All variables, as `scipy.io.loadmat` gives them; OtherFileError where one is no real array and no text."""
    return {found.name: _value(found) for found in _variables(path.read_bytes())}


def names(path: Path) -> list[str]:
    """The names of all variables; OtherFileError for another kind of file."""
    return [found.name for found in _variables(path.read_bytes(), _ENOUGH)]


def shapes(path: Path) -> list[tuple[int, ...]]:
    """The shapes that all variables claim; OtherFileError for another kind of file."""
    return [found.shape for found in _variables(path.read_bytes(), _ENOUGH)]


def objects(path: Path) -> dict[str, str]:
    """The variables that are objects of a class (a timetable, a string, a transfer function), with their class.

    MATLAB saves them as "opaque": name, kind of object and class stand where other variables have their shape.
    """
    found = {}
    try:
        for body in _bodies(path.read_bytes(), _ENOUGH):
            _, flags, rest = _split(body)
            if flags[0] == _OPAQUE:
                _, name, rest = _split(rest)
                _, _, rest = _split(rest)
                found[bytes(name).decode("ascii", "replace")] = bytes(_split(rest)[1]).decode("ascii", "replace")
    except (struct.error, zlib.error, ValueError, IndexError, OtherFileError):
        pass  # of another computer, or damaged: who reads its numbers says so
    return found


class _Variable(NamedTuple):
    name: str
    of_class: int
    shape: tuple[int, ...]
    rest: memoryview  # its data, with the tag


def _variables(file: bytes, most: int = 0) -> Iterator[_Variable]:
    """What is in a file; with `most`, only as many bytes are unpacked of each."""
    try:
        for body in _bodies(file, most):
            yield _variable(body)
    except (struct.error, zlib.error, ValueError, IndexError) as error:
        raise OtherFileError(str(error)) from error


def _bodies(file: bytes, most: int) -> Iterator[memoryview]:
    _, version, order = _HEAD.unpack_from(file)
    if (version, order) != (_VERSION, _LITTLE):
        raise OtherFileError("no MAT file of version 5 in the order of bytes of today's computers")
    rest = memoryview(file)[_HEAD.size :]
    while rest:
        kind, length = _TAG.unpack_from(rest)
        body = rest[_TAG.size : _TAG.size + length]
        if len(body) < length:
            raise OtherFileError("it is cut")
        rest = rest[_TAG.size + length :]
        if kind == _COMPRESSED:
            unpacking = zlib.decompressobj()
            whole = memoryview(unpacking.decompress(body, most))
            if not most and not unpacking.eof:
                raise OtherFileError("it is cut")
            kind, body = _TAG.unpack_from(whole)[0], whole[_TAG.size :]
        if kind != _MATRIX:
            raise OtherFileError(f"an element of type {kind}")
        yield body


def _variable(body: memoryview) -> _Variable:
    _, flags, body = _split(body)
    of_class, bits = flags[0], flags[1]
    _, shape, body = _split(body)
    _, name, body = _split(body)
    if bits & _IS_COMPLEX or (of_class != _CHAR and of_class not in _REAL):
        raise OtherFileError(f"a variable of class {of_class}")
    return _Variable(bytes(name).decode("ascii"), of_class, tuple(np.frombuffer(shape, "<i4").tolist()), body)


def _value(found: _Variable) -> np.ndarray:
    kind, data, _ = _split(found.rest)
    try:
        if found.of_class == _CHAR:
            if len(found.shape) != 2 or found.shape[0] != 1:
                raise OtherFileError("several lines of text")
            return np.array([bytes(data).decode(_TEXTS[kind])])
        return np.frombuffer(data, _NUMBERS[kind]).reshape(found.shape, order="F")
    except (KeyError, ValueError) as error:
        raise OtherFileError(f"{found.name}: {error}") from error


def _element(kind: int, data: bytes) -> bytes:
    return _TAG.pack(kind, len(data)) + data + bytes(-len(data) % 8)


def _split(data: memoryview) -> tuple[int, memoryview, memoryview]:
    """The first element's type and data, and what follows it."""
    kind, length = _TAG.unpack_from(data)
    if kind >> 16:  # a short one: type and length in the first four bytes, data in the others
        kind, length, begin, end = kind & 0xFFFF, kind >> 16, 4, 8
    else:
        begin, end = _TAG.size, _TAG.size + length + -length % 8
    if begin + length > len(data):
        raise OtherFileError("it is cut")
    return kind, data[begin : begin + length], data[end:]
