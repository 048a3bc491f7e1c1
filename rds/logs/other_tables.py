"""MAT and Parquet files as columns of numbers; nothing in them is executed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.logs.log import Finding
from rds.logs.table import Column, Table
from rds.logs.units import unit_of_name
from rds.results.units import split_heading

_MOST_COLUMNS = 1000  # of a matrix; a picture is no log


def read_mat(path: Path) -> Table:
    """The vectors of a MAT file (up to version 7.2) that have the length that most have; single numbers as constants.

    A matrix gives a column each: `data_1`, `data_2`, ...; a struct its fields: `data.position`. InputError where there
    are no vectors.
    """
    from rds.results.mat_file import variables

    constants: dict[str, float] = {}
    vectors: dict[str, np.ndarray] = {}
    left_out: list[str] = []
    for name, values in variables(path).items():
        if not name.startswith("__"):
            for part, array in _parts(name, values):
                if array is None:
                    left_out.append(part)
                elif array.size == 1:
                    constants[part] = float(array.item())
                else:
                    vectors[part] = array
    if not vectors:
        raise InputError("it holds no vectors of numbers; save time, command and position as vectors", str(path))
    length = Counter(map(len, vectors.values())).most_common(1)[0][0]
    others = [f"{name} ({len(values)})" for name, values in vectors.items() if len(values) != length]
    findings = []
    if others:
        what = f"left out, as they do not have {length} values like the others: {', '.join(others)}"
        findings.append(Finding("columns", what))
    if left_out:
        findings.append(Finding("columns", f"left out, as they hold no real numbers: {', '.join(left_out)}"))
    columns = {
        name: Column(name, unit_of_name(name), values.astype(np.float64))
        for name, values in vectors.items()
        if len(values) == length
    }
    return Table(path, "mat", columns, constants, tuple(findings))


def _parts(name: str, values: Any) -> Iterator[tuple[str, np.ndarray | None]]:
    if not isinstance(values, np.ndarray):
        return
    if values.dtype.names and values.size == 1:
        for field in values.dtype.names:
            yield from _parts(f"{name}.{field}", values.reshape(-1)[0][field])
    elif values.dtype.kind not in "fiub" or values.size == 0:
        yield name, None
    elif values.size == max(values.shape):
        yield name, values.reshape(-1)
    elif values.ndim == 2 and min(values.shape) <= _MOST_COLUMNS:
        tall = values if values.shape[0] > values.shape[1] else values.T
        for i in range(tall.shape[1]):
            yield f"{name}_{i + 1}", np.ascontiguousarray(tall[:, i])
    else:
        yield name, None


def read_parquet(path: Path) -> Table:
    """The numeric columns of a Parquet file; units from a field's metadata (`unit`) or its name."""
    from pyarrow import parquet

    from rds.results.parquet_file import read

    values, _ = read(path)
    schema = parquet.read_schema(path)
    columns = {}
    for name, array in values.items():
        short, unit = split_heading(name)
        if short in columns:
            raise InputError(f"two columns are called {short!r}; rename one", str(path))
        stated = (schema.field(name).metadata or {}).get(b"unit")
        unit = stated.decode("utf-8", "replace") if stated else unit
        columns[short] = Column(short, unit_of_name(short) if unit is None else unit, array.astype(np.float64))
    if not columns:
        raise InputError("it holds no columns of numbers", str(path))
    left_out = [name for name in schema.names if name not in values]
    words = f"left out, as they hold no numbers: {', '.join(left_out)}"
    return Table(path, "parquet", columns, findings=(Finding("columns", words),) if left_out else ())
