"""What is saved comes back bit for bit; what is not whole or not a result is refused with a remedy."""

from __future__ import annotations

import json
import os
import pickle
import signal
import string
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_results import make_result
from pyarrow import parquet
from scipy.io import savemat

from rds.core.atomic import write_files
from rds.core.errors import InputError
from rds.results import Result, open_result, save_all, save_result

SUFFIXES = [".csv", ".mat", ".parquet"]


def assert_same(a: Result, b: Result) -> None:
    assert list(a) == list(b)
    for name in a:
        assert a[name].dtype == b[name].dtype, name
        assert a[name].tobytes() == b[name].tobytes(), name
    assert a.units == b.units
    assert a.meta == b.meta


finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=40)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | finite | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@st.composite
def results(draw: st.DrawFn) -> Result:
    rows = draw(st.integers(0, 5))
    columns: dict[str, np.ndarray] = {"time": np.sort(draw(arrays(float, rows, elements=finite, unique=True)))}
    for name in draw(st.lists(names, max_size=3, unique=True)):
        dtype = draw(st.sampled_from(["float64", "int64"]))
        elements = finite if dtype == "float64" else st.integers(-(2**63), 2**63 - 1)
        columns.setdefault(name, draw(arrays(dtype, rows, elements=elements)))
    columns["X_command"] = draw(arrays(float, rows, elements=st.sampled_from([np.nan, np.inf, -np.inf, -0.0, 1e-310])))
    units = {name: draw(st.sampled_from(["mm", "µs", "mm/s²", "", '"a, b"'])) for name in columns}
    meta = draw(st.dictionaries(st.text(string.ascii_letters, max_size=6), json_values, max_size=3))
    return Result(columns, units, {**meta, "axes": ["X"], "sample_period": 0.001, "period": {"X": None}})


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(result=results())
def test_every_result_reopens_bit_for_bit(tmp_path: Path, suffix: str, result: Result) -> None:
    path = save_result(result, tmp_path / f"any{suffix}")
    assert_same(open_result(path), result)


def test_save_all_writes_every_kind_and_the_directory_reopens(tmp_path: Path, result: Result) -> None:
    files = save_all(result, tmp_path / "new" / "run")
    assert {kind: path.name for kind, path in files.items()} == {
        "csv": "result.csv",
        "json": "result.json",
        "mat": "result.mat",
        "parquet": "result.parquet",
    }
    assert sorted(p.name for p in (tmp_path / "new" / "run").iterdir()) == sorted(p.name for p in files.values())
    for path in (tmp_path / "new" / "run", files["csv"], files["mat"], files["parquet"]):
        assert_same(Result.open(path), result)
    assert result.save(tmp_path / "other") == tmp_path / "other"
    assert (tmp_path / "other" / "result.mat").is_file()


def test_the_csv_is_headed_with_units_and_the_sidecar_has_the_metrics(tmp_path: Path, result: Result) -> None:
    path = result.save(tmp_path / "run.csv")
    assert path.read_text().startswith("time [s],X_reference [mm],X_reference_velocity [mm/s],")
    beside = json.loads((tmp_path / "run.json").read_text())
    assert beside["metrics"] == result.metrics
    assert beside["meta"]["environment"]["scheduler"] == "fifo"


def test_matlab_gets_names_it_can_have(tmp_path: Path) -> None:
    from scipy.io import loadmat

    odd = Result({"time": [0.0, 1.0], "2nd-axis_measured": [1.0, 2.0]}, meta={"axes": ["2nd-axis"], "sample_period": 1})
    content = loadmat(odd.save(tmp_path / "odd.mat"))
    about = json.loads(content["rds_result"].item())
    assert content["time"].shape == (2, 1)
    assert about["columns"][1]["variable"] == "column_1"
    assert content["column_1"].ravel().tolist() == [1.0, 2.0]


