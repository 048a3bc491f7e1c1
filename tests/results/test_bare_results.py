"""Results without pyarrow and scipy: the same files, to the last bit, and a refusal that names what is missing."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from scipy.io import loadmat, savemat
from test_result_files import assert_same, results

from rds.core.errors import InputError
from rds.results import Result, csv_file, files, mat5, mat_file, open_result, save_all, save_result


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found where neither is installed."""
    for name in ("pyarrow", "scipy", "scipy.io", "pandas"):
        monkeypatch.setitem(sys.modules, name, None)
    for module in (files, csv_file):
        monkeypatch.setattr(module, "there", lambda name: False)


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(result=results())
def test_every_result_reopens_bit_for_bit_in_both(
    tmp_path: Path, suffix: str, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_arrow = save_result(result, tmp_path / f"a{suffix}")
    with monkeypatch.context() as patch:
        patch.setattr(csv_file, "there", lambda name: False)
        patch.setitem(sys.modules, "scipy.io", None)
        without = save_result(result, tmp_path / f"b{suffix}")
        assert_same(open_result(without), result)
        assert_same(open_result(with_arrow), result)
    assert_same(open_result(without), result)


def test_a_folder_is_saved_and_reopened_without_parquet(bare: None, tmp_path: Path, result: Result) -> None:
    (tmp_path / "result.parquet").write_bytes(b"of an earlier run")
    assert set(save_all(result, tmp_path)) == {"csv", "json", "mat"} == set(files.saved_files(tmp_path))
    assert not (tmp_path / "result.parquet").exists(), "it would be opened in place of this one"
    assert_same(open_result(tmp_path), result)


def test_a_folder_with_parquet_from_elsewhere_opens_by_its_csv(
    tmp_path: Path, result: Result, request: pytest.FixtureRequest
) -> None:
    save_all(result, tmp_path)
    request.getfixturevalue("bare")
    assert_same(open_result(tmp_path), result)
    with pytest.raises(InputError, match=r"result\.parquet: a Parquet file needs pyarrow, .*; or use \.csv or \.mat"):
        open_result(tmp_path / "result.parquet")
    with pytest.raises(InputError, match=r"a DataFrame needs pandas, .* or take the columns as arrays"):
        _ = result.table


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time [s],X_measured [mm]\n0,1\n0.1,x\n", "could not convert string 'x' to float64 at row 1, column 2"),
        ("time [s],X_measured [mm]\n0,1\n0.1\n", "cannot be read: .*every cell must be a number"),
        ("time [s],X_measured [mm]\n0,1\n0.1,\n", "could not convert string ''"),
    ],
)
def test_a_table_with_a_fault_is_refused(bare: None, text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        open_result(tmp_path / "a.csv")


def test_a_spreadsheet_s_table_opens(bare: None, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes("time [s];X_measured [mm]\r\n0;1,5\r\n0,1;-2e-3\r\n".encode("utf-8-sig"))
    found = open_result(tmp_path / "a.csv")
    assert found["time"].tolist() == [0.0, 0.1] and found["X_measured"].tolist() == [1.5, -0.002]


VARIABLES = {
    "doubles": np.array([[0.1], [np.nan], [-np.inf]]),
    "whole": np.array([[2**53 + 1, -5]]),
    "small": np.arange(6, dtype=np.uint8).reshape(2, 3),
    "single": np.float32([[1.5]]),
    "cube": np.arange(24.0).reshape(2, 3, 4),
    "none": np.zeros((0, 1)),
    "text": "Grüße",
}


@pytest.mark.parametrize("packed", [True, False])
def test_scipy_s_files_are_read_as_scipy_reads_them(packed: bool, tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", VARIABLES, do_compression=packed)
    expected = {name: value for name, value in loadmat(tmp_path / "a.mat").items() if not name.startswith("__")}
    found = mat5.read(tmp_path / "a.mat")
    assert list(found) == list(expected) == mat5.names(tmp_path / "a.mat")
    for name, value in expected.items():
        assert found[name].dtype == value.dtype and found[name].shape == value.shape
        assert np.array_equal(found[name], value, equal_nan=name == "doubles")


@pytest.mark.parametrize("value", [{"a": 1.0}, np.array([[1j]]), np.array([[1, "a"]], dtype=object), ["a", "bc"]])
def test_what_only_scipy_reads_is_left_to_it(value: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    savemat(tmp_path / "a.mat", {"odd": value})
    assert "odd" in mat_file.variables(tmp_path / "a.mat")
    monkeypatch.setitem(sys.modules, "scipy.io", None)
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(InputError, match="needs scipy, which is not installed"):
        mat_file.variables(tmp_path / "a.mat")


def test_no_damaged_file_passes_for_a_whole_one(tmp_path: Path, result: Result) -> None:
    """Cut anywhere it is refused, or lacks whole variables, which its description tells."""
    whole = save_result(result, tmp_path / "a.mat").read_bytes()
    names = mat5.names(tmp_path / "a.mat")
    ends = {128}  # behind the header and each variable
    while max(ends) < len(whole):
        ends.add(max(ends) + 8 + struct.unpack_from("<II", whole, max(ends))[1])
    generator = np.random.default_rng(1)
    for cut in generator.integers(0, len(whole), 200).tolist():
        (tmp_path / "b.mat").write_bytes(whole[:cut])
        if cut in ends:
            assert mat5.names(tmp_path / "b.mat") == names[: sorted(ends).index(cut)]
            continue
        with pytest.raises(mat5.OtherFileError):
            mat5.read(tmp_path / "b.mat")


@pytest.mark.parametrize("packed", [True, False])
def test_a_wrong_byte_does_no_more_harm_than_that(packed: bool, tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", VARIABLES, do_compression=packed)
    whole = (tmp_path / "a.mat").read_bytes()
    generator = np.random.default_rng(1)
    for at, byte in zip(generator.integers(0, len(whole), 1000), generator.integers(0, 256, 1000), strict=True):
        damaged = bytearray(whole)
        damaged[at] = byte
        (tmp_path / "b.mat").write_bytes(damaged)
        try:
            mat5.read(tmp_path / "b.mat")
            mat5.names(tmp_path / "b.mat")
        except mat5.OtherFileError:
            continue
