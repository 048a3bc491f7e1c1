"""Tables as recorders and drives export them: where names, units and times stand in their heads."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rds.core.errors import InputError
from rds.identification.logs.csv_headings import name_and_unit
from rds.identification.logs.guess import draft
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table
from rds.identification.logs.units import dimension, unit_of_name

T = np.arange(400)  # ms
U, X = np.sin(0.03 * T), 3.0 * np.cos(0.03 * T)
LABVIEW = """LabVIEW Measurement\t
Separator\tTab
Decimal_Separator\t.
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t400\t400\t
Y_Unit_Label\tVolts\tmm\t
X_Dimension\tTime\tTime\t
Delta_X\t1.000000E-3\t1.000000E-3\t
***End_of_Header***\t\t\t
X_Value\tVoltage\tPosition\tComment
"""
TWINCAT = """Name;Scope Project
File;C:\\a.svdx
Start time of export;133547077451230000;Tuesday, March 12, 2024;14:22:25.123

Name;ActPos;Name;CmdVolt
SymbolComment;;SymbolComment;
SymbolName;Axes.Axis 1.ActPos;SymbolName;MAIN.fU
Port;501;Port;851
Unit;mm;Unit;V
Data-Type;REAL64;Data-Type;REAL64
SampleTime[ms];1;SampleTime[ms];1
"""

SIGNAL_EXPRESS = """Timestamp,2020-03-16 17:04:51,Timestamp,2020-03-16 17:04:51
Interval,0.001,Interval,0.001
Channel name,"Slide",Channel name,"Motor"
Unit,"mm",Unit,"V"
"""


def written(folder: Path, name: str, head: str, columns: Sequence[np.ndarray], mark: str, end: str = "") -> Path:
    path = folder / name
    rows = (mark.join("" if np.isnan(x) else f"{x:.6f}" for x in row) + end for row in zip(*columns, strict=True))
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("pos [mm]", "pos", "mm"),
        ("pos {furlong}", "pos", "furlong"),
        ("pos/mm", "pos", "mm"),
        ("x (setpoint)", "x (setpoint)", None),
        ("x (setpoint) [mm]", "x (setpoint)", "mm"),
        ("speed / mm/s", "speed", "mm/s"),
        ("pos in mm", "pos", "mm"),
        ("pos, µm", "pos", "µm"),
        ("mm/s", "mm/s", None),  # a unit alone is no name with one
        ("rev/min", "rev/min", None),
        ("counts/s", "counts/s", None),
        ("in/out", "in/out", None),
        ("pos/furlong", "pos/furlong", None),
        ("u, filtered", "u, filtered", None),
        ("pos [mm] (filtered)", "pos (filtered)", "mm"),
        ("pos（mm）", "pos", "mm"),
        ("ms", "ms", "ms"),  # a drive's column of times, headed by its unit
        ("s", "s", None),  # a way, as often as a time
    ],
)
def test_name_and_unit_of_a_heading(cell: str, name: str, unit: str | None) -> None:
    assert name_and_unit(cell) == (name, unit)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("velocity_mm_s", "mm/s"),
        ("speed_deg_s", "deg/s"),
        ("feed_mm_per_min", "mm/min"),
        ("rate_rev_min", "rev/min"),
        ("position_mm", "mm"),
        ("time_s", "s"),
        ("time_sec", "sec"),
        ("position_µm", "um"),
        ("state", None),
    ],
)
def test_a_unit_at_the_end_of_a_name(name: str, unit: str | None) -> None:
    assert unit_of_name(name) == unit


def test_a_labview_measurement(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "a.lvm", LABVIEW, [T / 1e3, U, X], "\t", "\t"))
    assert log.sample_period == pytest.approx(1e-3) and log.units["position"] == "mm" and log.units["command"] == "V"
    assert np.allclose(log.position, X, atol=1e-6) and np.allclose(log.command, U, atol=1e-6)


def test_a_scope_with_a_time_for_each_channel(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "same.csv", TWINCAT, [T, X, T, U], ";"))
    assert np.allclose(log.time, T / 1e3) and np.allclose(log.position, X, atol=1e-6)
    assert np.allclose(log.command, U, atol=1e-6)
    slow = np.where(np.arange(400) < 200, 2.0 * T, np.nan)  # ms: the command every second sample, in fewer rows
    held = np.where(np.isnan(slow), np.nan, np.sin(0.03 * slow))
    (log,) = read_log(written(tmp_path, "slow.csv", TWINCAT, [T, X, slow, held], ";"))
    assert len(log) == 400 and np.allclose(log.command, np.sin(0.03 * (T // 2 * 2)), atol=1e-6)


@pytest.mark.parametrize(
    ("head", "stamp"),
    [
        ("Name;ActPos;CmdVolt\nSymbolComment;;\nSampleTime[ms];1;1\nOffset;0;0\nUnit;mm;V\n\n", 0),
        ("Name;ActPos;CmdVolt\nUnit;mm;V\n", 132959733843760000),  # full stamps: FILETIME, in steps of 100 ns
    ],
)
def test_a_scope_with_one_time_for_all_channels(head: str, stamp: int, tmp_path: Path) -> None:
    """TwinCAT's times are in ms, whether its head says the sample time or the names alone."""
    above = "Name;Scope;\nFile;C:\\a.svdx;\nStarttime of export;132959733843760000;Montag;15:56:24.376\n\n"
    path = tmp_path / "a.csv"
    rows = [f"{stamp + k * (10000 if stamp else 1)};{X[k]:.6f};{U[k]:.6f}" for k in T]
    path.write_text(above + head + "\n".join(rows) + "\n", encoding="utf-8")
    (log,) = read_log(path)
    assert np.allclose(log.time - log.time[0], T / 1e3, atol=3e-6)
    path.write_text(above + head + "\n".join([f";{X[0]:.6f};{U[0]:.6f}", *rows]) + "\n", encoding="utf-8")
    assert np.nanmax(read_table(path).columns["time"].values) == pytest.approx(T[-1], abs=3e-3)  # a blank comes first
    assert np.allclose(log.position, X, atol=1e-6) and np.allclose(log.command, U, atol=1e-6)


