"""What all reports share: whole files, JSON, pictures with units, light imports, bad input refused with a remedy."""

from __future__ import annotations

import json
import subprocess
import sys
from math import cos, sin
from pathlib import Path
from typing import Any

import can
import pytest
from thesis_data import COUNTS_X, CURRENT_X, DRILLING, MOVE_TIMES, RECONFIGURATION, VIBRATION, save
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.results.reports import KINDS, Report, make_report, option_table, options_of, write

MOVE = {"distance": "80", "counts_per_unit": "169"}
LOG = "time_s,id,data\n0,001,01\n0.002,000,0102\n0.003,000,0103\n"
SPEED = "time [s],X_reference_velocity [mm/s],X_measured [mm]\n" + "".join(
    f"{0.01 * k:.2f},6.0,{0.06 * k:.6f}\n" for k in range(200)
)
FACE = {"x_mm": [0, 10, 0, 10, 5], "y_mm": [0, 0, 10, 10, 5], "z_mm": [16.60, 16.61, 16.63, 16.64, 16.70]}
PATH = (
    "segment,line,rapid,plane,start_x_mm,start_y_mm,start_z_mm,end_x_mm,end_y_mm,end_z_mm,centre_x_mm,centre_y_mm,"
    "centre_z_mm,sweep_deg\n0,2,1,-1,0,0,0,70,20,0,0,0,0,0\n1,3,0,-1,70,20,0,0,20,0,0,0,0,0\n"
    "2,4,0,-1,0,20,0,0,0,0,0,0,0,0\n"
)
GAUGES = "time_s,x_mm,y_mm,z_mm,segment\n0,0,0,0,0\n1,20,20,0,0\n3,70,20,0,1\n4,0,20,0,1\n5,0,10,0,2\n6,0,0,0,2\n"
CIRCLE = "x_mm,y_mm\n" + "".join(
    f"{10 * cos(k / 90):.6f},{10.01 * sin(k / 90):.6f}\n" for k in (*range(600), *range(600, 0, -1))
)
DATA: dict[str, tuple[Any, dict[str, str]]] = {
    "accuracy": (COUNTS_X, MOVE),
    "moves": (MOVE_TIMES, {}),
    "response": (LOG, {}),
    "current": (CURRENT_X, {}),
    "vibration": (VIBRATION, {"windows": "rest=1-5, work=6-11"}),
    "reconfiguration": (RECONFIGURATION, {}),
    "speed": (SPEED, {"pulse": "0.005"}),
    "flatness": (FACE, {"tolerance": "0.1"}),
    "circular": (CIRCLE, {"radius": "10"}),
    **dict.fromkeys(("return-error", "unsynchronized-rapids", "path-error"), ((GAUGES, PATH), {})),
}


def report_of(kind: str, tmp_path: Path, name: str = "data.csv") -> Report:
    table, options = DATA[kind]
    path = tmp_path / name
    if isinstance(table, tuple):
        path.write_text(table[0])
        (tmp_path / "path.csv").write_text(table[1])
        return make_report(kind, [path, tmp_path / "path.csv"], options)
    if isinstance(table, str):
        path.write_text(table)
    else:
        save(path, table)
    return make_report(kind, [path], options)


@pytest.mark.parametrize("kind", KINDS.names())
def test_every_report_is_written_whole(kind: str, tmp_path: Path) -> None:
    report = report_of(kind, tmp_path)
    files = write(report, tmp_path / "out")
    assert sorted(files) == sorted((tmp_path / "out").iterdir())
    endings = [path.suffix for path in files]
    assert endings.count(".csv") == len(report.tables) and endings.count(".png") == len(report.figures)
    page = files[0].read_text(encoding="utf-8")
    assert files[0].name == f"{kind}.html" and "http" not in page.replace("http-equiv", "")
    for table in report.tables:
        assert table.title in page
        assert all(len(row) == len(table.columns) for row in table.rows)
    for path in files:
        if path.suffix == ".csv":
            assert len(path.read_text(encoding="utf-8").splitlines()) > 1


