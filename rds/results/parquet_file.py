"""Results as Parquet: the description in the schema's metadata, each column's unit in its field's."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from rds.core.errors import InputError
from rds.results.arrow import to_arrow, to_numpy
from rds.results.header import describe, parse

if TYPE_CHECKING:
    from rds.results.result import Result

_DESCRIPTION = b"rds_result"


def writers(result: Result, path: Path) -> dict[Path, Callable[[BinaryIO], None]]:
    """What writes the file."""

    def write(stream: BinaryIO) -> None:
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
    import pyarrow as pa
    from pyarrow import parquet

    with open(path, "rb") as stream:
        try:
            # none of Arrow's threads: one that lets go of the stream's buffers while Python ends aborts the process
            file = parquet.ParquetFile(stream, pre_buffer=False)
            text = (file.metadata.metadata or {}).get(_DESCRIPTION)
            schema = file.schema_arrow
            numbers = [f.name for f in schema if pa.types.is_floating(f.type) or pa.types.is_integer(f.type)]
            if len(set(schema.names)) != len(schema.names):
                raise InputError("two columns have the same name; rename one")
            table = file.read(columns=numbers, use_threads=False)
        except (pa.ArrowException, OSError, ValueError) as error:
            raise InputError(f"it is not a Parquet file, or is truncated ({error}); take another copy") from error
    return {name: to_numpy(table.column(name)) for name in numbers}, None if text is None else parse(text)
