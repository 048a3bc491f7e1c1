"""What a variable of a MAT file holds: vectors of numbers, single numbers, or nothing that a log can have."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

_MOST_COLUMNS = 1000  # of a matrix; a picture is no log
_DEEPEST = 20  # structs in structs
_MOST_STRUCTS = 1000  # in an array
_CLASS = ("_Class", "s2")  # the field of scipy's in which an object's class is, from 1.18 on and before
_LABELS = ("label", "Name", "name")  # of Simulink's and dSPACE's structs


class Part(NamedTuple):
    """A vector (one value: a constant) by its name. None where there are no real numbers; `of_class` is an object's."""

    name: str
    values: np.ndarray | None
    of_class: str = ""


def numbers(name: str, values: np.ndarray) -> Iterator[Part]:
    """An array as vectors: a matrix gives a column each, `data_1`, `data_2`, ..."""
    if values.dtype.kind not in "fiub" or values.size == 0:
        yield Part(name, None)
    elif values.size == max(values.shape, default=1):
        yield Part(name, values.reshape(-1))
    elif values.ndim == 2 and min(values.shape) <= _MOST_COLUMNS:
        tall = values if values.shape[0] > values.shape[1] else values.T
        for i in range(tall.shape[1]):
            yield Part(f"{name}_{i + 1}", np.ascontiguousarray(tall[:, i]))
    else:
        yield Part(name, None)


def parts_of(name: str, values: Any, depth: int = 0) -> Iterator[Part]:
    """A variable as scipy gives it, structs taken apart: `run.time`."""
    of_class = _class_of(values)
    if of_class:
        yield Part(name, None, of_class)
    elif not isinstance(values, np.ndarray) or depth > _DEEPEST:  # a sparse matrix
        yield Part(name, None)
    elif values.dtype.names and 0 < values.size <= _MOST_STRUCTS:
        for element, record in zip(_names(name, values), values.reshape(-1), strict=True):
            for field in values.dtype.names:
                yield from parts_of(f"{element}.{field}", record[field], depth + 1)
    else:
        yield from numbers(name, values)


def _names(name: str, structs: np.ndarray) -> list[str]:
    """What the elements of an array of structs are called: by their labels, as Simulink's scopes and dSPACE have them.

    By their numbers, `signals_1`, where they have none or not each its own.
    """
    if structs.size == 1:
        return [name]
    for field in _LABELS:
        if field in (structs.dtype.names or ()):
            texts = [str(one[field].item()) if one[field].size == 1 else "" for one in structs.reshape(-1)]
            if len(set(texts)) == len(texts) and all(text and text.isprintable() for text in texts):
                return [f"{name}.{text}" for text in texts]
    return [f"{name}_{i + 1}" for i in range(structs.size)]


def _class_of(values: Any) -> str:
    """The class of an object that MATLAB saved without saying how (a timetable, a timeseries); "" for others."""
    matlab: Any = sys.modules.get("scipy.io.matlab")
    if matlab is None:  # the file held nothing that scipy was needed for
        return ""
    if isinstance(values, matlab.MatlabObject):
        return str(values.classname)
    if not isinstance(values, matlab.MatlabOpaque):
        return ""
    fields = [name for name in _CLASS if name in (values.dtype.names or ())]
    if values.size and fields:
        name = values.reshape(-1)[0][fields[0]]
        text = name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)
        return text[:60] if text.isprintable() else "unknown"
    return ""