@pytest.mark.parametrize("kind", KINDS.names())
def test_every_report_is_json(kind: str, tmp_path: Path) -> None:
    report = report_of(kind, tmp_path)
    read = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert read["kind"] == kind and read["findings"] and read["sources"][0] == "data.csv"
    assert [table["title"] for table in read["tables"]] == [table.title for table in report.tables]


@pytest.mark.parametrize("kind", KINDS.names())
@pytest.mark.filterwarnings("error")
def test_every_picture_has_units_and_its_legend_on_it(kind: str, tmp_path: Path) -> None:
    for draw in report_of(kind, tmp_path).figures.values():
        picture = draw()
        assert picture.png().startswith(b"\x89PNG")
        for axes in picture.axes:
            assert axes.lines or axes.patches
            said = [label for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
            assert said and all("[" in label for label in said)
            legend = axes.get_legend()
            assert legend is None or legend.get_window_extent().x1 <= picture.bbox.x1


def test_options_are_explained() -> None:
    for kind in KINDS.names():
        table = option_table(kind)
        assert [row[0] for row in table.rows] == list(options_of(kind))
        assert all(row[3] for row in table.rows)


def test_hostile_names_are_escaped(tmp_path: Path) -> None:
    data = save(tmp_path / "<b>&.csv", COUNTS_X)
    files = write(make_report("accuracy", [data], {**MOVE, "name": "<script>"}), tmp_path / "out")
    assert "<script>" not in files[0].read_text() and "<b>&." not in files[0].read_text()


def test_a_folder_that_cannot_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InputError, match="cannot write"):
        write(report_of("moves", tmp_path), tmp_path / "out")