def test_a_row_of_units_of_which_some_are_unknown_costs_no_name(tmp_path: Path) -> None:
    head = "2024-03-02 09:00:00\nTime, Input voltage, Motor temperature, Torque, Speed\ns, V, Deg C, N.mm, rad.s\n"
    table = read_table(written(tmp_path, "a.csv", head, [T, U, U, X, X], ", "))
    assert [column.unit for column in table.columns.values()] == ["s", "V", "Deg C", "N.mm", "rad.s"]
    assert list(table.columns)[1:3] == ["Input voltage", "Motor temperature"]
    table = read_table(written(tmp_path, "b.csv", "Motor,Test,Run\ntime,V,A\n", [T, U, X], ","))
    assert list(table.columns) == ["time", "V", "A"]  # names below a title
    table = read_table(written(tmp_path, "c.csv", "Axis,Axis,Axis\nt,V,mm\n", [T, U, X], ","))
    assert list(table.columns) == ["t", "V", "mm"]


def test_a_first_row_of_nan_is_no_heading(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("%t,u,x\n%[s],[V],[mm]\nnan,nan,nan\n" + "".join(f"{k},{k % 7},{2 * k}\n" for k in T))
    table = read_table(path)
    assert {column.name: column.unit for column in table.columns.values()} == {"t": "s", "u": "V", "x": "mm"}
    assert len(table.columns["x"].values) == 401 and np.isnan(table.columns["x"].values[0])


def test_numbers_of_motors_in_brackets_are_no_units(tmp_path: Path) -> None:
    table = read_table(written(tmp_path, "a.csv", "t_s,pos (1),load (1),pos (2),load (2)\n", [T, X, U, X, U], ","))
    assert [column.unit for column in table.columns.values()] == ["s", None, None, None, None]
    assert list(table.columns)[1:] == ["pos (1)", "load (1)", "pos (2)", "load (2)"]
    table = read_table(written(tmp_path, "b.csv", "t_s,pos [mm],duty [1]\n", [T, X, U], ","))
    assert table.columns["duty"].unit == "1"


def test_headings_of_several_words_stand_two_blanks_apart(tmp_path: Path) -> None:
    head = " Sample   Time     Commanded Pos   Encoder 1 Pos\n\n"
    table = read_table(written(tmp_path, "a.txt", head, [T, T, X, X], "   "))
    assert list(table.columns) == ["Sample", "Time", "Commanded Pos", "Encoder 1 Pos"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,u,x\n" + "1,2,3;\n" * 30, r"tr -d ';' "),
        ("t u x\n[ 1 2 3;\n" + " 1 2 3;\n" * 30, r"tr -d '\[\];' "),
        ("t,u,x\n" + "\x001,2,3\n" * 30, r"30 null bytes .*tr -d '\\000'"),
        ('t,u,x\n1,"2\n",3\n' + '1,"3\n",3\n' * 30, "goes on in the next line.*pandas"),
        ("  can0  080   [0]\n" + "  can0  609   [8]  40 77 60 00 00 00 00 00\n" * 30, "candump has written no times"),
        ("Name a b c\nSymbolComment   \nData-Type R R R\n" + "1 2 3 4\n" * 30, "blanks stand between its cells"),
    ],
)
def test_what_would_cost_columns_is_refused_with_its_remedy(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_table(path)


@pytest.mark.parametrize("head", ["time_ms;u_V;x_mm\n", "time_ms;u_V;x_mm;\n"])
def test_a_delimiter_may_end_the_rows_and_not_the_heading(head: str, tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "a.csv", head, [T, U, X], ";", ";"))
    assert np.allclose(log.position, X, atol=1e-6) and log.units["position"] == "mm"