# --- whole or not at all ------------------------------------------------------------------------------------------


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, result: Result) -> None:
    kept = result.save(tmp_path / "run.parquet").read_bytes()

    def half(stream):  # type: ignore[no-untyped-def]
        stream.write(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="cannot write: No space left on device"):
        write_files({tmp_path / "new.csv": lambda s: s.write(b"whole"), tmp_path / "run.parquet": half})
    assert [p.name for p in tmp_path.iterdir()] == ["run.parquet"]
    assert (tmp_path / "run.parquet").read_bytes() == kept


def test_a_failure_that_is_no_oserror_also_leaves_nothing(tmp_path: Path) -> None:
    def fail(stream):  # type: ignore[no-untyped-def]
        stream.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_files({tmp_path / "a": fail})
    assert not list(tmp_path.iterdir())


def test_a_killed_writer_leaves_the_old_file_whole(tmp_path: Path, result: Result) -> None:
    target = result.save(tmp_path / "run.mat")
    before = target.read_bytes()
    program = (
        "import sys, time\nfrom pathlib import Path\nfrom rds.core.atomic import write_files\n"
        "def slow(stream):\n"
        "    stream.write(b'x' * 100000); stream.flush(); print('writing', flush=True); time.sleep(60)\n"
        "write_files({Path(sys.argv[1]): slow})\n"
    )
    writer = subprocess.Popen([sys.executable, "-c", program, str(target)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    assert writer.stdout.readline() == "writing\n"
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    writer.stdout.close()
    assert target.read_bytes() == before
    assert_same(open_result(tmp_path), result)


def test_a_place_that_cannot_be_written_is_an_input_error(tmp_path: Path, result: Result) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"file.*cannot write"):
        save_all(result, tmp_path / "file")
    (tmp_path / "run.csv").mkdir()
    with pytest.raises(InputError, match=r"run\.csv: cannot write"):
        result.save(tmp_path / "run.csv")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "run.csv"]


# --- bad files ----------------------------------------------------------------------------------------------------


def refused(path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        open_result(path)
    assert str(path) in str(caught.value)


def test_missing_unknown_and_several(tmp_path: Path, result: Result) -> None:
    refused(tmp_path / "none.csv", "no such file")
    (tmp_path / "run.xlsx").write_bytes(b"PK")
    refused(tmp_path / "run.xlsx", r"unknown suffix '\.xlsx'; results are \.parquet, \.csv, \.mat")
    with pytest.raises(InputError, match="unknown suffix"):
        result.save(tmp_path / "run.xlsx")
    refused(tmp_path, "holds no result")
    result.save(tmp_path / "a.mat")
    assert_same(open_result(tmp_path), result)
    result.save(tmp_path / "b.parquet")
    refused(tmp_path, r"several results \(a\.mat, b\.parquet\); name one")
    save_all(result, tmp_path / "demo" / "simulation")
    refused(tmp_path / "demo", r"directories of their own \(simulation\)")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("part", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_refused(tmp_path: Path, result: Result, suffix: str, part: float) -> None:
    path = result.save(tmp_path / f"run{suffix}")
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * part)])
    refused(path, "truncated|not a table")


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400))
def test_noise_is_refused_with_the_file_named(tmp_path: Path, suffix: str, data: bytes) -> None:
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(data)
    refused(path, "noise")


@pytest.mark.parametrize("suffix", [".mat", ".parquet"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0, 0.999), value=st.integers(0, 255))
def test_a_damaged_file_opens_or_is_refused_but_never_breaks(
    tmp_path: Path, suffix: str, where: float, value: int
) -> None:
    path = make_result(seconds=0.05).save(tmp_path / f"run{suffix}")
    data = bytearray(path.read_bytes())
    data[int(len(data) * where)] = value
    path.write_bytes(data)
    try:
        open_result(path)
    except InputError as error:
        assert str(path) in str(error)