def test_light_to_import(tmp_path: Path) -> None:
    path = save(tmp_path / "x.csv", DRILLING)
    program = (
        "import sys; from rds.results.reports import make_report; "
        f"make_report('current', [{str(path)!r}]).to_json(); "
        "sys.exit(bool({'matplotlib', 'can', 'pandas', 'scipy', 'control'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


BAD = [
    ("accuracy", "", "is empty", MOVE),
    ("accuracy", "cw_counts\n", "no readings", MOVE),
    ("accuracy", "cw_counts\n1\n", "needs at least 2", MOVE),
    ("accuracy", "cw_counts\n1\ntwo\n", r"line 3, column 'cw_counts': 'two' is not a number", MOVE),
    ("accuracy", "cw_counts\n1\nnan\n", r"line 3, column 'cw_counts': 'nan' is not a finite", MOVE),
    ("accuracy", "cw_counts,ccw_counts\n1,2\n3\n", r"line 3: it has 1 cells", MOVE),
    ("accuracy", "cw_counts,cw_counts\n1,2\n3,4\n", "two columns", MOVE),
    ("accuracy", "cw_A\n1\n2\n", r"'cw_A' is in 'A'; ends of moves are in counts or mm", MOVE),
    ("accuracy", "cw\n1\n2\n", r"'cw' has no unit", MOVE),
    ("accuracy", "reading\n1\n2\n", "no column with ends of moves", MOVE),
    ("accuracy", "cw_counts\n1\n2\n", r"distance and counts_per_unit not known", {}),
    ("accuracy", "cw_counts\n1\n2\n", r"unit = 'inch' is neither mm nor deg", {**MOVE, "unit": "inch"}),
    ("accuracy", "cw_counts\n1\n2\n", r"distance = -1.0 must be more than 0", {**MOVE, "distance": "-1"}),
    ("accuracy", "cw_counts\n1\n2\n", r"distance = 'far' must be a number", {**MOVE, "distance": "far"}),
    ("accuracy", "cw_counts\n1\n2\n", r"no option 'lenght'; it has distance", {**MOVE, "lenght": "1"}),
    ("accuracy", "cw_counts\n1\n2\n", "cannot be read", {**MOVE, "about": "nowhere.toml"}),
    ("moves", "x_cw_mm\n1\n2\n", "times of moves are in s", {}),
    ("moves", "x_cw_s\n1\n0\n", "line 3, column 'x_cw_s': '0' is no duration", {}),
    ("moves", "x_cw_s\n1\n2\n", "no axis 'y'", {"distances": "y=80 mm"}),
    ("moves", "x_cw_s\n1\n2\n", "'80' is not a move", {"distances": "x=80"}),
    ("moves", "x_cw_s\n1\n2\n", "'fast' is not a number", {"minimum_speed": "x=fast"}),
    ("response", "time_s,id\n0,1\n", "no column 'data'", {}),
    ("response", "time_s,id,data\n0,zz,01\n", "line 2, column 'id': 'zz' is not an identifier", {}),
    ("response", "time_s,id,data\n0,fff,01\n", "out of range", {}),
    ("response", "time_s,id,data\n0,001,0\n", "line 2, column 'data': '0' is not data", {}),
    ("response", "time_s,id,data\nx,001,01\n", "line 2, column 'time_s': 'x' is not a number", {}),
    ("response", "time_h,id,data\n0,001,01\n", "has no column 'time'", {}),
    ("response", "time_s,id,data\n0,7ff,01\n", "none of its 1 frames is a request", {}),
    ("response", "time_s,id,data\n0,001,01\n", "1 request and no answer", {}),
    ("response", LOG, "no dialect 'canopen'", {"dialect": "canopen"}),
    ("current", "cw_V\n1\n2\n", "currents are in A or mA", {}),
    ("current", "cw_A\n1\n2\n", "needs at least 3", {}),
    ("current", "cw_A\n1\n2\n3\n", "needs the time of the readings", {"voltage": "12"}),
    ("current", "cw_A\n1\n2\n3\n", "must be a whole number", {"starting": "1.5"}),
    ("current", "time_s,cw_A\n0,1\n0,2\n1,2\n", "line 3, column 'time_s': time '0' is not after", {}),
    ("current", "cw_A\n1\n2\n3\n", "not a range of readings", {"windows": "a=1"}),
    ("vibration", "x_adc\n" + "500\n" * 5 + "1024\n", "line 7, column 'x_adc': '1024' is no reading of 10 bits", {}),
    ("flatness", "x_mm,y_mm\n1,2\n", "there is no column z_mm; a face needs", {}),
    ("flatness", "x_mm,y_mm,z_mm\n1,1,1\n2,2,1\n3,3,1\n4,4,2\n", "all readings are on one line", {}),
    ("vibration", "x_adc\n500\n501\n", "needs at least 5", {}),
    ("vibration", "x_mV\n" + "500\n" * 5, "are in adc or g", {}),
    ("reconfiguration", "event,module\nremoved,X\n", "no column 'time'", {}),
    ("reconfiguration", "time_s,event\n0,removed\n1,added\n", "is followed by 'ready'", {}),
    ("reconfiguration", "new_A\n1\n2\n", "times taken are in s", {}),
]


@pytest.mark.parametrize(("kind", "text", "message", "options"), BAD)
def test_bad_data_is_refused_with_a_remedy(
    kind: str, text: str, message: str, options: dict[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        make_report(kind, [path], options)
    said = str(caught.value)
    options_at_fault = ("option", "must be", "nowhere", "not a move", "no axis", "not a range", "fast", "dialect")
    assert "bad.csv" in said or any(word in said for word in options_at_fault)


@pytest.mark.parametrize("kind", KINDS.names())
def test_a_missing_or_binary_file(kind: str, tmp_path: Path) -> None:
    options = DATA[kind][1]
    with pytest.raises(InputError, match=r"nothing\.csv: (cannot read|there is no such file)"):
        make_report(kind, [tmp_path / "nothing.csv"], options)
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"binary\.csv: it is not a text file"):
        make_report(kind, [tmp_path / "binary.csv"], options)


@pytest.mark.parametrize("ending", ["asc", "blf", "log", "trc"])
def test_a_log_that_is_none(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"bad.{ending}"
    path.write_text("this is not a log\nat all\n")
    with pytest.raises(
        InputError,
        match=r"bad\.\w+:.*(is no BLF file|no line of the file|is no line of|can't be read as|has no data frames)",
    ):
        make_report("response", [path])


def test_no_such_report_and_no_files() -> None:
    with pytest.raises(InputError, match="no report 'acuracy'; known reports: accuracy, moves"):
        make_report("acuracy", ["x.csv"])
    with pytest.raises(InputError, match="name at least one file"):
        make_report("accuracy", [])


def test_spreadsheets_of_other_countries(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("\ufeffreading;cw_A\n1;4,39\n2;2,89\n\n3;2,13\n", encoding="utf-8")
    assert make_report("current", [path]).tables[0].column("starting peak [A]") == [4.39]


@pytest.mark.parametrize("ending", ["asc", "log", "trc"])
def test_a_damaged_line_of_a_log_is_named_and_never_passed_over(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    with can.Logger(path) as log:
        for k in range(50):
            log(can.Message(timestamp=1e9 + 4e-3 * k, arbitration_id=0x001, data=[1], is_extended_id=False))
            log(can.Message(timestamp=1e9 + 4e-3 * k + 2e-3, arbitration_id=0, data=[1, 2], is_extended_id=False))
    whole = path.read_text()
    assert make_report("response", [path]).tables[0].rows
    lines = whole.splitlines(keepends=True)
    lines[-20] = lines[-20][: len(lines[-20]) // 2] + "\n"
    path.write_text("".join(lines))
    with pytest.raises(InputError) as refused:
        make_report("response", [path])
    assert f"run.{ending}:{len(lines) - 19}" in str(refused.value)


def test_a_blf_log_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    with can.Logger(path) as log:
        for k in range(2000):
            log(can.Message(timestamp=1e9 + 1e-3 * k, arbitration_id=k % 2, data=[1, k % 256], is_extended_id=False))
    path.write_bytes(path.read_bytes()[:-700])
    with pytest.raises(InputError, match="cut off"):
        make_report("response", [path])


@pytest.mark.parametrize(
    ("kind", "options", "word"),
    [
        ("vibration", {"bits": "4000"}, "bits"),
        ("vibration", {"sensitivity": "1e-320"}, "sensitivity"),
        ("current", {"period": "1e308"}, "period"),
        ("accuracy", {"distance": "1e-300", "counts_per_unit": "1e-300"}, "distance"),
    ],
)
def test_options_beyond_measure_are_refused(kind: str, options: dict[str, str], word: str, tmp_path: Path) -> None:
    table, usual = DATA[kind]
    with pytest.raises(InputError, match=f"{word} = '{options[word]}'"):
        make_report(kind, [save(tmp_path / "data.csv", table)], usual | options)


def test_readings_beyond_measure_are_refused_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "current.csv"
    path.write_text("cw_A\n1.5\n1e308\n")
    with pytest.raises(InputError, match=r"current.csv, line 3, column 'cw_A': '1e308' is beyond"):
        make_report("current", [path])


def test_a_reconfiguration_takes_no_negative_time(tmp_path: Path) -> None:
    path = tmp_path / "change.csv"
    path.write_text("swap_s\n5\n-5\n")
    with pytest.raises(InputError, match=r"line 3, column 'swap_s': '-5' is negative"):
        make_report("reconfiguration", [path])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--options", "--out", "x"], "--options only lists"),
        (["--options", "data.csv"], "--options only lists"),
        (["data.csv", "--set", "period=1", "--set", "period=2"], "period is given twice"),
    ],
)
def test_no_word_of_the_command_is_ignored(words: list[str], said: str) -> None:
    ran = CliRunner().invoke(app, ["report", "current", *words])
    assert ran.exit_code == 2 and said in ran.stderr