def test_a_recorder_with_an_interval_for_each_channel(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "ni.csv", SIGNAL_EXPRESS, [T / 1e3, X, T / 1e3, U], ","))
    assert log.sample_period == pytest.approx(1e-3)
    assert np.allclose(log.position, X, atol=1e-6) and np.allclose(log.command, U, atol=1e-6)


def test_times_and_channels_in_turn(tmp_path: Path) -> None:
    head = "t1 [ms],ActPos [mm],t2 [ms],CmdVolt [V]\n"
    (log,) = read_log(written(tmp_path, "own.csv", head, [T, X, T - 0.25, U], ","))
    assert np.allclose(log.time, T / 1e3) and np.allclose(log.command, U, atol=1e-6)
    assert any("last received value is held: it is 0.00025 s old" in finding.what for finding in log.findings)


def test_a_column_is_named_with_its_unit_or_without(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t [s],u (V),x/mm\n0,1,2\n1,3,4\n")
    table = read_table(path)
    for name, bare in (("t [s]", "t"), ("u (V)", "u"), ("x/mm", "x"), ("x [mm]", "x"), ("x", "x")):
        assert table.column(name, "a map").name == bare
    with pytest.raises(InputError, match=r"no column 'x \[um\]'; it has t, u, x"):
        table.column("x [um]", "a map")


SCOPE = "\n".join(
    "\t".join(label if cell is None else cell for cell in row)
    for label, row in {
        "Name": (None, "ActPos", "Lag", None, "CmdVolt", None, "Slow"),
        "SampleTime[ms]": (None, "1", "1", None, "0,5", None, "2"),
        "Unit": (None, "mm (Length)", "(None)", None, "V (Voltage)", None, "(None)"),
        "ScaleFactor": (None, "1", "1", None, "1", None, "-1"),
        "Unit ScaleFactor": (None, "1", "1", None, "1", None, "1"),
    }.items()
)


def test_channels_of_a_scope_end_one_after_another(tmp_path: Path) -> None:
    """TwinCAT's own export: one column of times for several channels, cells left out behind those that have ended."""
    rows = []
    for k in range(800):
        ms, pos, slow = (f"{k}", f"{X[k]:.6f}", f"{k / 2}") if k < 400 else (" ", " ", " ")
        row = [ms, pos, ms, f"{0.5 * k}", f"{np.sin(0.015 * k):.6f}", *((f"{2 * k}", slow) if k < 200 else (" ", " "))]
        rows.append("\t".join(row).rstrip(" \t").replace(".", ","))
    path = tmp_path / "scope.csv"
    path.write_text(f"Name\tProject\nFile\tC:\\a.svdx\n\n{SCOPE}\n\n" + "\n".join(rows) + "\nEOF\n", encoding="utf-8")
    table = read_table(path)
    assert {name: len(column.values) for name, column in table.columns.items()} == {
        "ActPos": 400,
        "Lag": 400,
        "CmdVolt": 800,
        "Slow": 200,
    }
    assert [(c.unit, c.time is not None and c.time[-1]) for c in table.columns.values()] == [
        ("mm", 0.399),
        (None, 0.399),
        ("V", pytest.approx(0.3995)),
        (None, pytest.approx(0.398)),
    ]
    assert [f.what[:5] for f in table.findings] == ["Slow:"]  # its factor may be applied or not: the file does not tell
    (log,) = read_log(path)
    assert np.allclose(log.position, X, atol=1e-6) and np.allclose(log.command, U, atol=1e-6)
    path.write_text(path.read_text(encoding="utf-8").removesuffix("\nEOF\n")[:-5], encoding="utf-8")  # within a number
    cut = read_table(path)
    assert len(cut.columns["CmdVolt"].values) == 799
    assert "it ends in the middle of a line" in " ".join(finding.what for finding in cut.findings)


@pytest.mark.parametrize(
    ("head", "rows", "begin"),
    [
        ("X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-2.0e-01,1.0e-03\n", "{k},{u},{x},", -0.2),
        ("Time,X(CH1),X(CH2)\nSecond,Volt,Volt\n", "{t},{u},{x}", 0.0),
        ("x-axis,CH1,CH2\nsecond,Volt,Volt\n", "{t},{u},{x}", 0.0),
        ("Record Length,Analog:400\nSource,CH1,CH2\nSecond,Volt,Volt\n", "{t},{u},{x}", 0.0),
    ],
)
def test_oscilloscopes_head_their_times_and_units(head: str, rows: str, begin: float, tmp_path: Path) -> None:
    lines = [rows.format(k=k, t=f"{k * 1e-3:.6e}", u=f"{U[k]:.4f}", x=f"{X[k]:.4f}") for k in range(400)]
    (tmp_path / "scope.csv").write_text(head + "\n".join(lines) + "\n")
    time, first, second = read_table(tmp_path / "scope.csv").columns.values()
    assert np.allclose(time.values, begin + T / 1e3) and dimension(str(time.unit)) == "time"
    assert np.allclose(first.values, U, atol=1e-4) and np.allclose(second.values, X, atol=1e-4)
    assert dimension(str(first.unit)) == dimension(str(second.unit)) == "voltage" and "CH2" in second.name


def test_rows_that_are_taken_for_the_head_are_told(tmp_path: Path) -> None:
    """An oscilloscope with its settings beside the samples: those beside numbers are not lost without a word."""
    settings = ["Record Length,400", "Sample Interval,1e-3", "Source,CH1", *[","] * 397]
    rows = [f"{left},{t / 1e3:.6f},{x:.4f}" for left, t, x in zip(settings, T, X, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    table = read_table(tmp_path / "a.csv")
    kept = len(next(iter(table.columns.values())).values)
    told = [f.what for f in table.findings if f.kind == "headings" and "was passed over" in f.what]
    assert kept == 400 or told


def test_rows_that_note_something_of_each_signal_are_no_headings(tmp_path: Path) -> None:
    """As Simulink's data inspector saves them."""
    head = "time,Axis:1,cmd\n,Type: double,Type: double\n,Units: mm,Units: V\n,Interp: linear,Interp: zoh\n"
    (tmp_path / "a.csv").write_text(head + "0.1,2,3\n0.2,3,4\n" * 3)
    columns = read_table(tmp_path / "a.csv").columns
    assert {name: column.unit for name, column in columns.items()} == {"time": None, "Axis:1": "mm", "cmd": "V"}


def test_headings_of_one_axis_beside_a_nameless_index_are_names(tmp_path: Path) -> None:
    """As pandas saves a table whose index has no name."""
    (tmp_path / "a.csv").write_text(",X: pos [mm],X: cmd [V]\n" + "0.1,2,3\n0.2,3,4\n" * 3)
    assert [*read_table(tmp_path / "a.csv").columns][1:] == ["X: pos", "X: cmd"]


def test_a_first_row_with_another_separator_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0.0e+000 1.2e+000\t\n" + "".join(f"{k}.0e-001\t1.2e+000\t\n" for k in range(1, 9)))
    (told,) = [f.what for f in read_table(tmp_path / "a.txt").findings if f.kind == "headings"]
    assert "was passed over: '0.0e+000 1.2e+000" in told


def test_notes_beside_the_headings_are_none_of_them(tmp_path: Path) -> None:
    """A number there stands above blanks alone."""
    head = "RPM [rev/min],time [s],,Record time: 1582.458,,delta_T,0.0176\n"
    path = tmp_path / "run.csv"
    path.write_text(head + "".join(f"{x:.6f},{k / 1000},,,,,\n" for k, x in enumerate(X)))
    table = read_table(path)
    assert list(table.columns) == ["RPM", "time", "column 3", "Record time: 1582.458", "column 5", "delta_T"]
    assert np.allclose(table.columns["RPM"].values, X, atol=1e-6) and table.columns["time"].unit == "s"


def test_a_preamble_with_numbers_is_no_lost_row(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Attenuation,10,10\nt [s],u [V],x [mm]\n" + "0.1,2,3\n0.2,3,4\n" * 3)
    assert not read_table(tmp_path / "a.csv").findings


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("output[0]", "output[0]", None),
        ("output[1]", "output[1]", None),
        ("FPOS(2)", "FPOS(2)", None),
        ("mzv (52.4)", "mzv (52.4)", None),
        ("duty [1]", "duty", "1"),
        ("u[V]", "u", "V"),
        ("output[3] [V]", "output[3]", "V"),
    ],
)
def test_a_number_in_brackets_is_an_index_and_no_unit(cell: str, name: str, unit: str | None) -> None:
    assert name_and_unit(cell) == (name, unit)


@pytest.mark.parametrize("label", ["Unit", "[units]", "Einheit:"])
def test_a_row_of_units_may_begin_with_its_label(tmp_path: Path, label: str) -> None:
    head = f"Name;time;voltage;position\n{label};ms;V;um\n"
    table = read_table(written(tmp_path, "log.csv", head, [T, T, U, X], ";"))
    assert [(c.name, c.unit) for c in table.columns.values()][1:] == [
        ("time", "ms"),
        ("voltage", "V"),
        ("position", "um"),
    ]


def test_two_units_of_one_column_are_told(tmp_path: Path) -> None:
    head = "Time (s),voltage (V),position (mm)\nms,V,mm\n"
    (log,) = read_log(written(tmp_path, "log.csv", head, [T, U, X], ","))
    assert any("the heading says Time in s, and ms below: the heading was followed" in f.what for f in log.findings)


def test_a_unit_at_the_end_of_a_name_may_contradict_the_row_of_units(tmp_path: Path) -> None:
    table = read_table(written(tmp_path, "log.csv", "time_ms,u_V,pos_mm\ns,V,mm\n", [T, U, X], ","))
    assert any("the heading says time_ms in ms, and s below" in f.what for f in table.findings)
    assert [c.unit for c in table.columns.values()] == ["ms", "V", "mm"]


def test_a_date_and_the_same_time_in_s_are_one_time(tmp_path: Path) -> None:
    stamps = [f"2024-03-01 12:00:{k / 1000:09.6f}" for k in range(300)]
    rows = (f"{stamp},{k / 1000},{k % 7},{k}" for k, stamp in enumerate(stamps))
    (tmp_path / "log.csv").write_text("Timestamp,Time (s),u [V],x [mm]\n" + "\n".join(rows) + "\n")
    assert read_log(tmp_path / "log.csv")[0].sample_period == pytest.approx(1e-3)


def test_a_time_of_another_name_is_offered(tmp_path: Path) -> None:
    head = "ms_today;input_voltage;erpm\n"
    with pytest.raises(InputError, match="where the time is 'ms_today', say so in a map, with its unit"):
        read_log(written(tmp_path, "log.csv", head, [T, U, X], ";"))


def test_the_time_in_the_first_row_of_a_matrix_of_simulink_is_offered(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"yaw_speed": np.array([0.001 * T, U])})
    with pytest.raises(InputError, match="where the time is 'yaw_speed_1', say so in a map"):
        read_log(tmp_path / "log.mat")
    assert '[time]\ncolumn = "yaw_speed_1"\nunit = "?"' in draft(read_table(tmp_path / "log.mat"))


def test_dspace_s_x_is_drafted_as_the_time(tmp_path: Path) -> None:
    signals = np.array([("u", U), ("speed", X)], dtype=[("Name", "O"), ("Data", "O")])
    savemat(tmp_path / "log.mat", {"run": {"X": {"Data": 0.001 * T}, "Y": signals}})
    made = draft(read_table(tmp_path / "log.mat"))
    assert '[time]\ncolumn = "run.X.Data"\nunit = "?"' in made and made.count("run.X.Data") == 2


@pytest.mark.parametrize(
    ("head", "quantity"),
    [
        ("time [s],Voltage [V],Command Position [mm]", "position"),
        ("time [s],Voltage [V],Position Difference [mm]", "position"),
        ("time [s],Bus Voltage [V],Position [mm]", "command"),
        ("time [s],Supply Voltage [V],Speed [rpm]", "command"),
        ("time [s],DCBusVoltage [V],Speed [rpm]", "command"),
        ("time [s],DC-Link [V],Position [mm]", "command"),
        ("time [s],Tacho [V],Position [mm]", "command"),
        ("time [s],Analog input 1 [V],Position [mm]", "command"),
        ("time [s],Peak current limit [A],Position [mm]", "command"),
        ("time [s],Torque limit [Nm],Position [mm]", "command"),
        ("time [s],Load torque [Nm],Position [mm]", "command"),
        ("time [s],Brake torque [Nm],Position [mm]", "command"),
        ("time [s],Torque [Nm],Z offset [mm]", "position"),
        ("time [s],Voltage [V],Electrical angle [deg]", "position"),
    ],
)
def test_what_was_not_measured_or_drives_nothing_is_not_guessed(tmp_path: Path, head: str, quantity: str) -> None:
    with pytest.raises(InputError, match=f"no column tells by its unit that it is the {quantity}"):
        read_log(written(tmp_path, "log.csv", head + "\n", [0.001 * T, U, X], ","))


@pytest.mark.parametrize(
    ("command", "position"),
    [
        ("External command [V]", "Load position [mm]"),
        ("Command voltage after limit [V]", "Motor encoder position [mm]"),
        ("Analog command input [V]", "Position offset corrected [mm]"),
        ("Motorspannung Encoder 1 [V]", "Position after backlash compensation [mm]"),
    ],
)
def test_words_of_other_quantities_beside_a_command_and_a_position_take_none_away(
    tmp_path: Path, command: str, position: str
) -> None:
    """Neither the current nor the speed stands in for them."""
    head = f"time [s],{command},{position},Motor current [A],Speed [mm/s]\n"
    (log,) = read_log(written(tmp_path, "log.csv", head, [0.001 * T, U, X, 0.5 * U, 0.0 * X + 1.0], ","))
    assert np.allclose(log.command, U, atol=1e-5) and log.units["command"] == "V"
    assert np.allclose(log.position, X, atol=1e-5)


@pytest.mark.parametrize("first", ["PAR1 [V]", "TDSm [V]"])
def test_a_heading_that_begins_as_a_foreign_file_does_is_a_heading(tmp_path: Path, first: str) -> None:
    (log,) = read_log(written(tmp_path, "log.csv", f"{first},time [s],x [mm]\n", [U, 0.001 * T, X], ","))
    assert np.allclose(log.command, U, atol=1e-5)


def test_a_name_that_is_passed_over_is_told_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="by its name 'Motor torque load side' is another quantity; if it is the comm"):
        read_log(written(tmp_path, "log.csv", "time [s],Motor torque load side [Nm],x [mm]\n", [0.001 * T, U, X], ","))


