"""MAT, Parquet, bus logs and our own results: the same numbers by every way; and the command."""

from __future__ import annotations

import gzip
import json
import struct
from pathlib import Path

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from rds.bus.modules.rds import frames
from rds.bus.tools.logs import LogWriter
from rds.cli.main import app
from rds.core.errors import InputError
from rds.identification.logs.describe import describe
from rds.identification.logs.mat_parts import parts_of
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table
from rds.results import Result
from tests.logs.data_files import MAP, axis, headed, write

EMPS = Path(__file__).resolve().parents[3] / "shared" / "data" / "emps" / "DATA_EMPS.mat"
THESIS = EMPS.parents[1]
DBC = """VERSION ""
BU_: host axis
BO_ 256 Drive: 8 host
 SG_ Voltage : 0|16@1- (0.001,0) [-10|10] "V" axis
BO_ 257 Encoder: 8 axis
 SG_ Position : 0|32@1- (0.001,0) [0|0] "mm" host
"""


def rds(*arguments: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    return done.exit_code, done.stdout, done.stderr


def test_mat_vectors_structs_matrices_and_constants(tmp_path: Path) -> None:
    from scipy.io import savemat

    made = axis()
    both = np.column_stack([made["voltage"], made["position"]])
    savemat(
        tmp_path / "log.mat", {"run": {"time": made["time"]}, "data": both, "gtau": 35.0, "who": "me", "other": [1, 2]}
    )
    text = MAP.replace('"time"', '"run.time"').replace('"voltage"', '"data_1"').replace('"position"', '"data_2"')
    (tmp_path / "log.mat.map.toml").write_text(text + 'force_gain = "gtau"\n')
    (log,) = read_log(tmp_path / "log.mat")
    assert np.array_equal(log.position, made["position"]) and np.array_equal(log.command, made["voltage"])
    assert log.force_gain == 35.0
    assert {f.what for f in log.findings if f.kind == "columns"} == {
        "left out, as they do not have 4000 values like the others: other (2); where they belong to the log, put them "
        "on its times in MATLAB, as in y = interp1(t2, y2, t), or save them as a second file",
        "left out, as they hold no real numbers: who",
    }


def test_the_coefficients_in_a_workspace_are_no_log(tmp_path: Path) -> None:
    """Of a workspace that was saved as a whole, most vectors may be those of transfer functions."""
    from scipy.io import savemat

    made = axis()
    savemat(tmp_path / "log.mat", {**made, **{f"den{k}": [1.0, 0.1 * k] for k in range(1, 8)}})
    assert set(read_table(tmp_path / "log.mat").columns) == set(made)


def test_a_cell_array_is_sent_back_with_what_to_save(tmp_path: Path) -> None:
    from scipy.io import savemat

    runs = np.empty((1, 2), dtype=object)
    runs[0, 0] = runs[0, 1] = {"time": axis()["time"]}
    savemat(tmp_path / "log.mat", {"runs": runs})
    with pytest.raises(InputError, match=r"left out: runs; of a cell array .* run = runs\{1\}; save"):
        read_table(tmp_path / "log.mat")


@pytest.mark.parametrize(("labels", "names"), [(("u", "x"), ("u", "x")), (("", ""), ("1", "2"))])
def test_the_signals_of_a_scope_are_columns(labels: tuple[str, str], names: tuple[str, str], tmp_path: Path) -> None:
    """Simulink's "structure with time": the ports of a scope are an array of structs."""
    from scipy.io import savemat

    made = axis()
    signals = np.empty((1, 2), dtype=[("values", object), ("label", object)])
    for at, (label, values) in enumerate(zip(labels, (made["voltage"], made["position"]), strict=True)):
        signals[0, at] = (values[:, None], label)
    savemat(tmp_path / "log.mat", {"scope": {"time": made["time"][:, None], "signals": signals}})
    columns = read_table(tmp_path / "log.mat").columns
    joint = "." if labels[0] else "_"
    assert np.array_equal(columns["scope.time"].values, made["time"])
    for name, values in zip(names, (made["voltage"], made["position"]), strict=True):
        assert np.array_equal(columns[f"scope.signals{joint}{name}.values"].values, values)


def test_vectors_beside_objects_of_matlab_classes_are_read(tmp_path: Path) -> None:
    """A string, a transfer function or a timetable in a file of version 7 costs that variable, not the file."""
    from scipy.io import savemat

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def opaque(name: bytes, of_class: bytes) -> bytes:
        inner = element(6, struct.pack("<II", 13, 0))  # a vector of uint32
        inner += element(5, struct.pack("<ii", 2, 1)) + element(1, b"") + element(6, struct.pack("<II", 0xDD000000, 1))
        names = element(1, name) + element(1, b"MCOS") + element(1, of_class)
        return element(14, element(6, struct.pack("<II", 17, 0)) + names + element(14, inner))

    made = axis()
    path = tmp_path / "log.mat"
    savemat(path, {name: made[name] for name in ("time", "voltage", "position")})
    path.write_bytes(path.read_bytes() + opaque(b"label", b"string") + opaque(b"tt", b"timetable"))
    (tmp_path / "log.mat.map.toml").write_text(MAP)
    (log,) = read_log(path)
    assert np.array_equal(log.position, made["position"])
    left_out = [f.what for f in log.findings if f.kind == "columns"]
    assert [what.split(",")[0] for what in left_out] == [
        "left out label: of MATLAB's class string",
        "left out tt: of MATLAB's class timetable",
    ]


@pytest.mark.parametrize("fields", [("s0", "s1", "s2", "arr"), ("s0", "_TypeSystem", "_Class", "_ObjectMetadata")])
def test_objects_in_structs_are_told_by_their_class(fields: tuple[str, ...]) -> None:
    """As scipy gives them, before and from 1.18 on."""
    from scipy.io.matlab import MatlabOpaque

    table = MatlabOpaque(np.array([("tt", "MCOS", "timetable", None)], dtype=[(name, object) for name in fields]))
    run = np.empty((1, 1), dtype=[("log", object), ("time", object)])
    run[0, 0] = table, np.arange(5.0)[:, None]
    assert [(part.name, part.of_class) for part in parts_of("run", run)] == [("run.log", "timetable"), ("run.time", "")]


def test_damaged_mat_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + bytes(400))
    with pytest.raises(InputError, match=r"version 7\.3, and is damaged or cut"):
        read_log(path)
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\x0f\x00\x00\x00\xff\xff\x00\x00rubbish")
    with pytest.raises(InputError, match="not a MAT file, or is truncated"):
        read_log(path)


