"""Maps: every key has its effect or is refused with file and line; a guess is never made in doubt."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rds.core.errors import InputError
from rds.identification.logs.guess import draft, guess
from rds.identification.logs.map import LogMap
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table
from tests.logs.data_files import MAP, axis, write

SECOND = """[second]
file = "b.csv"
offset = 0.0
[second.time]
column = "t"
unit = "s"
"""


def saved(folder: Path, text: str) -> Path:
    path = folder / "m.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("speed = 1\n" + MAP, 1, "unknown key 'speed'"),
        (MAP.replace('column = "time"', 'colum = "time"'), 3, "unknown key 'colum'"),
        (MAP.replace('unit = "mm"', 'unit = "parsec"'), 7, "unit 'parsec' of position is unknown; known units: m, cm"),
        (MAP.replace('unit = "V"', 'unit = "mm"'), 6, "command is in 'mm', which measures length"),
        (MAP.replace('unit = "s"', 'unit = "V"'), 4, "time is in 'V', which measures voltage"),
        (MAP.replace('unit = "mm"', "sign = 2"), 7, "sign = 2 must be 1 or -1"),
        (MAP.replace('unit = "mm"', "scale = 0.0"), 7, "must not be 0"),
        (MAP + "resolution = -1.0\n", 8, "resolution = -1.0 must be from"),
        (MAP + 'machine_axis = "X"\n', 8, "add machine ="),
        (MAP + "voltage_range = [10, -10]\n", 8, "the lowest first"),
        (MAP + "voltage_range = []\n", 8, "must be [lowest, highest] in V, or one number"),
        (MAP.replace('"voltage"', '"position"'), 6, "command and position are both 'position'"),
        (MAP + "force_gain = 0.0\n", 8, "make no force"),
        (MAP + 'closed_loop = "yes"\n', 8, "must be true or false"),
        ('gaps = "fill"\n' + MAP, 1, "known: refuse, split, keep"),
        ("jitter_limit = 2.0\n" + MAP, 1, "from 0 to 1"),
        ('machine = "mini-cnx"\n' + MAP, 1, "there is no machine 'mini-cnx'"),
        (MAP.replace("[axis.X]", "[axes.X]"), None, "no [axis.NAME] table"),
        (MAP.replace("command = ", "comand = "), 6, "did you mean 'command'?"),
        (MAP.replace("position = ", "postion = "), 7, "did you mean 'position'?"),
        ("\n".join(MAP.splitlines()[:-1]) + "\n", 5, "axis X needs position"),
        (MAP[: MAP.index("command")], 5, "axis X needs command"),
        (MAP.replace('unit = "mm"', "second = true"), 7, "there is no [second] table"),
        (MAP + '[second]\nfile = "b.csv"\n', 8, "nothing says how the two clocks agree"),
        (MAP + SECOND, 8, "no column is of the second file"),
        (MAP + SECOND.replace("offset = 0.0", "drift = 1e-6"), 10, "drift = 1e-06 is given without offset"),
        (MAP + SECOND.replace("offset", "window = 1.0\noffset"), 10, "window = 1.0 is for an offset that is estimated"),
        (MAP.replace('column = "time"\nunit = "s"', "rate = 0"), 3, "rate = 0 must be from 1e-06"),
        (MAP.replace('column = "time"', "rate = 1000.0"), 4, "time.unit = 's' is of a column of numbers"),
        (MAP.replace('column = "time"\nunit = "s"', "scale = 2.0"), 3, "time.scale = 2.0 is of a column of numbers"),
        ("a = [", None, "not valid TOML"),
        ("a = " + "[" * 5000 + "]" * 5000, None, "brackets within brackets"),
    ],
)
def test_maps_that_are_refused(tmp_path: Path, text: str, line: int | None, sentence: str) -> None:
    path = saved(tmp_path, text)
    with pytest.raises(InputError) as refusal:
        LogMap.read(path)
    assert sentence in str(refusal.value)
    assert str(refusal.value).startswith(f"{path}, line {line}: " if line else str(path))


def test_scale_offset_sign_and_unit(tmp_path: Path) -> None:
    made = axis()
    path = write(
        tmp_path / "log.csv", made | {"voltage": made["voltage"] * 200 + 7, "position": -made["position"] / 1000}
    )
    text = MAP.replace('"voltage", unit = "V"', '"voltage", unit = "mV", scale = 5.0, offset = -35.0')
    text = text.replace('"position", unit = "mm"', '"position", unit = "m", sign = -1')
    (log,) = read_log(path, saved(tmp_path, text))
    assert np.allclose(log.command, made["voltage"], atol=1e-9)
    assert np.allclose(log.position, made["position"], atol=1e-9)


@pytest.mark.parametrize("how", ["resolution = 0.002", "counts_per_unit = 500.0", 'machine = "m"'])
def test_encoder_counts_by_the_resolution(tmp_path: Path, how: str) -> None:
    made = axis(resolution=0.002)
    path = write(tmp_path / "log.csv", made | {"position": np.rint(made["position"] / 0.002)})
    text = MAP.replace('unit = "mm"', 'unit = "counts"')
    with pytest.raises(InputError, match="in encoder counts; give resolution"):
        read_log(path, saved(tmp_path, text))
    if how.startswith("machine"):
        (tmp_path / "my.toml").write_text(
            "sample_period = 0.001\n[axis.X]\nnode = 2\ntravel = [-75, 75]\nresolution = 0.002\n"
        )
        text = 'machine = "my.toml"\n' + text
    else:
        text += how
    (log,) = read_log(path, saved(tmp_path, text))
    assert np.allclose(log.position, made["position"], atol=1e-12) and log.resolution == pytest.approx(0.002)


def test_a_rate_in_place_of_a_column_of_time(tmp_path: Path) -> None:
    made = axis()
    made.pop("time")
    text = MAP.replace('column = "time"\nunit = "s"', "rate = 1000.0")
    (log,) = read_log(write(tmp_path / "log.csv", made), saved(tmp_path, text))
    assert np.array_equal(log.time, np.arange(4000) / 1000.0)


def test_a_column_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", axis())
    text = saved(tmp_path, MAP.replace('"voltage"', '"voltag"'))
    with pytest.raises(InputError, match=r"m.toml, line 6: .*no column 'voltag'.*time, voltage, position.*'voltage'\?"):
        read_log(path, text)


def test_samples_that_should_be_there(tmp_path: Path) -> None:
    (log,) = read_log(write(tmp_path / "log.csv", axis()), saved(tmp_path, "samples = 5000\n" + MAP))
    assert any(f.kind == "cut" and "the map announces 5000 samples" in f.what for f in log.findings)


@pytest.mark.parametrize(
    ("headings", "doubt"),
    [
        (("time", "voltage", "position"), "'time' may be the time, but nothing gives its unit"),
        (("time [s]", "voltage", "position"), "no column tells by its unit that it is the command"),
        (("time [s]", "a [V]", "b [V]", "pos [mm]"), r"a \[V\], b \[V\] could each be the command"),
        (("time [s]", "u [V]", "left [mm]", "right [mm]"), r"left \[mm\], right \[mm\] could each be the position"),
        (("time [s]", "clock [ms]", "u [V]", "y [mm]"), None),
        (("time [s]", "u [V]", "y [counts]"), "in encoder counts; give the resolution"),
    ],
)
def test_what_is_in_doubt_is_not_guessed(tmp_path: Path, headings: tuple[str, ...], doubt: str | None) -> None:
    made = axis(400)
    values = [made["time"], made["voltage"], made["position"] + 1, made["position"]]
    if "clock [ms]" in headings:
        values = [made["time"], made["time"], made["voltage"], made["position"]]
    elif len(headings) == 4 and headings[2].endswith("[V]"):
        values = [made["time"], made["voltage"], made["voltage"], made["position"]]
    path = write(tmp_path / "log.csv", dict(zip(headings, values, strict=False)))
    if doubt is None:
        assert guess(read_table(path)).map is not None  # only one of the two is called time
        return
    with pytest.raises(InputError, match=doubt) as refusal:
        read_log(path)
    assert "save them as log.csv.map.toml beside it" in str(refusal.value)


def test_the_draft_is_a_map_that_can_be_pasted(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", axis())
    (tmp_path / "log.csv.map.toml").write_text(draft(read_table(path)))
    with pytest.raises(InputError, match="unit = '\\?' is the draft's mark for what the file does not tell"):
        read_log(path)
    text = draft(read_table(path))
    for unit in ("s", "V", "mm"):
        text = text.replace('unit = "?"', f'unit = "{unit}"', 1)
    (tmp_path / "log.csv.map.toml").write_text(text)
    (log,) = read_log(path)
    assert np.allclose(log.position, axis()["position"], atol=1e-11)


def test_a_dbc_is_refused_for_a_text(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", axis(200))
    with pytest.raises(InputError, match=r"dbc is for a bus log, and log\.csv is none"):
        read_log(path, saved(tmp_path, '[bus]\ndbc = "axes.dbc"\n' + MAP))


def test_the_layout_of_a_text_is_refused_for_a_mat_file(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", axis(200))
    mapping = saved(tmp_path, '[table]\ndelimiter = "tab"\n' + MAP)
    with pytest.raises(InputError, match=r"\[table\] is for text, and log.mat is none"):
        read_log(tmp_path / "log.mat", mapping)


def test_columns_without_headings_get_a_draft_with_their_time(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack(list(axis(200).values())), delimiter=",")
    found = guess(read_table(path))
    assert found.is_log and found.problem.startswith("nothing tells what column 1, column 2, column 3 are")
    assert 'column = "column 1"' in draft(read_table(path))


def test_two_axes_are_told_apart_by_how_their_names_begin(tmp_path: Path) -> None:
    made = axis(1000)
    columns = {"time [s]": made["time"]}
    for name in ("X", "Y"):
        columns |= {f"{name} voltage [V]": made["voltage"], f"{name} position [mm]": made["position"]}
    assert [log.name for log in read_log(write(tmp_path / "two.csv", columns))] == ["two:X", "two:Y"]


def test_a_log_without_position_is_one_of_its_speed(tmp_path: Path) -> None:
    made = axis(1000)
    columns = {"time [s]": made["time"], "force [kN]": made["voltage"], "speed [m/s]": made["position"]}
    (found,) = read_log(write(tmp_path / "log.csv", columns))
    assert found.is_rate and found.units["position"] == "mm/s" and found.units["command"] == "N"
    assert found.position == pytest.approx(1e3 * made["position"])
    assert found.command == pytest.approx(1e3 * made["voltage"])
    assert any("no position was logged" in finding.what for finding in found.findings)


def test_a_log_of_a_speed_keeps_the_speed_that_was_wanted(tmp_path: Path) -> None:
    made = axis(1000)
    columns = {"time [s]": made["time"], "u [V]": made["voltage"], "n [rpm]": made["position"], "set": made["position"]}
    data = write(tmp_path / "log.csv", columns)
    text = '[time]\ncolumn = "time"\n[axis.X]\ncommand = "u"\nvelocity = "n"\n'
    text += 'reference = {{ column = "set", unit = "{}" }}\n'
    (found,) = read_log(data, saved(tmp_path, text.format("rpm")))
    assert found.extra["reference"] == pytest.approx(found.position)
    (found,) = read_log(data, saved(tmp_path, text.format("deg")))
    assert any("the reference is not used: it is in deg" in finding.what for finding in found.findings)


def test_a_csp_log_has_its_reference_or_position_by_the_following_error(tmp_path: Path) -> None:
    """A drive in cyclic synchronous position mode logs two of the three, and its torque in thousandths."""
    made = axis(1000)
    off = 0.01 * np.sin(made["time"])  # mm
    text = '[time]\ncolumn = "time"\nunit = "s"\n[axis.X]\ncommand = { column = "torque", unit = "‰" }\n'
    error = 'following_error = { column = "error", unit = "mm" }\ntorque_gain = 0.0127\n'
    columns = {"time": made["time"], "torque": made["voltage"], "error": off, "p": made["position"]}
    data = write(tmp_path / "log.csv", columns)
    logs = {}
    for has, other, sign in (("reference", "position", -1.0), ("position", "reference", 1.0)):
        given = f'{has} = {{ column = "p", unit = "mm" }}\n'
        (logs[has],) = read_log(data, saved(tmp_path, text + given + error))
        values = logs[has].position if other == "position" else logs[has].extra["reference"]
        assert values == pytest.approx(made["position"] + sign * off)
        assert logs[has].closed_loop and logs[has].force_gain == 0.0127 and logs[has].units["force"] == "Nm"
        assert logs[has].units["command"] == "%" and logs[has].command == pytest.approx(0.1 * made["voltage"])
    with pytest.raises(InputError, match=r"needs position .* or velocity; or reference and following_error"):
        LogMap.read(saved(tmp_path, text + error))


@pytest.mark.parametrize(
    ("headings", "expected"),
    [
        (
            ("time_s", "commanded_deg", "feedback_deg", "error_abs_deg", "control_command"),
            {"command": "control_command", "position": "feedback_deg", "reference": "commanded_deg"},
        ),
        (
            ("time_s", "commanded_deg_s", "angle_deg", "feedback_deg_s"),  # a speed is not where a position is to go
            {"command": "?", "position": "angle_deg", "velocity": "feedback_deg_s"},
        ),
        (
            ("Zeit", "Geschwindigkeit", "Sollgeschwindigkeit", "Motorspannung"),
            {"command": "Motorspannung", "velocity": "Geschwindigkeit", "reference": "Sollgeschwindigkeit"},
        ),
        (
            ("tempo", "référence [mm]", "posición [mm]", "Vérin [mm]", "tensão [V]"),  # an accent ends no word
            {"command": "tensão", "position": "posición", "reference": "référence"},
        ),
        (
            ("Time (s)", "AccX (g)", "Torque (N·m)", "Motor Optical Speed (RPM)"),
            {"command": "Torque", "velocity": "Motor Optical Speed"},
        ),
        (
            ("time [ms]", "Axis.SetPos [mm]", "Axis.ActPos [mm]", "Axis.ActVelo [mm/s]", "Axis.SetTorque [%]"),
            {
                "command": "Axis.SetTorque",
                "position": "Axis.ActPos",
                "velocity": "Axis.ActVelo",
                "reference": "Axis.SetPos",
            },
        ),
    ],
)
def test_a_draft_knows_what_was_wanted_from_what_was_measured(
    headings: tuple[str, ...], expected: dict[str, str], tmp_path: Path
) -> None:
    """Headings of logs that others published: a test bench of propellers, a motor's student, a drive's trace."""
    rows = [",".join(f"{k / 100 + (k if at == 0 else at)}" for at in range(len(headings))) for k in range(30)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([",".join(headings), *rows]) + "\n", encoding="utf-8")
    (axis,) = tomllib.loads(draft(read_table(path)))["axis"].values()
    assert {quantity: column["column"] for quantity, column in axis.items()} == expected


@pytest.mark.parametrize(("scale", "warned"), [(1.0, True), (0.001, False)])
def test_a_scale_that_converts_the_file_s_unit_is_no_contradiction(scale: float, warned: bool, tmp_path: Path) -> None:
    made = axis(400)
    head = {"time [s]": made["time"], "voltage [V]": made["voltage"], "position [mm]": made["position"]}
    path = write(tmp_path / "log.csv", head)
    said = MAP.replace('column = "position", unit = "mm"', f'column = "position", unit = "m", scale = {scale}')
    (log,) = read_log(path, saved(tmp_path, said))
    assert any("the map was followed" in finding.what for finding in log.findings) == warned
    if not warned:
        assert np.allclose(log.position, made["position"])
