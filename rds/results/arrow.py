"""Columns of numbers to Arrow and back by their memory: pyarrow's own ways import pandas, which takes 0.3 s."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyarrow as pa


def to_arrow(values: np.ndarray) -> pa.Array:
    """A one-dimensional array of whole numbers or floats as Arrow's; NaN stays NaN, and nothing is null."""
    import pyarrow as pa

    values = np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(values)])


def repeated(text: str, count: int) -> pa.Array:
    """A column of `count` times the same text, which is kept once."""
    import pyarrow as pa

    data = text.encode()
    parts = [None, pa.py_buffer(np.array([0, len(data)], np.int32)), pa.py_buffer(data)]
    return pa.DictionaryArray.from_arrays(
        to_arrow(np.zeros(count, np.int32)), pa.Array.from_buffers(pa.string(), 1, parts)
    )


def to_numpy(column: pa.ChunkedArray) -> np.ndarray:
    """A column of whole numbers or floats as a one-dimensional array; what is null becomes NaN."""
    if column.null_count:
        return column.to_numpy()
    dtype = np.dtype(column.type.to_pandas_dtype())
    chunks = [_memory(chunk, dtype) for chunk in column.chunks if len(chunk)]
    return chunks[0] if len(chunks) == 1 else np.concatenate([np.empty(0, dtype), *chunks])


def _memory(chunk: pa.Array, dtype: np.dtype) -> np.ndarray:
    return np.frombuffer(chunk.buffers()[1], dtype, len(chunk), chunk.offset * dtype.itemsize)
