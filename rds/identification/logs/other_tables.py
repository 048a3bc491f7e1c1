"""MAT and Parquet files as columns of numbers; nothing in them is executed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import allow_unpacked
from rds.identification.logs.log import Finding
from rds.identification.logs.mat_parts import Part, parts_of
from rds.identification.logs.table import Column, Table, since_first
from rds.identification.logs.units import unit_of_name
from rds.results.units import split_heading

_LEAST = 20  # values of a vector that is over time, rather than of coefficients


def read_mat(path: Path) -> Table:
    """The vectors of a MAT file that have the length that most have; single numbers as constants.

    Vectors of fewer than 20 values (coefficients, gains) have no say where there are longer ones. A matrix gives a
    column each: `data_1`, `data_2`, ...; a struct its fields: `data.position`. InputError where there are no vectors.
    """
    constants: dict[str, float] = {}
    vectors: dict[str, np.ndarray] = {}
    left_out: list[str] = []
    objects: dict[str, list[str]] = {}  # names by class
    for part in _parts(path):
        if part.of_class:
            objects.setdefault(part.of_class, []).append(part.name)
        elif part.values is None:
            left_out.append(part.name)
        elif part.values.size == 1:
            constants[part.name] = float(part.values.item())
        else:
            vectors[part.name] = part.values
    unread = [
        f"{', '.join(names)}: of MATLAB's class {of_class}, which only MATLAB can read; save its vectors instead, as "
        f"in {_as_vectors(of_class, names[0])}"
        for of_class, names in objects.items()
    ]
    if not vectors:
        advice = "; ".join(unread) or "save time, command and position as vectors"
        if left_out and not unread:
            advice += (
                f" (left out: {', '.join(left_out)}; of a cell array save an element, as in run = {left_out[0]}{{1}}; "
                "save('log.mat', 'run'))"
            )
        raise InputError(f"it holds no vectors of numbers; {advice}", str(path))
    lengths = list(map(len, vectors.values()))
    length = Counter([n for n in lengths if n >= _LEAST] or lengths).most_common(1)[0][0]
    others = [f"{name} ({len(values)})" for name, values in vectors.items() if len(values) != length]
    findings = []
    if others:
        what = (
            f"left out, as they do not have {length} values like the others: {', '.join(others)}; where they belong to "
            "the log, put them on its times in MATLAB, as in y = interp1(t2, y2, t), or save them as a second file"
        )
        findings.append(Finding("columns", what))
    if left_out:
        findings.append(Finding("columns", f"left out, as they hold no real numbers: {', '.join(left_out)}"))
    findings += [Finding("columns", f"left out {sentence}") for sentence in unread]
    columns = {
        name: Column(name, unit_of_name(name), values.astype(np.float64))
        for name, values in vectors.items()
        if len(values) == length
    }
    return Table(path, "mat", columns, constants, tuple(findings))


def _parts(path: Path) -> list[Part]:
    from rds.identification.logs import hdf5_mat

    if hdf5_mat.is_hdf5(path):
        return hdf5_mat.parts(path)
    from rds.results.mat_file import confined

    return confined(_parts_here, path)


def _parts_here(path: Path) -> list[Part]:
    """The variables of a file up to version 7.2, in this process."""
    from rds.results import mat5
    from rds.results.mat_file import variables

    found = variables(path)
    parts = [part for name, values in found.items() if not name.startswith("__") for part in parts_of(name, values)]
    parts += [Part(name, None, of_class) for name, of_class in mat5.objects(path).items()]
    allow_unpacked(8 * sum(part.values.size for part in parts if part.values is not None), path.stat().st_size)
    return parts


def _as_vectors(of_class: str, name: str) -> str:
    """What to type in MATLAB."""
    if of_class == "timeseries":
        return f"t = {name}.Time; y = {name}.Data; save('log.mat', 't', 'y')"
    if of_class == "timetable":
        return f"t = seconds({name}.Time - {name}.Time(1)); y = {name}.(1); save('log.mat', 't', 'y')"
    if of_class == "iddata":
        return (
            f"t = {name}.SamplingInstants; u = {name}.InputData; y = {name}.OutputData; save('log.mat', 't', 'u', 'y')"
        )
    if of_class == "table":
        return f"s = table2struct({name}, 'ToScalar', true); save('log.mat', 's')"
    return "t = ...; y = ...; save('log.mat', 't', 'y')"


def read_parquet(path: Path) -> Table:
    """The numeric columns of a Parquet file; units from a field's metadata (`unit`) or its name.

    Dates are s from the first one, durations s.
    """
    from rds.results.parquet_file import confined

    return confined(_read_parquet_here, path)


def _read_parquet_here(path: Path) -> Table:
    from rds.results.parquet_file import read_here

    values, _ = read_here(path)
    from pyarrow import parquet

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
    """The columns of dates (s from the first one), durations and times of day (s); pandas keeps a time index so."""
    import pyarrow as pa
    from pyarrow import parquet

    found = {}
    try:
        for field in parquet.read_schema(path):
            of_day = pa.types.is_time(field.type)
            if pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type) or of_day:
                is_date = pa.types.is_timestamp(field.type)
                column = parquet.read_table(path, columns=[field.name], page_checksum_verification=True).column(0)
                if of_day:  # since midnight
                    column = column.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.duration("ns"))
                exact = column.cast(pa.timestamp("ns") if is_date else pa.duration("ns")).to_numpy()
                if is_date:
                    found[field.name] = since_first(exact.astype("datetime64[ns]"))
                else:
                    spans = exact.astype("timedelta64[ns]")
                    found[field.name] = np.where(np.isnat(spans), np.nan, spans.astype(np.int64) * 1e-9)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(f"its dates cannot be read ({error}); take another copy") from error
    return found
