"""Files of oscilloscopes, halscope and others as they write them: read with time and names, or refused with the export
that is read.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.logs.guess import guess
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table

K = np.arange(400)
U, X = np.sign(np.sin(0.03 * K)), 3.0 * np.cos(0.03 * K)
SETTINGS = [
    "Record Length,4.000000e+02",
    "Sample Interval,1.000000e-03",
    "Trigger Point,2.000000e+02",
    *[","] * 3,
    "Source,CH2",
    "Vertical Units,V",
    "Vertical Scale,5.0e+00",
    "Horizontal Units,s",
    "Horizontal Scale,2.5e-02",
]


def saved(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def tektronix(rows: int, after: str = ",") -> str:
    beside = [*SETTINGS, *[","] * (400 - len(SETTINGS))]
    return "".join(f"{beside[k]},,  {k / 1e3 - 0.2:.12f}, {X[k]:9.5f}{after}\n" for k in range(rows))


@pytest.mark.parametrize("after", ["", ","])
def test_settings_beside_the_samples_of_an_oscilloscope_cost_no_sample(after: str, tmp_path: Path) -> None:
    table = read_table(saved(tmp_path / "F0000CH2.CSV", tektronix(400, after)))
    assert list(table.columns) == ["time", "CH2"] and not table.findings
    assert [column.unit for column in table.columns.values()] == ["s", "V"]
    assert np.allclose(table.columns["time"].values, K / 1e3 - 0.2) and np.allclose(
        table.columns["CH2"].values, X, atol=1e-5
    )


def test_a_cut_file_of_an_oscilloscope_is_told_by_its_record_length(tmp_path: Path) -> None:
    table = read_table(saved(tmp_path / "F0000CH2.CSV", tektronix(300)))
    assert "announces 400 samples, and there are 300" in table.findings[0].what


def test_headings_without_cells_leave_the_others_their_names(tmp_path: Path) -> None:
    """LabVIEW heads a column of comments, and ends no row with a tab."""
    rows = "".join(f"{k / 1e3:.6f}\t{U[k]:.6f}\t{X[k]:.6f}\n" for k in range(400))
    table = read_table(saved(tmp_path / "a.lvm", "time [s]\tvoltage [V]\tposition [mm]\tComment\n" + rows))
    assert list(table.columns) == ["time", "voltage", "position"]
    assert table.columns["position"].unit == "mm" and len(table.columns["position"].values) == 400
    assert "'Comment'" in table.findings[0].what
    rows = "".join(f"{U[k]:.5e},{X[k]:.5e},\n" for k in range(400))
    table = read_table(saved(tmp_path / "rigol.csv", "CH1,CH2,Start,Increment,\n" + rows))
    assert list(table.columns) == ["CH1", "CH2"] and "'Start', 'Increment'" in table.findings[0].what


@pytest.mark.parametrize("top", ["", "\n"])
@pytest.mark.parametrize("counted", [False, True])
def test_an_oscilloscope_tells_start_and_step_with_the_samples_counted_or_not(
    top: str, counted: bool, tmp_path: Path
) -> None:
    """Rigol's `CH1,CH2,Start,Increment`, with and without the `X` that counts the samples."""
    head = "X,CH1,CH2,Start,Increment,\nSequence," if counted else "CH1,CH2,Start,Increment,\n"
    rows = "".join(f"{f'{k},' * counted}{U[k]:.5e},{X[k]:.5e},\n" for k in range(400))
    table = read_table(saved(tmp_path / "rigol.csv", f"{top}{head}Volt,Volt,-6.0e-02,1.0e-04\n{rows}"))
    assert [(column.name, column.unit) for column in table.columns.values()] == [
        ("time", "s"),
        ("CH1", "Volt"),
        ("CH2", "Volt"),
    ]
    assert np.allclose(table.columns["time"].values, -0.06 + 1e-4 * np.arange(400))
    assert np.allclose(table.columns["CH2"].values, X[:400], rtol=1e-5)


