"""Machines with less than two linear axes, and the programs that the theses print: they run, with sensible pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_machines import machine
from typer.testing import CliRunner

from rds import Experiment
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.nc.axis_plot import plot_axes
from rds.nc.check import motion
from rds.nc.language.dialect import Dialect
from rds.nc.run.pictures import along, path
from rds.nc.run.run import PartProgram
from rds.nc.setup import Setup

PROGRAMS = {
    "X": "G21 G90 G61 F600\nG0 X4\nG1 X6\nX2\nM2\n",
    "XC": "G21 G90 G61 F600\nG0 X4\nG1 X6 C10\nC40 F3000\nG0 X0 C0\nM2\n",
    "C": "G21 G90 G61 F1200\nG0 C10\nG1 C30\nG0 C0\nM2\n",
}
P001 = "P001;\nN10 G01 X0 Y0;\nN20 G01 X100 A25 F100 S1000;\nN30 M00;\nN40 M02;\n"
TABLE_5_2 = "O001  \nN010 G21 G40 G91  \nN020 G0 X70 Y20  \nN030 X-70 Y-20  \nN040 M5\n"


def written(folder: Path, text: str) -> Path:
    file = folder / "part.ngc"
    file.write_text(text)
    return file


@pytest.mark.parametrize("axes", PROGRAMS)
def test_axes_that_no_side_shows_are_drawn_over_time(axes: str, tmp_path: Path) -> None:
    part = PartProgram(written(tmp_path, PROGRAMS[axes]), str(machine(tmp_path, axes)))
    result = part.run()
    assert result.meta["program"]["completed"]
    assert (result.meta["program"]["contour_error"] is None) == (axes == "C")
    picture = path(result, part.prepared)
    places = [place for place in picture.axes if place.get_title(loc="left")]
    assert [place.get_title(loc="left") for place in places] == [f"{name} over time" for name in axes]
    for name, place in zip(axes, places, strict=True):
        planned = np.concatenate([line.get_ydata() for line in place.lines[:2]])
        reference = result[f"{name}_reference"]
        assert np.nanmax(planned) == pytest.approx(reference.max()) and np.nanmin(planned) == reference.min()
        rapid = place.lines[1].get_ydata()
        assert 0 < np.isfinite(rapid).sum() < len(rapid)
    speed = along(result, part.prepared).axes[2]
    drawn = [line.get_ydata().max() for line in speed.lines]
    fastest = {"X": 780.0, "C": 3600.0}
    assert drawn == pytest.approx([fastest[name] for name in axes], rel=0.2)


def test_the_plot_command_draws_one_axis(tmp_path: Path) -> None:
    part, one = written(tmp_path, PROGRAMS["X"]), machine(tmp_path, "X")
    assert CliRunner().invoke(app, ["nc", "plot", str(part), "--machine", str(one)]).exit_code == 0
    assert (tmp_path / "part-path.png").stat().st_size > 5000


def test_the_plot_shows_each_axis_along_the_way(tmp_path: Path) -> None:
    small = load_machine(str(machine(tmp_path, "XC")))
    segments = [block.segments for block in motion(written(tmp_path, PROGRAMS["XC"]), small, Setup())]
    of_x, of_c = plot_axes(segments, small, "part.ngc").axes
    (rapid, feed) = of_x.lines
    assert np.nanmax(feed.get_ydata()) == 6.0 and np.nanmax(rapid.get_ydata()) == 6.0
    assert np.nanmax(feed.get_xdata()) == pytest.approx(4.0 + 2.0 + 30.0)
    assert np.nanmax(of_c.lines[1].get_ydata()) == 40.0


@pytest.mark.parametrize(
    ("axes", "text", "end"),
    [("X", PROGRAMS["X"], {"X": 2.0}), ("XC", "G21 G90 F600\nG1 X4\nM2\n", {"X": 4.0})],
)
def test_an_interpolator_moves_the_linear_axes_that_there_are(
    axes: str, text: str, end: dict[str, float], tmp_path: Path
) -> None:
    part = PartProgram(written(tmp_path, text), str(machine(tmp_path, axes)), interpolator="constant-velocity")
    result = part.run()
    assert result.meta["program"]["completed"] and result.axes == list(end)
    assert {name: result[f"{name}_reference"][-1] for name in end} == end
    assert path(result, part.prepared).axes and along(result, part.prepared).axes


def test_an_interpolator_s_arc_lies_in_the_plane_of_the_axes_that_there_are(tmp_path: Path) -> None:
    text = "G21 G90 G18 F600\nG1 X2\nG3 X0 Z2 I-2 K0\nM2\n"
    part = PartProgram(written(tmp_path, text), str(machine(tmp_path, "XZ")), interpolator="tustin")
    result = part.run()
    assert result.meta["program"]["path_error"]["max"] < 0.01 and result["Z_reference"][-1] == 2.0
    planned = PartProgram(part.prepared.file, str(tmp_path / "XZ.toml")).run()
    assert planned["X_reference"].min() == pytest.approx(result["X_reference"].min(), abs=0.01)


@pytest.mark.parametrize("axes", ["XC", "C"])
def test_an_interpolator_moves_rotary_axes_at_the_planned_feed(axes: str, tmp_path: Path) -> None:
    """X keeps to F while C comes along; alone C has F in degrees/min. Planned motion is slower by its ramps alone."""
    part = PartProgram(written(tmp_path, PROGRAMS[axes]), str(machine(tmp_path, axes)), interpolator="tustin")
    result = part.run()
    assert result.meta["program"]["completed"] and result.axes == list(axes) and result["C_reference"][-1] == 0.0
    assert ("path_error" in result.meta["program"]) == (axes == "XC")
    line = result["program_line"].astype(int)
    fed = {"XC": (3, "X", 600.0 / 60), "C": (3, "C", 1200.0 / 60)}[axes]
    speed = np.abs(np.diff(result[f"{fed[1]}_reference"]))[line[1:] == fed[0]] / 0.001
    assert np.median(speed) == pytest.approx(fed[2])
    planned = PartProgram(part.prepared.file, str(tmp_path / f"{axes}.toml")).run()
    assert 0.0 < planned["time"][-1] - result["time"][-1] < 0.6
    assert path(result, part.prepared).axes and along(result, part.prepared).axes


def test_a_path_may_turn_an_axis_but_no_arc_is_of_one(tmp_path: Path) -> None:
    rows = [{"kind": "line", "end": [3.0, 9.0]}]
    words = {"kind": "path", "start": [0.0, 0.0], "feed": 300, "segment": rows}
    on = {"machine": str(machine(tmp_path, "XC")), "axis": ["X", "C"], "controller": "tracking"}
    led = Experiment(**on, reference=words).run()
    planned = Experiment(**on, reference=words | {"profile": "planned"}).run()
    for result in (led, planned):
        assert (result["X_reference"][-1], result["C_reference"][-1]) == (3.0, 9.0)
        # the feed is that of both axes together, degrees counted as mm
        assert result["X_reference_velocity"].max() == pytest.approx(5.0 * 3.0 / 90.0**0.5, rel=1e-3)
    arc = [{"kind": "arc", "end": [0.0, 0.0], "centre": [3.0, 0.0]}]
    with pytest.raises(InputError, match=r"segment 1 is an arc in which C takes part; arcs are of X, Y and Z"):
        Experiment(**on, reference=words | {"segment": arc})


def test_an_interpolator_does_not_move_the_tip(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 2: G43\.4 moves the tool's tip, and an interpolator moves axes"):
        PartProgram(
            written(tmp_path, "G21 G90 G43.4 G64 P0.1 F300\nG1 X2 Y0 Z0 A5\nM2\n"), "xyzac", interpolator="tustin"
        )


def test_p001_of_the_thesis_runs_and_says_what_is_assumed(tmp_path: Path) -> None:
    setup = Setup(options=Dialect(program_numbers=True, default_feed=True))
    for _ in range(2):  # the second time from the compiled form
        part = PartProgram(written(tmp_path, P001), "mrmt-oacs", setup=setup, sample_period=0.02)
        note, idle = part.prepared.notes
        assert "line 3" in idle and "no M3 or M4 of the program starts the spindle" in idle
        assert "line 2" in note and "the default feed of mrmt-oacs, 66 mm/min, is assumed" in note
    result = part.run()
    assert result.meta["program"]["completed"] and note in result.meta["notes"]
    assert result["X_measured"][-1] == pytest.approx(100.0, abs=0.05)
    assert result["A_measured"][-1] == pytest.approx(25.0, abs=0.1)
    assert result["X_reference_velocity"].max() * 60 == pytest.approx(100.0)
    titles = [place.get_title(loc="left") for place in path(result, part.prepared).axes]
    assert [title for title in titles if title] == ["ZX", "A over time"]


def test_table_5_2_of_the_thesis_runs_and_returns(tmp_path: Path) -> None:
    setup = Setup(options=Dialect(program_numbers=True, open_end=True))
    part = PartProgram(written(tmp_path, TABLE_5_2), setup=setup, sample_period=0.01)
    assert "line 5: the program has no M2, M30 or %" in part.prepared.notes[0]
    result = part.run()
    assert result.meta["program"]["completed"]
    assert result["X_reference"].max() == pytest.approx(70.0) and result["Y_reference"].max() == pytest.approx(20.0)
    assert result["X_reference"][-1] == pytest.approx(0.0) and result["Y_reference"][-1] == pytest.approx(0.0)


def test_a_machine_says_its_default_feed(tmp_path: Path) -> None:
    own = machine(tmp_path, "XC")
    own.write_text("default_feed = 90.0\n" + own.read_text())
    part = written(tmp_path, "G1 X1\nC10\nX2 F100\nM2\n")
    notes: list[str] = []
    blocks = list(motion(part, load_machine(str(own)), Setup(options=Dialect(default_feed=True)), notes=notes))
    rates = np.concatenate([block.segments["rate"] for block in blocks])
    assert rates == pytest.approx([1.5, 60.0, 100 / 60])  # mm/s, degrees/s of C's limit, and what F says
    said = "no feed rate is set before this move: the default feed of XC, 90 mm/min, is assumed (option default-feed)"
    assert notes == [f"line 1: {said}"]


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (P001, {"program_numbers": True}, "no feed rate is set; .*`--with default-feed`"),
        (TABLE_5_2, {"program_numbers": True}, "the program does not end; .*`--with open-end`"),
        ("G0 X1\nO001\nM2\n", {"program_numbers": True}, "a program number stands on the first block"),
        ("%\nG0 X1\n", {"open_end": True}, "the program does not end"),
        ("O1 SUB\nG0 X1\n", {"open_end": True}, "not closed before the file's end"),
        ("G93 G1 X1\nM2\n", {"default_feed": True}, "in inverse time"),
        ("G95 S100 M3\nG1 X1\nM2\n", {"default_feed": True}, "units per revolution"),
    ],
)
def test_what_the_options_do_not_allow(text: str, options: dict[str, bool], said: str, tmp_path: Path) -> None:
    from rds.core.errors import RdsError

    with pytest.raises(RdsError, match=said):
        list(motion(written(tmp_path, text), load_machine("mini-cnc"), Setup(options=Dialect(**options))))
