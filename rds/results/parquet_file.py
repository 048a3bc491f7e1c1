"""Results as Parquet: the description in the schema's metadata, each column's unit in its field's."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.limits import allow_unpacked
from rds.results.arrow import to_arrow, to_numpy
from rds.results.header import describe, parse

if TYPE_CHECKING:
    from rds.results.result import Result

_DESCRIPTION = b"rds_result"
_LITTLE = {"UNCOMPRESSED", "SNAPPY"}  # codecs that pack 22 times at most: such a file is no bomb
_needed = partial(needed_for, "a Parquet file", "use .csv or .mat")
Found = TypeVar("Found")


def writers(result: Result, path: Path) -> dict[Path, Callable[[BinaryIO], None]]:
    """What writes the file."""

    def write(stream: BinaryIO) -> None:
        with _needed():
            import pyarrow as pa
            from pyarrow import parquet

        fields = [
            pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={b"unit": result.units[name].encode()})
            for name, values in result.columns.items()
        ]
        text = json.dumps(describe(result), allow_nan=False).encode()
        schema = pa.schema(fields, metadata={_DESCRIPTION: text})
        parquet.write_table(pa.table([to_arrow(v) for v in result.columns.values()], schema=schema), stream)

    return {path: write}


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The columns, and the description where there is one. Reads numbers only; nothing in it is executed."""
    return confined(read_here, path)


def confined(read: Callable[[Path], Found], path: Path) -> Found:
    """What `read(path)` returns of a Parquet file; in a process apart if its pages may unpack to any size."""
    with _needed():
        import pyarrow as pa
        from pyarrow import parquet

    try:
        metadata = parquet.read_metadata(path)
        fields = [field.type for field in metadata.schema.to_arrow_schema()]
        read_ones = sum(_is_number(kind) or pa.types.is_temporal(kind) for kind in fields)
        allow_unpacked(8 * metadata.num_rows * read_ones, path.stat().st_size)
        chunks = ((group, column) for group in range(metadata.num_row_groups) for column in range(metadata.num_columns))
        codecs = {metadata.row_group(group).column(column).compression for group, column in chunks}
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, FileNotFoundError | PermissionError):
            raise
        raise InputError(f"it is not a Parquet file, or is truncated ({error}); take another copy") from error
    if codecs <= _LITTLE:
        return read(path)
    from rds.core.parallel.reader_process import read_apart

    return read_apart(read, path)


def read_here(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The same in this process."""
    import pyarrow as pa
    from pyarrow import parquet

    with open(path, "rb") as stream:
        try:
            # none of Arrow's threads: one that lets go of the stream's buffers while Python ends aborts the process
            file = parquet.ParquetFile(stream, pre_buffer=False, page_checksum_verification=True)
            text = (file.metadata.metadata or {}).get(_DESCRIPTION)
            schema = file.schema_arrow
            numbers = [field.name for field in schema if _is_number(field.type)]
            if len(set(schema.names)) != len(schema.names):
                raise InputError("two columns have the same name; rename one")
            table = file.read(columns=numbers, use_threads=False)
            columns = {name: _of_floats(table.column(name)) for name in numbers}
        except (pa.ArrowException, OSError, ValueError) as error:
            raise InputError(f"it is not a Parquet file, or is truncated ({error}); take another copy") from error
    return {name: to_numpy(column) for name, column in columns.items()}, None if text is None else parse(text)


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))


def _of_floats(column: Any) -> Any:
    """Decimal numbers, as databases write them, as floats; all others as they are."""
    import pyarrow as pa

    return column.cast(pa.float64()) if pa.types.is_decimal(column.type) else column