@pytest.mark.parametrize("timed", [False, True])
def test_newer_oscilloscopes_of_rigol_head_units_start_and_step_in_one_line(timed: bool, tmp_path: Path) -> None:
    head = f"{'Time(s),' * timed}CH1A,CH2V,t0 =-6.500000e+00, tInc = 8.000000e-06,\n"
    rows = "".join(f"{f'{-6.5 + 8e-6 * k:.6f},' * timed}{U[k]:.5e},{X[k]:.5e},,\n" for k in range(400))
    table = read_table(saved(tmp_path / "rigol.csv", head + rows))
    found = list(table.columns.values())[:3]
    assert [(column.name, column.unit) for column in found] == [("time", "s"), ("CH1", "A"), ("CH2", "V")]
    assert np.allclose(found[0].values, -6.5 + 8e-6 * np.arange(400), atol=1e-9) and not table.findings


def test_rohde_and_schwarz_head_the_time_by_its_unit_alone(tmp_path: Path) -> None:
    rows = "".join(f"{k / 1e3:.6E},{U[k]:.5E},{X[k]:.5E}\n" for k in range(400))
    table = read_table(saved(tmp_path / "rtb.csv", "in s,C1 in V,C2 in V\n" + rows))
    assert [(column.name, column.unit) for column in table.columns.values()] == [
        ("time", "s"),
        ("C1", "V"),
        ("C2", "V"),
    ]


@pytest.mark.parametrize("row", ["0,2.5,7.0,0.001", "0,2.5"])
def test_a_first_row_of_another_width_is_not_passed_over_in_silence(row: str, tmp_path: Path) -> None:
    """A constant stands beside the first row alone, or a cell is missing there."""
    rows = "".join(f"{k},{U[k]:.5f},{X[k]:.5f}\n" for k in range(1, 100))
    table = read_table(saved(tmp_path / "a.csv", f"t [ms],u [V],x [mm],T\n{row}\n{rows}"))
    assert any(row in finding.what and finding.gravity == "warning" for finding in table.findings)


@pytest.mark.parametrize("end", ["", ","])
def test_a_heading_may_end_in_a_delimiter_where_its_rows_do_not(end: str, tmp_path: Path) -> None:
    rows = "".join(f"{k},{U[k]:.5f},{X[k]:.5f}{end}\n" for k in range(100))
    table = read_table(saved(tmp_path / "a.csv", f"t [ms],u [V],x [mm],{end}\n{rows}"))
    assert [(column.name, column.unit) for column in table.columns.values()] == [("t", "ms"), ("u", "V"), ("x", "mm")]
    assert not table.findings


def test_a_heading_above_a_numbered_line_names_nothing(tmp_path: Path) -> None:
    """Numbers wider than the rows are no headings."""
    table = read_table(saved(tmp_path / "a.csv", "7,8,9,10\n" + "1,2,3\n2,3,4\n" * 5))
    assert not any("heading, which is wider" in finding.what for finding in table.findings)


HALSCOPE = (
    "# Sampling period is 1000000 ns\njoint.0.pos-fb;pid.x.output\n# Position: 0.000000;1.000000\n# Scale: 5;5\n"
    + "".join(f"{X[k]:.14f};{U[k]:.14f}\n" for k in range(400)),
    "Sampling period is 1000000 nSec \n\n"
    + "".join(f"joint.0.pos-fb {X[k]:+.14f} pid.x.output {U[k]:+.14f} (null) +0.0 \n" for k in range(400)),
)
COMMAS = tuple(re.sub(r"(?<=\d)\.(?=\d{14})", ",", text) for text in HALSCOPE)  # as on a desktop in Russian


@pytest.mark.parametrize("name", ["halscope.log", "halscope.csv", "halscope.txt"])
@pytest.mark.parametrize("text", HALSCOPE + COMMAS)
def test_logs_of_halscope_are_columns_with_a_time(text: str, name: str, tmp_path: Path) -> None:
    path = saved(tmp_path / name, text)
    assert list(read_table(path).columns) == ["time", "joint.0.pos-fb", "pid.x.output"]
    saved(
        tmp_path / f"{name}.map.toml",
        '[time]\ncolumn = "time"\nunit = "s"\n[axis.X]\ncommand = { column = "pid.x.output", unit = "V" }\n'
        'position = { column = "joint.0.pos-fb", unit = "mm" }\n',
    )
    (log,) = read_log(path)
    assert np.allclose(log.time, K / 1e3) and np.allclose(log.position, X) and np.allclose(log.command, U)