def test_the_motor_s_current_is_the_command_beside_the_voltage_of_its_supply(tmp_path: Path) -> None:
    head = "time [s],DC link voltage [V],Motor current [A],Position [mm],Current limit [A]\n"
    (log,) = read_log(written(tmp_path, "log.csv", head, [0.001 * T, 0.0 * X + 560.0, U, X, 0.0 * X + 9.0], ","))
    assert np.allclose(log.command, U, atol=1e-5) and log.units["command"] == "A"
    assert "current" not in log.extra


def test_a_draft_has_no_supply_or_load_for_the_command_either(tmp_path: Path) -> None:
    head = "Time [s],DC link voltage,Motor current,load torque,Encoder position [mm]\n"
    table = read_table(written(tmp_path, "log.csv", head, [0.001 * T, 0.0 * X + 560.0, U, X, X], ","))
    (axis,) = tomllib.loads(draft(table))["axis"].values()
    assert axis["command"] == {"column": "Motor current", "unit": "?"} and "current" not in axis
    assert axis["position"] == {"column": "Encoder position", "unit": "mm"}


def test_a_heading_with_fewer_names_than_columns_is_told(tmp_path: Path) -> None:
    """As R writes a table whose rows have names."""
    table = read_table(written(tmp_path, "log.csv", "t [s],u [V],x [mm]\n", [T + 1.0, 0.001 * T, U, X], ","))
    assert list(table.columns) == [f"column {i}" for i in (1, 2, 3, 4)]
    (told,) = [f.what for f in table.findings if f.kind == "headings"]
    assert "fewer cells ('t [s],u [V],x [mm]') than the rows, 4" in told


