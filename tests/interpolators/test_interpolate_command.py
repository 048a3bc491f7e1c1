"""`rds interpolate` as its user meets it: numbers, files, refusals that say what to do."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import ROOT
from typer.testing import CliRunner, Result

from rds.cli.main import app
from rds.results import open_result

PROGRAM = """G21 G90 G17 G94 G54
F600
G0 X10 Y10 Z0
G1 X40 Y10
G3 X50 Y20 I0 J10
G4 P1
G2 X50 Y20 I-10 J0 Z-2
G18 G3 X60 Z-2 I5 K0
G17 G2 X60 Y20 I-5 J0 P3 Z-4
M2
"""


def run(words: str) -> Result:
    return CliRunner().invoke(app, ["interpolate", *shlex.split(words)])


def numbers(words: str) -> dict:
    done = run(f"{words} --json")
    assert done.exit_code in (0, 1), done.output
    return json.loads(done.stdout)


def test_the_example_of_the_paper_in_numbers() -> None:
    said = numbers("--arc 100,0:0,100:0,0 --feed 600 -m improved-tustin")
    assert said["steps"]["count"] == 40 and said["within"] and 15708 <= said["samples"] <= 15866  # 1 % at most
    assert said["path_error_mm"] <= 0.01 and said["chord_error_mm"] <= 0.01
    forced = run("--arc 100,0:0,100:0,0 --feed 600 -m improved-tustin --option steps=39")
    assert forced.exit_code == 1 and "39 steps of improved-tustin are 0.01029 mm from the arc" in forced.stderr
    assert "NO" in forced.stdout


@pytest.mark.parametrize("feed", ["600", "600mm/min", "10 mm/s", "0.6m/min", "23.62204724409449in/min"])
def test_feed_rates_in_units(feed: str) -> None:
    assert numbers(f"--line 0,0:30,40 --feed '{feed}'")["samples"] == 5000


def test_table_and_pictures(tmp_path: Path) -> None:
    words = f"--line 0,0:30,40:60,0 --feed 600 -m reference-pulse --period 0.01 --out {tmp_path / 'out'} --plot"
    done = run(f"{words} --acceleration s-shape --multipliers 1,2,3,2,1 --exact-stop")
    assert done.exit_code == 0, done.output
    files = re.findall(r"wrote (\S+)", done.stdout)
    assert {Path(file).name for file in files} >= {"interpolation.csv", "motion.png", "path.png", "errors.png"}
    assert all(Path(file).stat().st_size > 1000 for file in files)
    table = open_result(tmp_path / "out" / "interpolation.csv")
    assert len(table) == 1 + 2 * (500 + 4) and table["X_pulses"].sum() == 6000
    assert (table["X_reference"][-1], table["Y_reference"][-1]) == (60.0, 0.0)


def test_pictures_without_a_folder_go_to_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("--line 0:5 --feed 600 --plot").exit_code == 0
    assert sorted(path.name for path in (tmp_path / "interpolation").glob("*.png")) == ["errors.png", "motion.png"]


def test_a_part_program(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text(PROGRAM)
    said = numbers(f"{file} --period 0.01 --out {tmp_path}")
    # rapid, line, quarter, helix, half circle in ZX, and P3: two whole turns and a part
    assert said["segments"] == 8 and said["axes"] == ["X", "Y", "Z"]
    length = 10 * np.sqrt(2) + 30 + 5 * np.pi + np.hypot(20 * np.pi, 2) * 0.75
    assert said["notes"] == ["1 × dwell (G4): the axes rest for 1 s in all"]
    table = open_result(tmp_path / "interpolation.csv")
    end = [table[f"{axis}_reference"][-1] for axis in "XYZ"]
    assert end == [60.0, 20.0, -4.0]
    assert said["path_error_mm"] < 1e-6 and said["programmed_length_mm"] > length
    quick = table["X_reference_velocity"][table["segment"] == 1].max()
    assert quick == pytest.approx(13.0, rel=0.02)  # the mini CNC's axes


@pytest.mark.parametrize("words", ["", "--acceleration s-shape --acceleration-time 0.1", "-m reference-pulse"])
def test_dwells_of_a_part_program_take_their_time_at_rest(tmp_path: Path, words: str) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("G21 F600\nG4 P0.25\nG1 X10\nG4 P0.5\nG1 Y10\nM0\nX0 Y0\nG4 P1\nM2\n")
    said = numbers(f"{file} --period 0.01 --out {tmp_path} {words}")
    assert said["notes"] == [
        "1 × stop (M0, M1, M60): the axes rest, and it goes on at once",
        "3 × dwell (G4): the axes rest for 1.75 s in all",
    ]
    table = open_result(tmp_path / "interpolation.csv")
    held = 9 if "s-shape" in words else 0  # samples that the filter adds each time that it comes to rest
    moving = 100 + held, 100 + held, 142 + held  # 10, 10 and 14.14 mm at 10 mm/s
    assert said["samples"] == 25 + moving[0] + 50 + moving[1] + moving[2] + 100
    x, y = table["X_reference"], table["Y_reference"]
    assert not x[:26].any() and x[26] > 0.0
    corner = 25 + moving[0]
    assert (x[corner : corner + 51] == 10.0).all() and not y[: corner + 51].any() and y[corner + 51] > 0.0
    assert not table["X_reference_velocity"][corner + 1 : corner + 51].any()
    stop = corner + 50 + moving[1]
    assert (x[stop], y[stop]) == (10.0, 10.0) and (x[-101:] == 0.0).all()


@pytest.mark.parametrize("profile", ["planned", "trapezoid", "blended", "point-to-point"])
def test_a_part_program_by_a_profile(tmp_path: Path, profile: str) -> None:
    if profile == "point-to-point":
        pytest.importorskip("ruckig")
    file = tmp_path / "part.ngc"
    file.write_text(PROGRAM)
    words = f"{file} --profile {profile} --period 0.01"
    said = numbers(f"{words} --out {tmp_path / 'out'} --plot")
    assert said["certificate"]["ok"] and said["dwell_s"] == 1.0
    drawn = [f"{name}.png" for name in ("motion", "feed", "path", "certificate")]
    assert [Path(path).name for path in said["files"]] == ["interpolation.csv", *drawn]
    table = open_result(tmp_path / "out" / "interpolation.csv")
    assert len(table) == said["samples"] + 1 and table["time"][-1] == pytest.approx(said["time_s"])
    assert [table[f"{axis}_reference"][-1] for axis in "XYZ"] == [60.0, 20.0, -4.0]
    timed = CliRunner().invoke(
        app, ["nc", "time", str(file), "--profile", profile, "--sample-period", "0.01", "--json"]
    )
    assert json.loads(timed.stdout)["samples"] == said["samples"] + 1  # predicted is executed
    shown = run(words)
    assert shown.exit_code == 0 and "largest jerk X, of its limit" in shown.stdout
    assert "Not promised" in shown.stdout if profile in ("trapezoid", "blended") else "Not promised" not in shown.stdout


def test_a_profile_takes_the_place_of_an_interpolator(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text(PROGRAM)
    for words, message in {
        "--line 0:5 --feed 600 --profile planned": "--profile is for a part program",
        "path.toml --profile planned": "`profile` in [reference] of an experiment plans one",
        f"{file} --profile planned -m tustin": "--method is of interpolators, and --profile takes their place",
        f"{file} --profile planned --acceleration linear": "--acceleration is of interpolators",
        f"{file} --profile fast": "profile 'fast' is not one of planned, trapezoid, blended, point-to-point",
        f"{file}x --profile planned": "there is no such part program",
        f"{file} --profile planned --period 0": "--period",
    }.items():
        done = run(words)
        assert done.exit_code == 2 and message in " ".join(done.stderr.split()), done.output


def test_faults_of_a_part_program_name_their_line(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("G21 F600\nG1 X10 Q7\n")
    done = run(str(file))
    assert done.exit_code == 2 and re.search(r"part\.ngc:2", done.stderr)
    file.write_text("G21 F60\nG1 X1000\nM2\n")
    done = run(str(file))
    assert done.exit_code == 2 and re.search(r"part\.ngc:2.*travel", done.stderr)


GOOD = """
import math
import numpy as np
params = {"ramp": 0.1}