@pytest.mark.parametrize(
    ("text", "line"), [(HALSCOPE[0] + "0.5;\n", 405), (HALSCOPE[1] + "joint.0.pos-fb +0.1\n", 403)]
)
def test_a_cut_line_of_halscope_is_named(text: str, line: int, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"line {line}: .* one number for each of the [23] pins"):
        read_table(saved(tmp_path / "halscope.log", text))


def test_tdms_is_refused_with_the_export_of_channels_that_have_no_times(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no time properties .*`as_dataframe\(\)\.to_csv\('log\.csv', index=False\)`"):
        read_table(saved(tmp_path / "a.tdms", "TDSm"))


def test_a_trend_of_studio_5000_is_refused_with_how_to_put_points_into_its_times(tmp_path: Path) -> None:
    head = "Trend Name: ,Axis\nSample Period: ,1 ms\nStart Time: ,27/11/2026 12:00:00;000\nHeader: ,Date,Time,Pos,Trq\n"
    text = head + "".join(f"Data: ,27/11/2026,12:00:00;{k:03d},{k}.5,2.5\n" for k in range(40))
    with pytest.raises(InputError, match=r"Studio 5000.* `sed -E 's/.*/\\1\.\\2,/' FILE"):
        read_table(saved(tmp_path / "trend.csv", text))
    table = read_table(saved(tmp_path / "log.csv", re.sub(r"(:\d\d);(\d+),", r"\1.\2,", text)))
    assert np.allclose(table.columns["Time"].values, np.arange(40) / 1e3) and table.columns["Trq"].values[0] == 2.5


def test_a_log_of_halscope_without_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no samples are in it"):
        read_table(saved(tmp_path / "halscope.log", "Sampling period is 1000000 nSec \n\n"))


@pytest.mark.parametrize("length", [2000, 5000])
def test_signals_in_rows_are_refused_with_how_to_turn_them(length: int, tmp_path: Path) -> None:
    path = tmp_path / "chirp.csv"
    np.savetxt(path, np.arange(4.0 * length).reshape(4, length), delimiter=",")
    with pytest.raises(InputError, match=r"its signals stand in rows.*\.T, delimiter"):
        read_table(path)


@pytest.mark.parametrize(
    ("ending", "remedy"),
    [
        (".tdms", "as_dataframe"),
        (".feather", "read_feather"),
        (".xlsx", "as CSV"),
        (".npz", "savetxt"),
        (".h5", "h5py"),
        (".json", "to_csv"),
        (".mcap", "PlotJuggler"),
        (".svdx", "as CSV, with semicolons"),
    ],
)
def test_a_format_that_is_not_read_names_the_export_that_is(ending: str, remedy: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"no log of the ending '{ending}'; it is .*{remedy}.*Read: .csv"):
        read_table(saved(tmp_path / f"log{ending}", "anything"))


@pytest.mark.parametrize(("mark", "remedy"), [(" ", "blanks stand between its cells"), (":", "between colons")])
def test_exports_of_twincat_with_other_separators_are_refused_with_the_right_one(
    mark: str, remedy: str, tmp_path: Path
) -> None:
    head = ["Name;Project", "", "Name;ActPos;Name;CmdVolt", "Unit;mm;Unit;V", ""]
    lines = [*head, *(f"{k};{X[k]:.6f};{k};{U[k]:.6f}" for k in range(400))]
    with pytest.raises(InputError, match=f"{remedy}.*export it with semicolons"):
        read_table(saved(tmp_path / "scope.csv", "\n".join(lines).replace(";", mark) + "\n"))


def test_a_time_that_an_oscilloscope_rounds_is_told_with_the_rate(tmp_path: Path) -> None:
    rows = "".join(f"{0.05 + 4e-5 * k:.2E},{U[k]:.2E},{X[k]:.2E}, \n" for k in range(400))
    path = saved(tmp_path / "NewFile0.csv", ",CH1,CH2,\nSecond,Volt,Volt,\n" + rows)
    problem = guess(read_table(path)).problem
    assert "its stamps are coarser than the sample period" in problem and "rds report" not in problem
    rate = float(problem.split("rate = ")[1].split()[0])
    assert abs(rate - 25e3) < 250.0


def test_what_a_terminal_saved_as_log_is_a_table(tmp_path: Path) -> None:
    """PuTTY and Tera Term call .log what candump does; a log of frames begins its lines with a time in brackets."""
    rows = "".join(f"{k};{U[k]:.3f};{X[k]:.4f}\r\n" for k in range(400))
    table = read_table(saved(tmp_path / "teraterm.log", "t [ms];u [V];x [mm]\r\n" + rows))
    assert [column.unit for column in table.columns.values()] == ["ms", "V", "mm"]
    assert np.allclose(table.columns["x"].values, X, atol=1e-4)
    with pytest.raises(InputError, match=r"no lines of numbers.*nor is it a log of frames") as caught:
        read_table(saved(tmp_path / "boot.log", "Hello\nWorld\n"))
    assert str(caught.value).count("boot.log") == 1
    with pytest.raises(InputError, match="candump"):
        read_table(saved(tmp_path / "can.log", "(1.5) can0 123#11\n(1.6) can0 12\n"))


PUTTY = "=~=~=~=~=~=~=~=~=~= PuTTY log 2021.12.19 17:30:01 =~=~=~=~=~=~=\r\n\0\0\0\0rcent: 0.00%, RPM: 0\r\n"


@pytest.mark.parametrize(
    ("head", "row"),
    [
        (PUTTY, "PWM Percent: {u:.2f}%, Battery Voltage: 24.10V, RPM: {x:.3f}\r\n"),
        ("", "PWM Percent:{u:.2f},Battery Voltage:24.10,RPM:{x:.3f}\n"),
        ("ready\n", "PWM Percent={u:.2f}\tBattery Voltage=24.10\tRPM={x:.3f}\n"),
    ],
)
@pytest.mark.parametrize("name", ["putty.log", "serial.txt"])
def test_numbers_behind_labels_are_columns(name: str, head: str, row: str, tmp_path: Path) -> None:
    text = head + "".join(row.format(u=U[k], x=X[k]) for k in range(400))
    table = read_table(saved(tmp_path / name, text))
    assert list(table.columns) == ["PWM Percent", "Battery Voltage", "RPM"]
    assert np.allclose(table.columns["RPM"].values, X, atol=1e-3)
    if head == PUTTY:
        assert table.columns["Battery Voltage"].unit == "V"
    assert ("passed over" in " ".join(finding.what for finding in table.findings)) == bool(head)


def test_labels_that_change_from_line_to_line_are_refused(tmp_path: Path) -> None:
    text = "speed: 1\n" * 60 + "speed: 1, pos: 2\n" * 60
    with pytest.raises(InputError, match=r"60 of its 120 lines have other labels than speed.*one line for each sample"):
        read_table(saved(tmp_path / "a.txt", text))


def test_columns_in_spanish_and_portuguese_are_told(tmp_path: Path) -> None:
    rows = "".join(f"{k / 50:.3f},{9.0 * U[k]:.2f},{X[k]:.3f}\n" for k in range(400))
    for head in ("Tiempo (s), Voltaje (V), Velocidad (rad/s)", "Tempo (s), Tensao (V), Velocidade (rad/s)"):
        found = guess(read_table(saved(tmp_path / "paso.csv", head + "\n" + rows)))
        assert found.map is not None, found.problem
        assert any(said.startswith("speed of axis is 'Veloc") for said in found.map.said)


def test_channels_that_are_called_by_numbers_keep_them(tmp_path: Path) -> None:
    rows = "".join(f"{k / 1e3:.5E},{U[k]:+.5E},{X[k]:+.5E}\n" for k in range(400))
    table = read_table(saved(tmp_path / "scope_1.csv", "x-axis,1,2\nsecond,Volt,Volt\n" + rows))
    assert list(table.columns) == ["x-axis", "1", "2"] and table.columns["2"].unit == "Volt"
    assert np.allclose(table.columns["2"].values, X, atol=1e-4)