def test_a_command_position_beside_the_measured_one_is_the_reference(tmp_path: Path) -> None:
    head = "time [s],Voltage [V],Command Position [mm],Position [mm],Bus Voltage [V]\n"
    (log,) = read_log(written(tmp_path, "log.csv", head, [0.001 * T, U, X + 1.0, X, 0.0 * X + 24.0], ","))
    assert np.allclose(log.position, X, atol=1e-5) and np.allclose(log.command, U, atol=1e-5)
    assert np.allclose(log.extra["reference"], X + 1.0, atol=1e-5)


def test_signals_that_follow_each_other_in_rows_are_told_how_to_turn(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{name},{0.001 * k:.3f},{k}" for k in range(200) for name in ("position", "voltage"))
    path.write_text("name,time [s],value\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=r"pivot\(index=c\[1\], columns=c\[0\], values=c\[2\]\)"):
        read_log(path)
    rows = (f"{name},{0.001 * k:.3f},{k}" for name in ("position", "voltage") for k in range(200))
    path.write_text("_field,_time [s],_value\n" + "\n".join(rows) + "\n")  # as InfluxDB exports them
    with pytest.raises(InputError, match=r"pivot\(index=c\[1\], columns=c\[0\], values=c\[2\]\)"):
        read_log(path)
    rows = (f"{name} 2024-05-01 12:00:{0.01 * k:09.6f} {k}" for k in range(200) for name in ("Axis1-PosAct", "Enc"))
    path.write_text("\n".join(rows) + "\n")  # as EPICS's camonitor prints them
    with pytest.raises(InputError, match=r"where 'column 1' says in each row which signal it holds"):
        read_log(path)
