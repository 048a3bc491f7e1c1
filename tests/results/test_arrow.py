"""Columns to Arrow and back: the same numbers, and no pandas, which takes longer to import than a result to write."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from rds.results.arrow import to_arrow, to_numpy

NUMBERS = [
    np.array([0.1, np.nan, -np.inf]),
    np.arange(5),
    np.arange(12.0).reshape(4, 3)[:, 1],  # a column of rows: not contiguous
    np.arange(9)[::-2],
    np.empty(0),
]


@pytest.mark.parametrize("values", NUMBERS, ids=str)
def test_numbers_come_back(values: np.ndarray) -> None:
    arrow = to_arrow(values)
    assert arrow.equals(pa.array(values)) or np.isnan(values).any()
    back = to_numpy(pa.chunked_array([arrow]))
    assert back.dtype == values.dtype and np.array_equal(back, values, equal_nan=True)


def test_pieces_are_put_together_where_they_begin() -> None:
    whole = to_arrow(np.arange(10))
    assert to_numpy(pa.chunked_array([whole[2:4], whole[:0], whole[7:]])).tolist() == [2, 3, 7, 8, 9]
    assert to_numpy(pa.chunked_array([], pa.int64())).tolist() == []


def test_what_is_null_is_nan() -> None:
    assert np.array_equal(to_numpy(pa.chunked_array([[1.0, None], [3.0]])), [1.0, np.nan, 3.0], equal_nan=True)


def test_a_result_is_saved_and_opened_without_pandas(tmp_path: Path) -> None:
    code = """
import sys
import rds
result = rds.Result({"time": [0.0, 0.1], "X_measured": [1.0, 2.0]}, meta={"axes": ["X"], "sample_period": 0.1})
result.save("here")
for name in ("result.csv", "result.parquet", "result.mat"):
    assert (rds.open_result("here/" + name)["X_measured"] == [1.0, 2.0]).all()
assert "pandas" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