def test_a_changed_table_does_not_pass_for_the_saved_one(tmp_path: Path, result: Result) -> None:
    path = result.save(tmp_path / "run.csv")
    path.write_text(path.read_text().replace("\n0,", "\n0.0,", 1))
    refused(path, r"not the one that run\.json describes.*move run\.json away")
    (tmp_path / "run.json").unlink()
    assert open_result(path).axes == ["X"]
    result.save(path)
    (tmp_path / "run.json").write_text("{")
    refused(path, "not valid JSON")


def test_a_newer_format_says_so(tmp_path: Path, result: Result) -> None:
    path = result.save(tmp_path / "run.csv")
    about = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(about | {"version": 99}))
    refused(path, "version 99")


class Bomb:
    def __reduce__(self):  # type: ignore[no-untyped-def]
        return os.system, ("touch executed",)


def test_hostile_files_execute_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for suffix in SUFFIXES:
        (tmp_path / f"pickle{suffix}").write_bytes(pickle.dumps(Bomb()))
        refused(tmp_path / f"pickle{suffix}", "pickle")
    table = pa.table({"time": [0.0, 1.0], "X_measured": [b"a", pickle.dumps(Bomb())]})
    parquet.write_table(table.replace_schema_metadata({"ARROW:extension:name": "arrow.py_extension_type"}), "b.parquet")
    refused(tmp_path / "b.parquet", "not a result")
    savemat("c.mat", {"rds_result": np.array([pickle.dumps(Bomb())], dtype=object), "time": [0.0, 1.0]})
    refused(tmp_path / "c.mat", "not a text")
    assert not (tmp_path / "executed").exists()