def interpolate(segment, T, params):
    start, end = np.array(segment.start), np.array(segment.end)
    N = math.ceil((math.dist(start, end) / segment.feed_rate + params["ramp"]) / T)
    for k in range(1, N + 1):
        s, rate = k / N, 1 / (N * T)
        yield (start + (end - start) * (3 * s**2 - 2 * s**3), (end - start) * (6 * s - 6 * s**2) * rate,
               (end - start) * (6 - 12 * s) * rate**2)
"""


def test_a_user_s_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(GOOD)
    said = numbers(f"--line 0,0:3,4 --feed 600 -m {file} --option ramp=0.5")
    assert said["method"] == "mine.py" and said["samples"] == 1000
    # what the check warns of is not lost
    assert any("follows the straight line" in note for note in said["notes"])
    done = run(f"--line 0,0:3,4 --feed 600 -m {file} --option rump=0.5")
    assert done.exit_code == 2 and "unknown parameter 'rump'; known parameters: ramp" in done.stderr


def test_faults_of_a_user_s_file_are_those_of_the_check(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def interpolate(segment, T, params):\n    yield segment.start\n")
    done = run(f"--line 0,0:3,4 --feed 600 -m {file}")
    assert done.exit_code == 2 and "yields (position, velocity, acceleration): row 0" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "nothing to interpolate; give one of a part program, --line and --arc"),
        ("--line 0,0:1,1 --arc 1,0:0,1:0,0 --feed 1", "--line and --arc were given"),
        ("--line 0,0:1,1", "needs a feed rate"),
        ("part.ngc --feed 100", "the program's word F"),
        ("path.toml --feed 100", "`feed` of the path's file says its feed rate"),
        ("no_such.ngc", "there is no such part program"),
        ("--line 0,0 --feed 1", "needs two points or more"),
        ("--line 0,0:1,0 --feed 60 --period 1e-12", "makes 1e+12 samples of 1e-12 s, more than 2000000"),
        ("--line 0,0:1e308,0 --feed 60", "samples of 0.001 s, more than 2000000"),
        ("--line 0,0:1,0 --feed 60 --acceleration linear --acceleration-time 1e308", "give a shorter time"),
        ("--line 0,0:1,0 --feed 60 --acceleration s-shape --acceleration-time 1e9", "give a shorter time"),
        ("--line 0,0:1 --feed 1", "same number of axes"),
        ("--line a,0:1,2 --feed 1", "could not convert string to float: 'a'"),
        ("--line 0,0:1,1 --feed 3furlong", "with a unit: mm/min, mm/s"),
        ("--line 0,0:1,1 --feed -3", "must be a number above 0"),
        ("--line 0,0:1,1 --feed 1 --clockwise", "--clockwise is for --arc"),
        ("--line 0,0:1,1 --feed 1 --tools t.tbl", "--tools is for a part program"),
        ("--line 0,0:1,1:1,1e400 --feed 1", "segment 2: "),
        ("--arc 1,0:0,1 --feed 1", "needs start, end and centre"),
        ("--arc 1,0:0,1:0,0 --feed 1 --plane XW", "--plane 'XW' must be one of XY, ZX, YZ"),
        ("--arc 1,0:0,1:0,0 --feed 1 --plane ZX", "need 3 axes"),
        ("--line 0,0:1,1 --feed 1 -m cubic", "there is no interpolator 'cubic'"),
        ("--line 0,0:1,1 --feed 1 -m euler --option blue=1", "did you mean 'blu'"),
        ("--line 0,0:1,1 --feed 1 -m euler --option blu=high", "must be a number"),
        ("--line 0,0:1,1 --feed 1 -m euler --option blu", "must be NAME=VALUE"),
        ("--line 0,0:1,1 --feed 1 -m euler --option blu=1 --option blu=2", "--option blu is given twice, 1 and 2"),
        ("--line 0,0:1,1 --feed 1 --multipliers 1,2", "goes with --acceleration"),
        ("--line 0,0:1,1 --feed 1 --exact-stop", "--exact-stop goes with --acceleration"),
        ("--line 0,0:1,1 --feed 1 --acceleration s-shape --multipliers 1,x", "write them as numbers"),
        ("--line 0,0:1,1 --feed 1 --acceleration s-shape --multipliers 1 --acceleration-time 1", "give one of them"),
        ("--line 0,0:1,1 --feed 1 --period 0", "must be a finite number above 0"),
    ],
)
def test_refusals(words: str, said: str) -> None:
    done = run(words)
    assert done.exit_code == 2 and said in done.stderr, done.output


def test_the_commands_of_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("part.ngc").write_text(PROGRAM)
    Path("my_interpolator.py").write_text((ROOT / "examples" / "my_interpolator.py").read_text(encoding="utf-8"))
    text = (ROOT / "docs" / "interpolation.md").read_text(encoding="utf-8")
    table = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert table is not None
    Path("path.toml").write_text(table.group(1))
    commands = re.findall(r"^rds interpolate (.*?)(?:   .*)?$", text, re.MULTILINE)
    assert len(commands) == 6
    for command in commands:
        assert run(command).exit_code == 0, command
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(code, "docs/interpolation.md", "exec"), names)
    assert Path("path.csv").is_file()
    assert names["result"].metrics["X"]["max_abs_error"] < 0.05  # mm


@pytest.mark.parametrize(("method", "least"), [("euler", 12337), ("improved-euler", 3929), ("improved-tustin", 40)])
def test_the_fewest_steps_are_those_of_the_document_at_any_feed(method: str, least: int) -> None:
    assert f"| {method} | " in (document := (ROOT / "docs/interpolation.md").read_text(encoding="utf-8"))
    assert re.search(rf"^\| {method} \|.*\| {least} \|", document, re.MULTILINE)
    for feed in (600, 1000):
        said = numbers(f"--arc 100,0:0,100:0,0 --feed {feed} -m {method}")["steps"]
        assert said["least"] == least <= said["count"]
        if method.endswith("euler"):
            assert said["count"] == least
    assert (
        numbers(f"--arc 100,0:0,100:0,0 --feed 600 -m {method} --option steps={least + 100}")["steps"]["least"] is None
    )