def test_parquet_with_units_in_its_fields(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    made = axis()
    units = {"time": "s", "voltage": "V", "position": "mm"}
    fields = [pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit in units.items()]
    table = pa.table([pa.array(made[name]) for name in units], schema=pa.schema(fields))
    parquet.write_table(table, tmp_path / "log.parquet")
    (log,) = read_log(tmp_path / "log.parquet")
    assert np.array_equal(log.position, made["position"])


def test_parquet_of_a_database_has_decimals(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    made = axis()
    columns = {"time_s": pa.array(made["time"]).cast(pa.decimal128(18, 6)), "voltage_V": pa.array(made["voltage"])}
    columns["position_mm"] = pa.array(np.round(made["position"], 3)).cast(pa.decimal128(12, 3))
    parquet.write_table(pa.table(columns), tmp_path / "log.parquet")
    (log,) = read_log(tmp_path / "log.parquet")
    np.testing.assert_allclose(log.position, np.round(made["position"], 3), atol=1e-9)


def test_a_parquet_page_that_does_not_match_its_checksum_is_refused(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    path, made = tmp_path / "log.parquet", axis()
    columns = {"time_s": made["time"], "voltage_V": made["voltage"], "position_mm": made["position"]}
    parquet.write_table(pa.table(columns), path, compression="none", use_dictionary=False, write_page_checksum=True)
    read_log(path)
    data = bytearray(path.read_bytes())
    data[data.index(made["position"][300:302].tobytes()) + 6] ^= 8
    path.write_bytes(data)
    with pytest.raises(InputError, match="checksum"):
        read_log(path)


@pytest.mark.parametrize("ending", [".asc", ".blf", ".log", ".trc", ".log.gz", ".csv"])
def test_bus_logs_with_a_dbc(tmp_path: Path, ending: str) -> None:
    made = axis(600)
    path = tmp_path / f"bus{ending}"
    writer = LogWriter(path)
    for t, u, y in zip(made["time"], made["voltage"], made["position"], strict=True):
        drive = round(u * 1000).to_bytes(2, "little", signed=True) + bytes(6)
        encoder = round(y * 1000).to_bytes(4, "little", signed=True) + bytes(4)
        for offset, identifier, data in ((0.0, 256, drive), (2e-4, 257, encoder)):
            stamp = float(1000.0 + t + offset)
            writer.write(can.Message(timestamp=stamp, arbitration_id=identifier, data=data, is_extended_id=False))
    writer.close()
    (tmp_path / "axis.dbc").write_text(DBC)
    (tmp_path / f"bus{ending}.map.toml").write_text("""
[bus]
dbc = "axis.dbc"
[axis.X]
command = "Drive.Voltage"
position = "Encoder.Position"
""")
    (log,) = read_log(path)
    assert len(log) == 600
    assert np.allclose(log.position, made["position"], atol=1e-9) and np.allclose(
        log.command, made["voltage"], atol=1e-9
    )
    assert np.allclose(np.diff(log.time), 1e-3, atol=3e-6)
    assert log.clocks[0].source.startswith("times of receipt by the recorder of the bus")
    assert any("the last received value is held: it is 0.0002 s old" in f.what for f in log.findings)


def test_our_own_frames_need_no_dbc(tmp_path: Path) -> None:
    made = axis(600)
    path = tmp_path / "own.blf"
    writer = LogWriter(path)
    for k, (u, y) in enumerate(zip(made["voltage"], made["position"], strict=True)):
        answer = frames.encode_answer(frames.Answer(round(y * 1000), 1, frames.Kind.ANSWER, k))
        for offset, identifier, data in ((0.0, 0x010, frames.encode_voltages([u])), (1e-4, 0x022, answer)):
            stamp = 1.0 + k * 1e-3 + offset
            writer.write(can.Message(timestamp=stamp, arbitration_id=identifier, data=data, is_extended_id=False))
    writer.close()
    text = '[axis.X]\ncommand = "command.slot_0"\nposition = "answer_2.position"\n'
    (tmp_path / "own.blf.map.toml").write_text('machine = "mini-cnc"\n' + text)
    (log,) = read_log(path)
    assert np.allclose(log.position, made["position"], atol=1e-9)
    assert np.allclose(log.command, made["voltage"], atol=10.0 / 16384.0)


def test_frames_that_nothing_knows(tmp_path: Path) -> None:
    path = tmp_path / "bus.blf"
    writer = LogWriter(path)
    writer.write(can.Message(timestamp=1.0, arbitration_id=0x7F3, data=b"abc", is_extended_id=False))
    writer.close()
    with pytest.raises(
        InputError, match=r"none of its 1 frames is known \(unknown identifiers: 0x7f3; .*give the DBC file"
    ):
        read_log(path)


@pytest.mark.parametrize("ending", ["", ".csv", ".mat", ".parquet"])
def test_our_own_results_explain_themselves(tmp_path: Path, ending: str) -> None:
    made = axis(1000)
    columns = {"time": made["time"], "X_voltage": made["voltage"], "X_measured": made["position"]}
    meta = {"axes": ["X"], "sample_period": 1e-3, "mode": "system-test", "machine": "mini-cnc", "voltage_range": 10.0}
    where = Result(columns, {}, meta).save(tmp_path / f"run{ending}")
    (log,) = read_log(where)
    assert np.array_equal(log.position, made["position"]) and np.array_equal(log.command, made["voltage"])
    assert (log.closed_loop, log.resolution, log.voltage_range) == (False, 0.001, (-10.0, 10.0))
    assert len(log.sha256) == 64


@pytest.mark.parametrize(
    ("controller", "reference", "closed"), [({}, False, False), ({"X": {"name": "p"}}, True, True), ({}, True, True)]
)
def test_a_simulated_voltage_is_no_closed_loop(
    tmp_path: Path, controller: dict[str, object], reference: bool, closed: bool
) -> None:
    made = axis(1000)
    columns = {"time": made["time"], "X_voltage": made["voltage"], "X_measured": made["position"]}
    columns |= {"X_reference": made["position"]} if reference else {}
    meta = {"axes": ["X"], "sample_period": 1e-3, "mode": "simulation", "machine": "mini-cnc", "controller": controller}
    (log,) = read_log(Result(columns, {}, meta).save(tmp_path / "run"))
    assert log.closed_loop is closed


# --- the command


def test_describe_as_json_with_a_picture(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis()))
    code, out, _ = rds("data", "describe", path, "--json", "--plot", tmp_path / "log.png")
    about = json.loads(out)
    assert code == 0 and about["usable"] and about["map"] == "guessed"
    assert (tmp_path / "log.png").read_bytes().startswith(b"\x89PNG")
    position = about["columns"][2]
    assert (position["name"], position["unit"], position["values"], position["missing"]) == ("position", "mm", 4000, 0)
    assert position["step"] == 0.001 and position["low"] == axis()["position"].min()
    (log,) = about["logs"]
    assert log["samples"] == 4000 and log["quantities"]["command"] == {"unit": "V", "low": -4.0, "high": 4.0}


def test_describe_without_a_map_drafts_one_and_says_that_it_is_a_draft(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", axis())
    code, out, _ = rds("data", "describe", path)
    assert code == 1 and "nothing gives its unit" in out and "[axis.axis.position]" in out
    code, out, err = rds("data", "describe", path, "--write-map")
    assert code == 1 and "a draft" in err and "unit = '?' is the draft's mark" in err  # as without --write-map
    assert "nothing gives its unit" in out and f"wrote {path}.map.toml" in out and "[axis." not in out
    draft = tmp_path / "log.csv.map.toml"
    for unit in ("s", "V", "mm"):  # which the file does not tell, and no draft invents
        draft.write_text(draft.read_text().replace('unit = "?"', f'unit = "{unit}"', 1))
    assert rds("data", "describe", path)[0] == 0
    code, _, err = rds("data", "describe", path, "--write-map")
    assert code == 2 and "exists already" in err


def test_a_draft_with_columns_that_nothing_tells_asks_for_them(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t_s;p1;p2\n" + "".join(f"{k / 1000};{k % 7};{k}\n" for k in range(50)))
    code, _, err = rds("data", "describe", path, "--write-map")
    assert code == 1 and "log.csv.map.toml, a draft" in err
    mark = "column = '?' is the draft's mark for what the file does not tell: name one of its columns"
    assert f"{mark}; there is one in lines 10, 11, 14 and 15" in err
    draft = tmp_path / "log.csv.map.toml"
    for mark, said in (("column", "p1"), ("unit", "V"), ("column", "p2"), ("unit", "mm")):
        draft.write_text(draft.read_text().replace(f'{mark} = "?"', f'{mark} = "{said}"', 1))
    assert rds("data", "describe", path)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nope.csv"], "there is no such file"),
        (["log.xyz"], "no log of the ending '.xyz'"),
        (["log.csv", "--plot", "x.pdf"], "must end in .png"),
        (["log.csv", "--map", "nope.toml"], "nope.toml: cannot be read"),
        (["empty"], "holds no result"),
    ],
)
def test_what_describe_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "log.csv", headed(axis(300)))
    (tmp_path / "log.xyz").write_text("1,2\n")
    (tmp_path / "empty").mkdir()
    code, out, err = rds("data", "describe", *arguments)
    assert (code, out) == (2, "") and sentence in err and "Traceback" not in err


@pytest.mark.skipif(not EMPS.is_file(), reason="the EMPS data are not here")
def test_the_emps_data(tmp_path: Path) -> None:
    map_file = tmp_path / "emps.toml"
    map_file.write_text("""
[time]
column = "t"
unit = "s"
[axis.EMPS]
command = { column = "vir", unit = "V" }
position = { column = "qm", unit = "m" }
reference = { column = "qg", unit = "m" }
force_gain = "gtau"
""")
    (log,) = read_log(EMPS, map_file)
    assert len(log) == 24841 and log.force_gain == pytest.approx(35.15065188)
    assert log.position.max() == pytest.approx(246.37775)  # mm
    assert log.resolution == pytest.approx(5e-5)  # mm
    assert log.closed_loop is True  # found in the data
    assert [f.kind for f in log.findings if f.gravity != "note"] == ["closed-loop"]


@pytest.mark.skipif(not THESIS.is_dir(), reason="the thesis's data are not here")
@pytest.mark.parametrize(
    ("stem", "report"),
    [("encoder_counts", "accuracy"), ("move_times", "moves"), ("current", "current"), ("vibration", "vibration")],
)
def test_readings_that_are_no_time_series_are_sent_to_their_report(stem: str, report: str) -> None:
    files = sorted(THESIS.glob(f"oacs_{stem}*.csv"))
    assert files
    for file in files:
        found = describe(file)
        assert not found.usable and not found.draft
        (fault,) = [f.what for f in found.findings if f.gravity == "fault"]
        assert fault.startswith("it is no log over time: ") and f"`rds report {report}`" in fault


def test_lines_of_json_are_refused_with_what_turns_them_into_a_table(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text('{"t": 0.0, "u": 1.0}\n')
    with pytest.raises(InputError, match="lines=True"):
        read_table(path)


OCTAVE = b"# Created by Octave 8.4.0\n" + b"".join(
    b"# name: %s\n# type: matrix\n# rows: 50\n# columns: 1\n%s\n\n" % (name, b" 0.5\n" * 50) for name in (b"t", b"u")
)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("log.csv", gzip.compress(b"t,u\n" + b"1,2\n" * 30, mtime=0), "packed by gzip"),
        ("log.csv", b"PK\x03\x04" + bytes(40) + b"\n" + bytes(9), "a zip, as spreadsheets"),
        ("log.txt", b"PAR1" + bytes(40), "it is Parquet: let its name end in .parquet"),
        ("log.mat", b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", "git lfs pull"),
        ("log.csv", b"\n<!DOCTYPE html><html><body>404</body></html>", "a web page, and no data"),
        ("log.mat", OCTAVE, "save -v7 log.mat t u y"),
        ("log.txt", OCTAVE, "save -v7 log.mat t u y"),
        ("log.trc", b"#9000002000WAVEDESC" + bytes(40), "a waveform of an oscilloscope"),
        ("log.csv.gz", gzip.compress(b"t,u\n" + b"1,2\n" * 30, mtime=0), "only bus logs .*gunzip -k FILE"),
        ("log.json.gz", gzip.compress(b"{}", mtime=0), "only bus logs .*gunzip -k FILE"),
        ("log.log", b"TLOG0003\0" + bytes(range(256)) * 9, "it is not text"),
        ("log.txt", b'[{"t":0.0,"u":2.0},{"t":0.1,"u":2.0}]', "it is JSON: in Python `pandas.read_json.FILE"),
    ],
)
def test_files_that_are_not_what_their_names_say_are_told(tmp_path: Path, name: str, data: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=said):
        read_table(tmp_path / name)


def test_one_matrix_of_octave_is_a_table(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_bytes(OCTAVE[: OCTAVE.index(b"# name: u")])
    (column,) = read_table(tmp_path / "log.txt").columns.values()
    assert len(column.values) == 50


def test_times_of_day_in_parquet_are_times(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    times = pa.array(1000 * np.arange(300) + 43_200_000_000, pa.time64("us"))
    parquet.write_table(pa.table({"time": times, "u [V]": np.ones(300)}), tmp_path / "log.parquet")
    time = read_table(tmp_path / "log.parquet").columns["time"]
    assert time.unit == "s" and np.allclose(np.diff(time.values), 0.001) and time.values[0] == 43200.0


def test_lines_of_json_in_a_text_file_are_told_too(tmp_path: Path) -> None:
    path = tmp_path / "VESC_LOG.TXT"
    path.write_text('{"rpm":0,"t":1.776034,"dutyCycleNow":0.002}\n' * 20)
    with pytest.raises(InputError, match="its lines are JSON"):
        read_table(path)
