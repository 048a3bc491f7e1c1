"""`rds nc check`, `canon`, `plot` and `time` as a script sees them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from rds.cli.main import app
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan, predicted_time
from rds.machines import load_machine
from rds.nc.check import motion
from rds.nc.language.canon_text import text
from rds.nc.setup import Setup

PROGRAM = """(lines, arcs in three planes, a helix, a compensated contour)
G21 G90 G17
T1 M6
S1000 M3
F300
G0 X5 Y-5
G41 D1 G1 X10 Y0
G1 Y20
X30
Y0
X0
G40 G1 X-5 Y-5
G2 X-5 Y-5 Z-2 I4 J0 P2
G18 G3 X0 Z-2 I2.5 K0
G19 G2 Y0 Z-2 J2.5 K0
T2 M6
G4 P0.25
G0 X0 Y0
G1 X-3
M2
"""
BAD = "F800\nG1 X90\nG12 X1\nX1 X2\nM2\n"
TOOLS = "T1 P1 Z1 D4\nT2 P2 D6\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.ngc").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / "bad.ngc").write_text(BAD, encoding="utf-8")
    (tmp_path / "tools.tbl").write_text(TOOLS, encoding="utf-8")
    return tmp_path


def nc(*words: str) -> Result:
    return CliRunner().invoke(app, ["nc", *words])


def given(name: str, *more: str) -> tuple[str, ...]:
    return (name, "part.ngc", "--tools", "tools.tbl", *more)


def test_check_of_a_valid_program(folder: Path) -> None:
    done = nc(*given("check"))
    assert done.exit_code == 0, done.stderr
    assert "part.ngc: mini-cnc can run it" in done.stdout and "compiled: part.dat" in done.stdout
    assert (folder / "part.dat").exists()
    found = json.loads(nc(*given("check", "--json")).stdout)
    assert found["ok"] and found["faults"] == [] and found["compiled"] == "part.dat" and found["tools"] == [1, 2]
    assert found["reach"]["Z"] == pytest.approx([-2.0, 0.5])


def test_check_of_an_invalid_program(folder: Path) -> None:
    (folder / "bad.dat").write_bytes(b"RDS compiled part program 2\n")
    done = nc("check", "bad.ngc")
    assert done.exit_code == 1
    assert done.stdout.splitlines() == [
        "bad.ngc:1:1: F800: a feed of 800 mm/min is more than X, the slowest axis that moves, can do (780); lower it",
        "bad.ngc:2:4: X90: X would reach 90 mm (machine coordinates), 15 mm beyond its travel of -75 to 75; "
        "shorten the path, or move its origin",
        "bad.ngc:3:1: G12: G12 mills a circular pocket clockwise on other controls; "
        "write the circle as G2 with I and J",
        "bad.ngc:4:4: X2: two X words on one line; leave one",
        "bad.ngc: not run from line 3 on: the words after it were only read",
        "bad.ngc: mini-cnc can't run it: 4 faults",
    ]
    assert not (folder / "bad.dat").exists()
    found = json.loads(nc("check", "bad.ngc", "--json").stdout)
    assert not found["ok"] and found["compiled"] is None and found["stopped"] == {"file": "bad.ngc", "line": 3}
    assert [(fault["line"], fault["column"], fault["word"]) for fault in found["faults"]] == [
        (1, 1, "F800"),
        (2, 4, "X90"),
        (3, 1, "G12"),
        (4, 4, "X2"),
    ]


WARNED = [
    ("M3\nG0 X1\nM2\n", "1:1: M3: warning: the spindle is on at a speed of 0, and stands still; give one (S)", 1),
    ("G0 X1 S500\nM2\n", "1:7: S500: warning: no M3 or M4 of the program starts the spindle, which stands still", 1),
    ("S500 M3\nG0 X1 S0\nM2\n", "2:7: S0: warning: the spindle is on at a speed of 0", 1),
    ("\ufeffS500 M4\nS0 M3\nM2\n", "2:4: M3: warning: the spindle is on at a speed of 0", 1),
    ("G0 X1\nM2\n(note)\n\nG0 X2\nX3\n", "5: warning: the program ends by M2 in line 2, and what follows is", 1),
    ("%\nG0 X1\n%\nM3 X2\n", "4: warning: the program ends by % in line 3, and what follows is not run", 1),
    ("%\nG0 X1\nM30\nX2\n%\nX3\n", "4: warning: the program ends by M30 in line 3, and what follows is", 1),
    ("o1 call\nM2\n(its definition)\no1 sub\nG0 X1\no1 endsub\n; done\n", "", 0),
    ("%\nG0 X1 M2\n%\n\n", "", 0),
    ("S500 M3\nM5\nS0\nM2\n", "", 0),
]


@pytest.mark.parametrize(("program", "warning", "count"), WARNED)
def test_check_warns_of_what_is_allowed_and_hardly_meant(folder: Path, program: str, warning: str, count: int) -> None:
    (folder / "warned.ngc").write_text(program, encoding="utf-8")
    done = nc("check", "warned.ngc")
    assert done.exit_code == 0
    assert f"warned.ngc:{warning}" in done.stdout and done.stdout.count("warning:") == count
    found = json.loads(nc("check", "warned.ngc", "--json").stdout)
    assert found["ok"] and len(found["warnings"]) == count


def test_check_of_a_file_that_is_no_program(folder: Path) -> None:
    """Long names between < and >, control characters, lines without end: a fault by line, and nothing to obey."""
    noise = bytes(range(256)) * 40
    Path("noise.ngc").write_bytes(
        b"\x7fELF\x02 o<" + noise.replace(b"\n", b"").replace(b">", b"")[:4000] + b"> call\n" + noise
    )
    done = nc("check", "noise.ngc")
    assert done.exit_code == 1 and done.stdout.startswith("noise.ngc:1")
    assert done.stdout.replace("\n", "").isprintable()


def test_a_program_is_given_more_rounds(folder: Path) -> None:
    (folder / "rounds.ngc").write_text("o1 while [#1 lt 50]\n#1=[#1+1]\no1 endwhile\nM2\n", encoding="utf-8")
    done = nc("check", "rounds.ngc", "--max-jumps", "49")
    assert done.exit_code == 1 and "more than 49 calls and jumps back" in done.stdout
    assert "allow more (--max-jumps)" in done.stdout
    assert nc("check", "rounds.ngc", "--max-jumps", "50").exit_code == 0


def test_check_with_proof(folder: Path) -> None:
    done = nc(*given("check", "--proof"))
    assert done.exit_code == 0, done.stdout
    assert "proof: the cutter's edge keeps to 1 contour within" in done.stdout
    assert (folder / "part-proof.png").read_bytes().startswith(b"\x89PNG")
    found = json.loads(nc(*given("check", "--proof", "--json")).stdout)
    assert found["proof"]["max_deviation_mm"] < 1e-6 and found["pictures"] == ["part-proof.png"]
    (folder / "part.ngc").write_text("G0 X1\nM2\n", encoding="utf-8")
    assert "compensates no cutter" in nc(*given("check", "--proof")).stdout
    assert "proof: none" in nc("check", "bad.ngc", "--proof").stdout


def test_canon_prints_the_calls(folder: Path) -> None:
    expected = list(text(Setup(tools=Path("tools.tbl")).interpret(Path("part.ngc"))))
    assert nc(*given("canon")).stdout.splitlines() == expected
    found = json.loads(nc(*given("canon", "--json")).stdout)
    assert [call["call"] for call in found["calls"]] == [line[13:] for line in expected]


def test_canon_of_an_invalid_program(folder: Path) -> None:
    done = nc("canon", "bad.ngc")
    assert done.exit_code == 2
    assert done.stdout.splitlines()[-1].endswith("STRAIGHT_FEED(90.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)")
    assert "rds: bad.ngc:3:1: G12:" in done.stderr
    done = nc("canon", "bad.ngc", "--json")
    assert (done.exit_code, done.stdout) == (2, "")


def test_canon_into_a_pipe_that_closes(folder: Path) -> None:
    (folder / "long.ngc").write_text("G1 F100\n" + "X1\nX2\n" * 20000 + "M2\n", encoding="utf-8")
    program = f"{sys.executable} -m rds.cli.main nc canon long.ngc | head -1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", program], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)\n"


@pytest.mark.parametrize(("name", "begin"), [("p.png", b"\x89PNG"), ("p.SVG", b"<?xml"), ("p.pdf", b"%PDF")])
def test_plot(folder: Path, name: str, begin: bytes) -> None:
    done = nc(*given("plot", "-o", name))
    assert (done.exit_code, done.stdout, done.stderr) == (0, f"picture: {name}\n", "")
    assert (folder / name).read_bytes().startswith(begin)


def test_plot_of_what_the_machine_cannot_do(folder: Path) -> None:
    (folder / "wide.ngc").write_text("G0 X90\nM2\n", encoding="utf-8")
    done = nc("plot", "wide.ngc", "--json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["picture"] == "wide-path.png"
    assert "note: mini-cnc can't run it; `rds nc check` tells why (1 fault)" in done.stderr
    assert (folder / "wide-path.png").exists()


def test_time_is_that_of_the_planner(folder: Path) -> None:
    found = json.loads(nc(*given("time", "--json")).stdout)
    machine = load_machine("mini-cnc")
    blocks = motion(Path("part.ngc"), machine, Setup(tools=Path("tools.tbl")))
    planned = predicted_time(plan(blocks, Limits.of(machine), machine.sample_period))
    assert found["total_s"] == pytest.approx(planned, abs=1e-9)
    assert found["samples"] == round(planned / 0.001)
    assert found["cutting_s"] + found["rapid_s"] + found["dwell_s"] == pytest.approx(planned)
    assert found["dwell_s"] == pytest.approx(0.25)
    certificate = found["certificate"]
    assert certificate["ok"] and certificate["samples"] == found["samples"]
    tools = found["by_tool"]
    assert set(tools) == {"1", "2"} and tools["1"]["dwell_s"] == 0.0
    assert tools["2"]["cutting_s"] == pytest.approx(3 / (300 / 60), rel=0.5)  # 3 mm at 5 mm/s, and the ramps
    assert sum(tool["total_s"] for tool in tools.values()) == pytest.approx(planned)
    shown = nc(*given("time"))
    assert f"{planned:.3f}" in shown.stdout and "all" in shown.stdout


@pytest.mark.parametrize("name", ["time", "plot", "canon"])
def test_what_cannot_be_read_is_refused(folder: Path, name: str) -> None:
    done = nc(name, "bad.ngc")
    assert done.exit_code == 2 and "rds: bad.ngc:" in done.stderr
    assert list(folder.glob("*.png")) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *(
            ((name, file), f"rds: {file}: cannot be read ({why}); check the path")
            for name in ("check", "canon", "time", "plot", "step")
            for file, why in (("none.ngc", "No such file or directory"), (".", "Is a directory"))
        ),
        (("check", "part.ngc", "--machine", "none"), "there is no machine 'none'"),
        (("check", "part.ngc", "--tools", "none.tbl"), "none.tbl"),
        (("check", "part.ngc", "--parameters", "none.var"), "none.var"),
        (("canon", "part.ngc", "--with", "gs"), "--with 'gs' is no option of the dialect; there are block-delete, gr"),
        (("plot", "part.ngc", "--tools", "tools.tbl", "-o", "p.bmp"), "end its name with .png, .svg or .pdf"),
    ],
)
def test_bad_input_is_told_with_its_remedy(folder: Path, words: tuple[str, ...], said: str) -> None:
    done = nc(*words)
    assert (done.exit_code, done.stdout) == (2, ""), done.stdout
    assert done.stderr.startswith("rds: ") and said in done.stderr
    assert not list(folder.glob("*.dat")) and not list(folder.glob(".*.part"))


@pytest.mark.parametrize("name", ["canon", "time", "plot", "step", "run"])
def test_an_experiment_or_a_controller_is_no_program_of_a_hundred_faults(folder: Path, name: str) -> None:
    for file, what in (("own.toml", "a TOML file"), ("own.py", "a Python file")):
        Path(file).write_text("axis = 1\n")
        done = nc(name, file)
        assert done.exit_code == 2 and done.stderr.startswith(f"rds: {file}: is {what}, and no part program; `rds ")


def test_options_of_the_dialect(folder: Path) -> None:
    (folder / "oacs.ngc").write_text("P001;\nN10 G01 X0 Y0 F60;\nN20 G01 X10 A25 F60 S100;\nN30 M00;\nN40 M02;\n")
    done = nc("check", "oacs.ngc", "--machine", "mrmt-oacs", "--with", "program-numbers")
    assert done.exit_code == 0, done.stdout
    assert nc("check", "oacs.ngc", "--machine", "mrmt-oacs").exit_code == 1
    (folder / "deleted.ngc").write_text("/G0 X200\nM2\n")
    assert nc("check", "deleted.ngc").exit_code == 1
    assert nc("check", "deleted.ngc", "--with", "block-delete").exit_code == 0


def test_help_names_the_commands(folder: Path) -> None:
    shown: Any = nc("--help").stdout
    assert all(name in shown for name in ("check", "canon", "plot", "time", "make"))
