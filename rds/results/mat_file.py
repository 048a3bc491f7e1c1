"""Results as MAT files (version 5): one column vector per column, and the description as JSON text.

In MATLAB: `load result.mat; about = jsondecode(rds_result); about.columns(1).unit`.
"""

from __future__ import annotations

import json
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.limits import allow_unpacked, most_unpacked
from rds.results import mat5
from rds.results.header import describe, parse

if TYPE_CHECKING:
    from rds.results.result import Result

_DESCRIPTION = "rds_result"
_HEAD = 128  # bytes before the first variable
_COMPRESSED = 15  # miCOMPRESSED, of the MAT-File Format, table 1-1
_PIECE = 1 << 20  # bytes
_NUMBERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"single", "double", "logical"}
_FLAT = _NUMBERS | {"char"}  # classes that hold no others
_needed = partial(
    needed_for, "a MAT file that holds more than real arrays and texts, or is damaged,", "save its vectors alone"
)
Found = TypeVar("Found")
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")  # MATLAB's namelengthmax is 63


def writers(result: Result, path: Path) -> dict[Path, Callable[[BinaryIO], None]]:
    """What writes the file. A column whose name MATLAB cannot have is called `column_3` and the like there."""

    def write(stream: BinaryIO) -> None:
        header = describe(result)
        for entry, variable in zip(header["columns"], _variables([*result.columns]), strict=True):
            entry["variable"] = variable
        content: dict[str, np.ndarray | str] = {e["variable"]: result.columns[e["name"]] for e in header["columns"]}
        content[_DESCRIPTION] = json.dumps(header, allow_nan=False)
        mat5.write(stream, content)

    return {path: write}


def _variables(names: list[str]) -> list[str]:
    taken = {_DESCRIPTION, *(name for name in names if _IDENTIFIER.fullmatch(name))}
    variables = []
    for index, name in enumerate(names):
        if not _IDENTIFIER.fullmatch(name) or name == _DESCRIPTION:
            name = f"column_{index}"
            while name in taken:
                name += "_"
            taken.add(name)
        variables.append(name)
    return variables


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The columns, and the description where there is one. Reads numbers and text only; nothing in it is executed."""
    return confined(read_here, path)


def confined(read: Callable[[Path], Found], path: Path) -> Found:
    """What `read(path)` returns of a MAT file up to version 7.2; InputError for a bomb, or what is none.

    What is compressed is counted, and what is claimed is summed, before anything is read. A cell or a struct may claim
    more inside, so those are read in a process apart, whose memory has a limit.
    """
    packed = path.stat().st_size
    with _mat_errors():
        check_compressed(path)
    try:
        claimed = mat5.shapes(path)
        plain = True
    except mat5.OtherFileError:
        with _mat_errors(), _needed():
            from scipy.io import whosmat

            objects = mat5.objects(path)  # scipy's list stumbles over them; the process apart has a limit of its own
            kinds = [] if objects else whosmat(path, appendmat=False)
        claimed, plain = [shape for _, shape, _ in kinds], not objects and {kind for _, _, kind in kinds} <= _FLAT
    allow_unpacked(8 * sum(prod(max(int(n), 0) for n in shape) for shape in claimed), packed)
    if plain:
        return read(path)
    from rds.core.parallel.reader_process import read_apart

    return read_apart(read, path)


def read_here(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The same in this process, whose memory a file may fill."""
    content = variables(path)
    text = content.get(_DESCRIPTION)
    if text is None:
        return _vectors(content), None
    if not isinstance(text, np.ndarray) or text.dtype.kind != "U" or text.size != 1:
        raise InputError(f"its variable {_DESCRIPTION} is not a text; save the result again")
    header = parse(str(text.item()))
    columns = {}
    for entry in header["columns"]:
        values = content.get(entry.get("variable", entry["name"]))
        if values is None:
            raise InputError(f"column {entry['name']!r} is missing: the file is truncated or was changed")
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
            raise InputError(f"column {entry['name']!r} does not hold real numbers; save the result again")
        columns[entry["name"]] = values.reshape(-1)
    return columns, header


def variables(path: Path) -> dict[str, Any]:
    """All variables of a MAT file up to version 7.2, as scipy gives them, but objects of a class (`mat5.objects`).

    InputError for any other file.
    """
    try:
        return dict(mat5.read(path))
    except mat5.OtherFileError:
        pass  # structs, cells, a file of another computer, a damaged one
    with _needed():
        from scipy.io import loadmat

    with _mat_errors(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that objects of a class have no name for scipy
        found = dict(loadmat(path, appendmat=False, squeeze_me=False, struct_as_record=True))
    for name in mat5.objects(path):  # by their names from scipy 1.18 on, before that as "None"
        found.pop(name if name in found else "None", None)
    return found


@contextmanager
def _mat_errors() -> Iterator[None]:
    """What scipy raises as InputError."""
    try:
        yield
    except NotImplementedError as error:
        raise InputError("it is a MAT file of version 7.3; save it with -v7") from error
    except (InputError, OSError, MemoryError):
        raise
    except Exception as error:  # scipy raises whatever its decoder trips over: half a dozen types on bad bytes
        raise InputError(f"it is not a MAT file, or is truncated ({error}); take another copy") from error


def check_compressed(path: Path) -> None:
    """InputError for a file whose variables unpack to more than is read of it."""
    allow_unpacked(_inflated(path), path.stat().st_size, counting=True)


def _inflated(path: Path) -> int:
    """Bytes that the compressed variables of a file of version 5 to 7.2 have unpacked; as many as are read, if more."""
    most, total = most_unpacked(path.stat().st_size), 0
    with open(path, "rb") as stream:
        head = stream.read(_HEAD)
        if len(head) < _HEAD or head[-2:] not in (b"IM", b"MI") or 0 in head[:4]:  # version 4 compresses nothing
            return 0
        tag = struct.Struct("<II" if head[-2:] == b"IM" else ">II")
        while len(start := stream.read(tag.size)) == tag.size and total <= most:
            kind, size = tag.unpack(start)
            following = stream.tell() + size
            if kind == _COMPRESSED:
                total += _count(stream, size, most - total)
            stream.seek(following)
    return total


def _count(stream: BinaryIO, size: int, most: float) -> int:
    """Bytes in a zlib stream of `size` bytes, counted in pieces up to a little more than `most`."""
    inflate, total = zlib.decompressobj(), 0
    while size > 0 and total <= most and not inflate.eof and (packed := stream.read(min(size, _PIECE))):
        size -= len(packed)
        while packed and total <= most:
            total += len(inflate.decompress(packed, _PIECE))
            packed = inflate.unconsumed_tail
    return total


def _vectors(content: dict[str, Any]) -> dict[str, np.ndarray]:
    """The variables that are real vectors, by name."""
    return {
        name: values.reshape(-1)
        for name, values in content.items()
        if isinstance(values, np.ndarray) and values.dtype.kind in "fiu" and values.size == max(values.shape, default=0)
    }