# --- tables from elsewhere ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "t,X_measured,note_taken\n0.0,1,7\n0.1,2.5,7\n0.2,3,7\n",
        "\ufefftime (s);X_measured (mm);x\r\n0;1;7\r\n0,1;2,5;7\r\n0,2;3;7\r\n",
        "time [s]\tX_measured [mm]\n0\t1\n0.1\t2.5\n0.2\t3",
    ],
    ids=["plain", "spreadsheet", "tabs"],
)
def test_a_bare_csv_opens_with_what_it_has(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bare.csv"
    path.write_text(text, encoding="utf-8", newline="")
    result = open_result(path)
    assert result.axes == ["X"]
    assert result.sample_period == 0.1
    assert result["X_measured"].tolist() == [1.0, 2.5, 3.0]
    assert result.units["X_measured"] == "mm"
    assert result.metrics == {"X": {}}


@pytest.mark.parametrize(
    "text, message",
    [
        ("a,b\n1,2\n", "not a result: it needs a column 'time'.*it has a, b"),
        ("time,X_measured\n0,1\n1,nan\n", "'X_measured' holds nan at sample 1"),
        ("time,X_measured\n0,1\n1,\n", "'X_measured' holds nan at sample 1"),
        ("time,X_measured\n0,1\n1\n", "Expected 2 columns, got 1"),
        ("time,X_measured\n0,1\n1,abc\n", "abc.*must be a number"),
        ("time,X_measured\n0,1\n0,2\n", "time|too few samples"),
        ("time,X_measured\n0,1\n1,2\n1,2\n3,1\n", "time does not increase at sample 2: 1.0 s, then 1.0 s"),
        ("time [ms],X_measured\n0,1\n1,2\n", "time is in 'ms'"),
        ("time,time,X_measured\n0,0,1\n1,1,2\n", "same heading"),
        ("time,t,X_measured\n0,0,1\n1,1,2\n", "two columns are called 'time'"),
        ("time,X_measured\n", "too few samples"),
        ("", "not a table"),
    ],
)
def test_a_bad_csv_says_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    refused(path, message)


def test_bad_columns_are_refused_when_made() -> None:
    meta = {"axes": ["X"], "sample_period": 0.1}
    for columns, message in [
        ({"time": [0.0, 1.0], "X_measured": [1.0]}, "different lengths: time has 2 samples, but X_measured 1"),
        ({"X_measured": [1.0]}, "no column 'time'"),
        ({"time": [[0.0]]}, r"shape \(1, 1\)"),
        ({"time": [0.0], "x": ["a"]}, "must hold real numbers"),
        ({"time": [0.0], "x": [1j]}, "must hold real numbers"),
        ({"time": [0.0], "bad\nname": [1.0]}, "printable"),
    ]:
        with pytest.raises(InputError, match=message):
            Result(columns, meta=meta)
    for bad, message in [
        ({}, r"meta\['axes'\] is None"),
        ({"axes": ["X"], "sample_period": 0}, "more than 0"),
        ({**meta, "odd": object()}, r"meta\['odd'\] is a object"),
    ]:
        with pytest.raises(InputError, match=message):
            Result({"time": [0.0]}, meta=bad)
    with pytest.raises(InputError, match="units name a column 'y'"):
        Result({"time": [0.0]}, {"y": "mm"}, meta)


# --- a run that could not save ------------------------------------------------------------------------------------


def test_the_record_of_a_killed_run_reopens(tmp_path: Path) -> None:
    """Two whole rows and a torn third, as a kill leaves them; then the ending that a live run would have noted."""
    about = {
        "columns": ["sample", "lateness", "X_reference", "X_measured"],
        "units": {"lateness": "ns", "X_reference": "mm", "X_measured": "mm"},
        "axes": ["X"],
        "mode": "emulation",
        "sample_period": 0.001,
        "samples": 10,
    }
    rows = np.array([[0, 1500, 1.0, 0.5], [1, 2500, 1.0, 0.75], [2, 0, 0, 0]])
    data = b"RDS record 1\n" + json.dumps(about).encode() + b"\n" + rows.tobytes()
    (tmp_path / "record.rds").write_bytes(data[:-9])
    result = open_result(tmp_path)
    assert result["time"].tolist() == [0.0, 0.001]
    assert result["lateness"].tolist() == [1.5, 2.5]
    assert result.units["lateness"] == "µs"
    assert result.metrics["X"]["mean_error"] == 0.375
    assert result.meta["ending"] == "killed"
    assert "2 of 10 samples" in result._repr_html_()
    (tmp_path / "ending.json").write_text(json.dumps({"ending": "stopped", "reason": "asked to"}))
    assert open_result(tmp_path / "record.rds").meta["ending"] == "stopped"
    other = make_result(seconds=1.0)
    save_all(other, tmp_path)
    assert_same(open_result(tmp_path), other)


def test_a_broken_record_is_refused(tmp_path: Path) -> None:
    for data, message in [
        (b"", "is not a run's record"),
        (b"RDS record 1\n{}\n", "header"),
        (b'RDS record 1\n{"columns": ["sample"]}\n', "header lacks 'units'"),
    ]:
        (tmp_path / "record.rds").write_bytes(data)
        refused(tmp_path, message)


def test_reopening_is_quick(tmp_path: Path) -> None:
    """A minute of three axes at 1 kHz: reopening must not be a reason to run again."""
    path = make_result("implementation", "XYZ", 60.0).save(tmp_path / "run.parquet")
    started = time.process_time()  # whatever else the computer does
    open_result(path)
    assert time.process_time() - started < 2.0


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc, which Linux has")
def test_reading_parquet_starts_no_thread_that_could_outlive_it(tmp_path: Path, result: Result) -> None:
    """One that still held a buffer of Python's while Python ended aborted the process, now and then, after its work."""
    path = result.save(tmp_path / "run.parquet")
    program = (
        "import os, sys, pandas, pyarrow.parquet, rds\n"
        "def threads(): return set(os.listdir('/proc/self/task'))\n"
        "rds.open_result(sys.argv[2])\n"
        "before = threads()\n"
        "rds.open_result(sys.argv[1])\n"
        "print(len(threads() - before))\n"
    )
    other = result.save(tmp_path / "run.mat")  # what else it takes to open a result is loaded by this one
    said = subprocess.run([sys.executable, "-c", program, path, other], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["0"]
