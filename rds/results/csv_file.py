"""Results as CSV: one line of headings with units, full precision; the description in a JSON file beside it."""

from __future__ import annotations

import codecs
import csv
import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import there
from rds.core.limits import DESCRIPTION, read_limited
from rds.results.arrow import to_arrow, to_numpy
from rds.results.header import FORMAT, describe, parse
from rds.results.units import heading

if TYPE_CHECKING:
    from rds.results.result import Result

_BLOCK = 10_000  # rows that are written at a time


def sidecar(path: Path) -> Path:
    """The JSON file beside the CSV file `path`."""
    return path.with_suffix(".json")


def description_beside(path: Path) -> dict[str, Any]:
    """What a result says of itself, of a folder of one or of its table, without reading the table.

    InputError or OSError where there is none.
    """
    beside = path / "result.json" if path.is_dir() else sidecar(path)
    return parse(read_limited(beside, DESCRIPTION, "a description of a table", "move it away"))


def writers(result: Result, path: Path) -> dict[Path, Callable[[BinaryIO], None]]:
    """What writes the table and its description; the description carries the table's SHA-256, so order matters."""
    digest = hashlib.sha256()

    def table(stream: BinaryIO) -> None:
        _write_table(result, _Tee(stream, digest.update))

    def description(stream: BinaryIO) -> None:
        text = {
            **describe(result),
            "table": {"file": path.name, "sha256": digest.hexdigest()},
            "metrics": result.metrics,
            "notes": result.notes,
        }
        stream.write(
            (json.dumps(text, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8", "backslashreplace")
        )

    return {path: table, sidecar(path): description}


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The columns, and the description where there is one (else None, and the columns are called as headed)."""
    beside = sidecar(path)
    text = read_limited(beside, DESCRIPTION, "a description of a table", "move it away") if beside.is_file() else None
    if text is None or not _is_description(text):
        return _read_table(path, None), None
    header = parse(text)
    with open(path, "rb") as stream:
        found = hashlib.file_digest(stream, "sha256").hexdigest()
    if found != (header.get("table") or {}).get("sha256"):
        raise InputError(
            f"the table is not the one that {beside.name} describes: it is truncated or was changed; "
            f"take another copy, or move {beside.name} away to open it as a plain table"
        )
    return _read_table(path, header["columns"]), header


def _is_description(text: bytes) -> bool:
    """Whether a JSON file beside a table is about it; one that is broken is, so that it's reported."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return True
    return isinstance(data, dict) and data.get("format") == FORMAT


class _Tee(io.RawIOBase):
    """Passes on what is written, and shows it to `seen`."""

    def __init__(self, stream: BinaryIO, seen: Callable[[bytes], object]):
        self._stream, self._seen = stream, seen

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._seen(data)
        return self._stream.write(data)


def _write_table(result: Result, stream: _Tee) -> None:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([heading(name, result.units[name]) for name in result.columns])
    stream.write(line.getvalue().encode("utf-8"))
    if not there("pyarrow"):
        for begin in range(0, len(result), _BLOCK):
            cells = [values[begin : begin + _BLOCK].tolist() for values in result.columns.values()]
            stream.write("".join(f"{','.join(map(repr, row))}\n" for row in zip(*cells, strict=True)).encode())
    elif len(result):
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        table = pa.table([to_arrow(values) for values in result.columns.values()], names=[*result.columns])
        arrow_csv.write_csv(table, stream, arrow_csv.WriteOptions(include_header=False))


def _read_table(path: Path, described: list[dict[str, Any]] | None) -> dict[str, np.ndarray]:
    names, delimiter, decimal, empty = _layout(path)
    if described is not None:
        if len(names) != len(described):
            raise InputError(f"it has {len(names)} columns where {len(described)} are described; save it again")
        names = [entry["name"] for entry in described]
        types = {entry["name"]: entry["type"] for entry in described}
    else:
        types = dict.fromkeys(names, "float64")
    if len(set(names)) != len(names):
        raise InputError("two columns have the same heading; rename one")
    if empty:
        return {name: np.empty(0, dtype=types[name]) for name in names}
    if not there("pyarrow"):
        return _read_by_numpy(path, types, delimiter, decimal)
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    try:
        table = arrow_csv.read_csv(
            str(path),
            read_options=arrow_csv.ReadOptions(column_names=names, skip_rows=1),
            parse_options=arrow_csv.ParseOptions(delimiter=delimiter),
            convert_options=arrow_csv.ConvertOptions(
                column_types={name: pa.type_for_alias(kind) for name, kind in types.items()}, decimal_point=decimal
            ),
        )
    except pa.ArrowInvalid as error:
        raise InputError(f"its table cannot be read: {error}; every cell must be a number") from error
    return {name: to_numpy(table.column(name)) for name in names}


def _read_by_numpy(path: Path, types: dict[str, str], delimiter: str, decimal: str) -> dict[str, np.ndarray]:
    """The rows without Arrow: the same numbers, in ten times its time."""
    dtype = [(f"f{i}", kind) for i, kind in enumerate(types.values())]
    try:
        with open(path, encoding="utf-8-sig") as file:
            lines = (line.replace(decimal, ".") for line in file) if decimal != "." else file
            rows = np.loadtxt(lines, dtype, comments=None, delimiter=delimiter, skiprows=1, quotechar='"', ndmin=1)
    except ValueError as error:  # numpy's advice after the ; is about its own options
        raise InputError(
            f"its table cannot be read: {str(error).partition(';')[0]}; every cell must be a number"
        ) from error
    return {name: np.ascontiguousarray(rows[f"f{i}"]) for i, name in enumerate(types)}


def _layout(path: Path) -> tuple[list[str], str, str, bool]:
    """Headings, delimiter, decimal point, and whether nothing follows the headings.

    Spreadsheets of many countries write `;` between cells and `,` as the decimal point.
    """
    with open(path, "rb") as stream:
        first, below = stream.readline(65536), stream.read(65536)
    try:
        head = first.removeprefix(codecs.BOM_UTF8).decode("utf-8").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise InputError(f"it is not a text file in UTF-8 ({error}); save it as CSV (UTF-8)") from error
    if not head.strip() or "\0" in head:
        raise InputError("it is not a table: its first line must head the columns, as in 'time [s],X_measured [mm]'")
    delimiter = max(",;\t", key=head.count)
    decimal = "," if delimiter != "," and b"," in below else "."
    try:
        names = [name.strip() for name in next(csv.reader([head], delimiter=delimiter))]
    except csv.Error as error:
        raise InputError(f"it is not a table: its first line cannot be read ({error})") from error
    return names, delimiter, decimal, not below.strip()
