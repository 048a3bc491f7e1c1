"""MAT and Parquet files as columns of numbers; nothing in them is executed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.logs.log import Finding
from rds.logs.table import Column, Table, since_first
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
    if not isinstance(values, np.ndarray):  # a sparse matrix, an object of a class
        yield name, None
    elif values.dtype.names and values.size == 1:
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
    """The numeric columns of a Parquet file; units from a field's metadata (`unit`) or its name.

    Dates are s from the first one, durations s.
    """
    from pyarrow import parquet

    from rds.results.parquet_file import read

    values, _ = read(path)
    schema = parquet.read_schema(path)
    dates = _dates(path)
    columns = {name: Column(name, "s", array) for name, array in dates.items()}
    for name, array in values.items():
        short, unit = split_heading(name)
        if short in columns:
            raise InputError(f"two columns are called {short!r}; rename one", str(path))
        stated = (schema.field(name).metadata or {}).get(b"unit")
        unit = stated.decode("utf-8", "replace") if stated else unit
        columns[short] = Column(short, unit_of_name(short) if unit is None else unit, array.astype(np.float64))
    if not columns:
        raise InputError("it holds no columns of numbers", str(path))
    left_out = [name for name in schema.names if name not in values and name not in dates]
    words = f"left out, as they hold no numbers: {', '.join(left_out)}"
    return Table(path, "parquet", columns, findings=(Finding("columns", words),) if left_out else ())


def _dates(path: Path) -> dict[str, np.ndarray]:
    """The columns of dates (s from the first one) and durations (s); pandas keeps a time index so."""
    import pyarrow as pa
    from pyarrow import parquet

    found = {}
    try:
        for field in parquet.read_schema(path):
            if pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type):
                is_date = pa.types.is_timestamp(field.type)
                column = parquet.read_table(path, columns=[field.name]).column(0)
                exact = column.cast(pa.timestamp("ns") if is_date else pa.duration("ns")).to_numpy()
                if is_date:
                    found[field.name] = since_first(exact.astype("datetime64[ns]"))
                else:
                    spans = exact.astype("timedelta64[ns]")
                    found[field.name] = np.where(np.isnat(spans), np.nan, spans.astype(np.int64) * 1e-9)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(f"its dates cannot be read ({error}); take another copy") from error
    return found
