"""MAT files of version 7.3, which are HDF5: their numbers by name. Needs h5py (the extra `hdf5`).

MATLAB writes an array with its axes in reverse, a struct as a group, a text as uint16, and what a cell or an array of
structs holds as references to a group apart (`#refs#`). The attribute `MATLAB_class` says which is which; an object of
a class (a timetable, a timeseries) has `MATLAB_object_decode`, and its content is nowhere documented.

Nothing is read that lies outside the file (soft and external links, external and virtual storage), and no references
are followed. A file of a few kilobytes may claim arrays of any size; so sizes are summed before anything is read. The
HDF5 library itself goes round in circles on some damaged files, so it works in a process of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.limits import allow_unpacked
from rds.core.parallel.reader_process import read_apart
from rds.identification.logs.mat_parts import Part, numbers

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_OFFSETS = (0, 512)  # 512: behind the header by which MATLAB knows its files
_MOST_VARIABLES = 10_000
_DEEPEST = 20  # structs in structs
_MOST_PACKED = 1200  # deflate makes nothing smaller than 1/1032


def is_hdf5(path: Path) -> bool:
    """Whether the file is HDF5, as those of version 7.3 are."""
    with open(path, "rb") as stream:
        start = stream.read(_OFFSETS[-1] + len(_SIGNATURE))
    return start.startswith(b"MATLAB 7.3") or any(start.startswith(_SIGNATURE, offset) for offset in _OFFSETS)


def parts(path: Path) -> list[Part]:
    """The variables of the file, structs taken apart. InputError for one that is damaged, a bomb, or not to be read."""
    with needed_for("a MAT file of version 7.3 (HDF5)", "save it in MATLAB with -v7"):
        import h5py  # noqa: F401 - whether it is there
    return read_apart(parts_here, path)


def parts_here(path: Path) -> list[Part]:
    """The same in this process, which a damaged file may hold for ever."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            leaves = list(_leaves(h5py, file, "", set()))
            allow_unpacked(8 * sum(node.size for _, node, _ in leaves if node is not None), path.stat().st_size)
            found: list[Part] = []
            for name, node, of_class in leaves:
                if node is None:
                    found.append(Part(name, None, of_class))
                else:
                    found += numbers(name, _read(node, name))
            return found
    except (InputError, MemoryError):
        raise
    except Exception as error:  # h5py raises half a dozen types on bad bytes
        reason = str(error) or type(error).__name__
        raise InputError(
            f"it is a MAT file of version 7.3, and is damaged or cut ({reason}); take another copy"
        ) from error


def _leaves(h5py: Any, group: Any, before: str, seen: set[int]) -> Iterator[tuple[str, Any, str]]:
    """Name, dataset of numbers (None where there is none), and class of what is an object, below a group.

    `seen` are the addresses of the groups entered, so that none is twice, or holds itself.
    """
    address = int(h5py.h5o.get_info(group.id).addr)
    if address in seen or len(seen) > _MOST_VARIABLES or before.count(".") > _DEEPEST:
        raise InputError(
            f"{before[:-1]:.80} is at two places, holds itself, or is one struct too many; save time, command and "
            "position as vectors"
        )
    seen.add(address)
    if len(group) > _MOST_VARIABLES:
        raise InputError(
            f"it holds {len(group)} variables at one place, and {_MOST_VARIABLES} are the most that are read"
        )
    for key in group:
        name = before + str(key)
        if not before and name.startswith("#"):
            continue  # what cells, arrays of structs and objects refer to
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            yield name, None, ""
            continue
        node = group[key]
        kind = _text(node.attrs.get("MATLAB_class", ""))
        if "MATLAB_object_decode" in node.attrs:
            yield name, None, kind or "unknown"
        elif isinstance(node, h5py.Group):
            if "MATLAB_sparse" in node.attrs:
                yield name, None, ""
            else:
                yield from _leaves(h5py, node, f"{name}.", seen)
        elif isinstance(node, h5py.Dataset) and _is_numbers(node, kind):
            yield name, node, ""
        else:
            yield name, None, ""


def _is_numbers(node: Any, kind: str) -> bool:
    is_inside = not node.is_virtual and not node.external
    is_full = node.size and "MATLAB_empty" not in node.attrs
    return bool(is_inside and is_full and kind != "char" and node.dtype.kind in "fiub")


def _read(node: Any, name: str) -> np.ndarray:
    stored = node.id.get_storage_size()
    if node.nbytes > _MOST_PACKED * max(stored, 1):
        raise InputError(
            f"{name:.80} claims {node.size} values, and the file holds {stored} bytes of them; take another copy"
        )
    return np.asarray(node[()]).T


def _text(value: Any) -> str:
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return text[:60] if text.isprintable() else "unknown"
