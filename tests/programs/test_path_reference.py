"""A path as reference: the interpolator runs inside the loop, and is held, slowed down and stopped while it does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, lists, sampled_from, tuples
from small_machines import machine
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.core.errors import ContractError, InputError
from rds.core.types import ArcSegment, LineSegment
from rds.interpolators.acceleration import make_acceleration
from rds.interpolators.interpolator import library_interpolator
from rds.interpolators.path import interpolate
from rds.machines import load_machine
from rds.modes.loop.execution import State
from rds.modes.loop.interpolated import Interpolated
from rds.modes.loop.program import InterpolatedProgram
from rds.nc.run.judge import located
from rds.nc.run.methods import compare_methods
from rds.nc.run.path import as_prepared
from rds.nc.run.path_method import Method, program_of
from rds.nc.run.path_segments import in_room
from rds.nc.run.pictures import along, path
from rds.nc.run.report import findings
from rds.nc.run.run import PartProgram

T = 0.001
CIRCLE = 'start = [0.0, 0.0]\nfeed = 600\n[[segment]]\nkind = "arc"\nend = [0.0, 0.0]\ncentre = [5.0, 0.0]\n'
LINES = (
    'start = [1.0, 0.0]\nfeed = 900\n[[segment]]\nkind = "line"\nend = [6.0, 0.0]\n'
    '[[segment]]\nkind = "line"\nend = [6.0, 4.0]\n'
)
MINE = """
from math import ceil, dist

params = {"pause": 0.0, "fails": 0}


def interpolate(segment, T, params):
    length = dist(segment.start, segment.end)
    samples = max(1, ceil(length / (segment.feed_rate * T) - 1e-9))
    for k in range(1, samples + 1):
        if k == params["fails"]:
            raise ZeroDivisionError("division by my own zero")
        at = [a + (b - a) * k / samples for a, b in zip(segment.start, segment.end)]
        yield at, [(b - a) / (samples * T) for a, b in zip(segment.start, segment.end)], [0.0] * len(at)
"""
PART = "G21 G90\nF600\nG1 X4\nG4 P0.05\nM0\nG1 Y3\nG2 X6 Y5 I2 J0\nM2\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle.toml").write_text(CIRCLE)
    (tmp_path / "lines.toml").write_text(LINES)
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path


def follow(**words: Any) -> rds.Experiment:
    reference = {"kind": "path", "file": "circle.toml", **words}
    return rds.Experiment(axis=["X", "Y"], controller="tracking", reference=reference)


def positions(result: rds.Result) -> np.ndarray:
    return np.column_stack([result["X_reference"], result["Y_reference"]])


@pytest.mark.parametrize("method", ["constant-velocity", "tustin", "improved-euler", "reference-pulse"])
@pytest.mark.parametrize("filter_", [None, "linear", "s-shape"])
def test_what_the_loop_sends_is_what_the_method_gives(here: Path, method: str, filter_: str | None) -> None:
    result = follow(interpolator=method, acceleration=filter_).run()
    arc = ArcSegment((0.0, 0.0), (0.0, 0.0), (5.0, 0.0), 10.0)
    alone = interpolate(
        [arc], T, library_interpolator(method), acceleration=make_acceleration(filter_) if filter_ else None
    )
    assert len(result) == alone.samples + 1 and result.meta["program"]["completed"]
    assert np.allclose(positions(result), alone.position, rtol=0.0, atol=1e-9)
    assert result["path_error"].max() == pytest.approx(alone.path_error.max(), abs=1e-6)
    assert set(result["program_segment"]) == {1}
    worst = result.meta["program"]["contour_error"]
    assert worst["unit"] == "mm" and 0.001 < worst["max"] < 0.1


def test_a_path_that_begins_elsewhere_is_led_to(here: Path) -> None:
    result = follow(file="lines.toml", interpolator="mine.py").run()
    assert positions(result)[0].tolist() == [0.0, 0.0] and positions(result)[-1].tolist() == [6.0, 4.0]
    assert "a straight line leads to the start" in " ".join(result.meta["notes"])
    assert sorted(set(result["program_line"].astype(int))) == [0, 1, 2]
    assert result["path_error"].max() < 1e-9


def test_the_student_s_function_may_be_handed_in(here: Path) -> None:
    scope: dict[str, Any] = {}
    exec(MINE.replace('params["fails"]', "0"), scope)
    by_function = follow(file="lines.toml", interpolator=scope["interpolate"]).run()
    by_file = follow(file="lines.toml", interpolator="mine.py").run()
    assert np.array_equal(positions(by_function), positions(by_file))


def test_segments_may_stand_in_the_experiment(here: Path) -> None:
    inline = rds.Experiment(
        axis=["X", "Y"],
        controller="tracking",
        reference={
            "kind": "path",
            "start": [0.0, 0.0],
            "feed": 600,
            "segment": [{"kind": "arc", "end": [0.0, 0.0], "centre": [5.0, 0.0]}],
        },
    )
    of_rows = inline.run()
    assert np.array_equal(positions(of_rows), positions(follow().run()))
    objects = [ArcSegment((0.0, 0.0), (0.0, 0.0), (5.0, 0.0), 10.0)]
    of_objects = rds.Experiment(axis=["X", "Y"], controller="tracking", reference={"kind": "path", "segment": objects})
    result = of_objects.run(out=here / "saved")
    assert np.array_equal(positions(result), positions(of_rows))
    assert np.array_equal(positions(rds.open_result(here / "saved")), positions(of_rows))
    with pytest.raises(InputError, match=r"feed = 600 goes with rows; segments that are objects have their own"):
        rds.Experiment(axis=["X", "Y"], reference={"kind": "path", "segment": objects, "feed": 600})


def test_programmed_commanded_and_measured_are_told_and_drawn_together(here: Path) -> None:
    """The filter makes the circle smaller, which is the commanded path's error; the axes add theirs."""
    experiment = follow(interpolator="constant-velocity", acceleration={"name": "s-shape", "time": 0.2})
    result = experiment.run()
    said = " ".join(findings(result.meta["program"]))
    assert "The measured position is at most 0.0" in said and "What was commanded is at most 0.0" in said
    program = experiment.plan().program
    assert isinstance(program, InterpolatedProgram)
    prepared = as_prepared(program, Path("path"), T)
    prepared = located(result, prepared)
    (place, _) = path(result, prepared).axes  # the other is the scale of colours
    lines = {line.get_label(): np.nan_to_num(line.get_xydata(), nan=5.0) for line in place.lines}
    radius = {label: np.hypot(*(lines[label] - [5.0, 0.0]).T) for label in ("programmed", "commanded")}
    assert radius["programmed"] == pytest.approx(5.0) and np.median(radius["commanded"]) < 5.0 - 1e-3
    off = {line.get_label(): line.get_ydata().max() for line in along(result, prepared).axes[0].lines}
    assert off["commanded"] == pytest.approx(1e3 * result["path_error"].max())
    assert off["measured"] == pytest.approx(1e3 * result["contour_error"].max())
    compared = rds.compare(result, follow(interpolator="constant-velocity").run())
    last = {axes.get_ylabel(): len(axes.lines) for axes in compared.plot().axes[-2:]}
    assert last == {"measured, off the path [µm]": 2, "commanded, off the path [µm]": 2}


@pytest.mark.parametrize("run", ["experiment", "methods"])
def test_a_circle_taken_for_a_line_is_no_contour_without_error(here: Path, run: str) -> None:
    """The example of the document is for lines: on a full circle, whose end is its start, it would never move."""
    (here / "lines_only.py").write_text(
        "def interpolate(segment, T, params):\n    yield segment.end, [0.0] * 2, [0.0] * 2\n"
    )
    with pytest.raises(ContractError, match=r"has gone 0 mm of an arc of 31\.4159 mm: go all of it"):
        if run == "experiment":
            follow(interpolator="lines_only.py").run()
        else:
            compare_methods(here / "circle.toml", [here / "lines_only.py"])


def test_one_axis_and_two_that_are_no_neighbours(here: Path) -> None:
    def reference(point: list[float]) -> dict[str, Any]:
        rows = [{"kind": "line", "end": point}]
        return {"kind": "path", "start": [0.0] * len(point), "feed": 600, "segment": rows}

    one = rds.Experiment(axis="Y", controller="tracking", reference=reference([3.0])).run()
    assert one["Y_reference"][-1] == 3.0 and one["path_error"].max() < 1e-9
    two = rds.Experiment(axis=["X", "Z"], controller="tracking", reference=reference([3.0, -2.0])).run()
    assert two["Z_reference"][-1] == -2.0 and two["contour_error"].max() < 0.1


@pytest.mark.parametrize("look_ahead", [3, 50])
def test_hold_and_override_stay_on_the_path_within_the_acceleration(here: Path, look_ahead: int) -> None:
    experiment = follow(interpolator="constant-velocity", acceleration={"name": "s-shape", "time": 0.2})
    plain = experiment.run()
    changes = [(0.5, "override", 0.4), (1.0, "hold", 1), (1.5, "hold", 0), (2.2, "override", 1.0)]
    slowed = follow(acceleration={"name": "s-shape", "time": 0.2}, look_ahead=look_ahead).run(changes=changes)
    state = slowed["program_state"]
    assert (state == State.HELD).sum() > 100 and slowed.meta["ending"] == "done"
    assert np.array_equal(positions(slowed)[-1], positions(plain)[-1])
    assert slowed["path_error"].max() < plain["path_error"].max() + 1e-5  # the filter's, and 10 nm
    limits = slowed.meta["program"]["limit_shares"]
    assert all(limits[axis][kind] <= 1.0 for axis in "XY" for kind in ("velocity", "acceleration"))
    assert slowed["program_override"].max() < 1.2 and slowed["program_buffer"].max() == look_ahead
    # back at 100 %, the rows are sent as they are
    last = slowed["program_sample"][-50:]
    assert np.array_equal(last, np.rint(last))


def test_a_stop_comes_to_rest_on_the_path(here: Path) -> None:
    result = follow(acceleration="s-shape").run(changes=[(1.0, "stop", 1)])
    assert result.meta["ending"] == "stopped" and "stopped in line 1" in result.meta["ending_reason"]
    steps = np.diff(positions(result), axis=0)
    assert np.abs(steps[-1]).max() < 1e-6 and not result.meta["program"]["completed"]


def test_home_leads_back(here: Path) -> None:
    result = follow(file="lines.toml", acceleration="s-shape").run(changes=[(0.4, "home", 1)])
    assert positions(result)[-1].tolist() == [0.0, 0.0]


@given(
    changes=lists(
        tuples(integers(1, 1200), sampled_from([("override", 0.3), ("override", 1.0), ("hold", 1.0), ("hold", 0.0)])),
        max_size=6,
    ),
    feed=floats(2.0, 20.0),
)
@settings(max_examples=25)
def test_whatever_is_wanted_the_rate_changes_gently(changes: list[tuple[int, Any]], feed: float) -> None:
    """No step between rows is longer than the feed allows, none goes back, and the end is the path's."""
    machine = load_machine("mini-cnc")
    path = [LineSegment((0.0, 0.0), (8.0, 6.0), feed)]
    method = Method(library_interpolator("constant-velocity"), make_acceleration("s-shape", time=0.1))
    made = program_of("path", path, [1], {}, (), method, machine, ["X", "Y"], T)
    follower, wanted, along = Interpolated(made, T), {"override": 1.0, "hold": 0.0}, [0.0]
    at = dict(changes)
    for k in range(60_000):
        if k in at:
            wanted[at[k][0]] = at[k][1]
        if k > 1500:
            wanted = {"override": 1.0, "hold": 0.0}
        follower.advance(0.0 if wanted["hold"] else wanted["override"], follower.last)
        along.append(follower.position[0] / 0.8)
        if follower.place >= follower.last:
            break
    assert along[-1] == pytest.approx(10.0, abs=1e-9)
    speed = np.diff(along) / T
    assert speed.min() > -1e-9 and speed.max() < 1.25 * feed
    pushes = np.diff(speed) / T
    most = machine.axes["X"].limits.acceleration  # type: ignore[union-attr]
    assert np.abs(pushes).max() < max(feed / 0.1 * 2.0, 1.0) + most


def test_a_part_program_s_stops_and_dwells_are_kept(here: Path) -> None:
    part = PartProgram("part.ngc", interpolator="tustin", acceleration="linear", exact_stop=True)
    result = part.run(changes=[(1.5, "resume", 1.0)])
    state = result["program_state"].astype(int)
    assert (state == State.DWELL).sum() == 50 and (state == State.STOP).sum() > 100
    assert result.meta["ending"] == "done" and result["X_reference"][-1] == 6.0 and result["Y_reference"][-1] == 5.0
    assert set(result["program_line"].astype(int)) >= {3, 6, 7}
    planned = PartProgram("part.ngc").run(changes=[(1.5, "resume", 1.0)])
    assert "path_error" not in planned.columns and "program_segment" not in planned.columns


def test_a_part_program_is_a_reference_too(here: Path) -> None:
    experiment = rds.Experiment(
        axis=["X", "Y", "Z"], controller="tracking", reference={"kind": "path", "file": "part.ngc"}
    )
    result = experiment.run(changes=[(1.0, "resume", 1.0)])
    assert result["X_reference"][-1] == 6.0 and "the spindle stands" in " ".join(result.meta["notes"])


@pytest.mark.parametrize("turned", [0.5, 2.8, 44.0])
def test_the_extremes_of_an_arc_stay_within_the_travel(turned: float) -> None:
    begin = tuple((75.01 * np.array([np.cos(np.radians(turned)), np.sin(np.radians(turned))])).tolist())
    with pytest.raises(InputError, match=r"segment 7 takes X from -75\.01 to 75\.01 mm"):
        in_room([ArcSegment(begin, begin, (0.0, 0.0), 5.0)], [7], load_machine("mini-cnc"), ["X", "Y"])


def test_pulses_of_a_coarse_unit_are_no_leaps(here: Path) -> None:
    """One BLU of 0.05 mm in a sample of 1 ms is 50 mm/s, and the axes move at 13 mm/s: the feed of 10 mm/s is kept."""
    result = follow(interpolator="reference-pulse", params={"blu": 0.05}).run()
    assert result.meta["ending"] == "done" and result.meta["program"]["path_error"]["max"] < 0.05


def test_a_fault_is_told_with_the_line_and_the_time(here: Path) -> None:
    failing = follow(file="lines.toml", interpolator="mine.py", params={"fails": 300})
    with pytest.raises(ContractError, match=r"mine\.py, line 12.*my own zero.*t = 0\.\d+ s"):
        failing.run()


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("yield [float('nan')] * 2, [0.0] * 2, [0.0] * 2", "finite"),
        ("yield [30.0, 0.0], [0.0] * 2, [0.0] * 2", r"row 1 of the interpolator sends X from 0 to 30 mm in one sample"),
        ("yield [300.0, 0.0], [0.0] * 2, [0.0] * 2", r"it travels from -?\d+ to"),
        ("while True: yield [0.0] * 2, [0.0] * 2, [0.0] * 2", "no end"),
        ("yield 1.0", "finite number"),
    ],
)
def test_rows_that_no_axis_could_follow_end_the_run(here: Path, body: str, said: str) -> None:
    (here / "bad.py").write_text(f"def interpolate(segment, T, params):\n    {body}\n")
    with pytest.raises(ContractError, match=said):
        follow(interpolator="bad.py").run()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"duration": 3.0}, "the path says how long the run lasts"),
        ({"reference": {"exact_stop": True}}, "goes with acceleration"),
        ({"reference": {"look_ahead": 1}}, "look_ahead = 1 must be"),
        ({"reference": {"speed": 1}}, "unknown key 'speed'"),
        ({"reference": {"interpolator": "tustni"}}, "no interpolator 'tustni'"),
        ({"reference": {"interpolator": "none.py"}}, "there is no file"),
        ({"reference": {"start": [0.0, 0.0]}}, "either file"),
        ({"reference": {"file": "none.toml"}}, r"none\.toml"),
        ({"reference": {"file": "part.ngc"}}, r"give axes = \['X', 'Y', 'Z'\]"),
        ({"axis": ["X"]}, "2 positions in each point, and the run 1"),
        ({"axis": ["Y", "X"]}, "in that order"),
        (
            {"overrides": {"Y": {"reference": {"kind": "path", "file": "circle.toml"}}}},
            "drives all axes|in the general",
        ),
        ({"mode": "system-test"}, "signal"),
        ({"reference": {"acceleration": {"time": 0.1}}}, "a table with name"),
    ],
)
def test_words_that_will_not_do_are_refused_at_once(here: Path, words: dict[str, Any], said: str) -> None:
    reference = {"kind": "path", "file": "circle.toml", **words.pop("reference", {})}
    with pytest.raises(InputError, match=said):
        rds.Experiment(**{"axis": ["X", "Y"], "controller": "tracking", "reference": reference, **words})


def test_a_path_beyond_the_travel_is_refused_before_it_moves(here: Path) -> None:
    (here / "far.toml").write_text(CIRCLE.replace("5.0", "500.0"))
    with pytest.raises(InputError, match=r"segment 1 takes X from 0 to 1000 mm; it travels"):
        follow(file="far.toml")


@pytest.mark.parametrize(
    "words", [["--look-ahead", "5"], ["--option", "a=1"], ["--acceleration", "linear"], ["--acceleration-time", "0.1"]]
)
def test_words_of_an_interpolator_without_one_are_refused(here: Path, words: list[str]) -> None:
    ran = CliRunner().invoke(app, ["nc", "run", "part.ngc", *words])
    assert ran.exit_code == 2 and "is not given" in ran.stderr


def test_the_command_runs_a_student_s_interpolator(here: Path) -> None:
    (here / "straight.ngc").write_text("G21 G90 F600\nG1 X3\nG1 X1\nM2\n")
    words = ["nc", "run", "straight.ngc", "--machine", str(machine(here, "X")), "--out", "out", "--json"]
    ran = CliRunner().invoke(app, [*words, "--interpolator", "mine.py", "--arc-interpolator", "circular"])
    assert ran.exit_code == 0, ran.output
    assert '"interpolator": "mine.py, arcs by circular"' in ran.stdout and '"path_error"' in ran.stdout
    assert (here / "out" / "program.html").is_file()


def test_the_report_of_a_path_has_its_picture_and_speaks_of_segments(here: Path) -> None:
    (here / "e.toml").write_text(
        'axes = ["X", "Y"]\nsample_period = 0.002\n[reference]\nkind = "path"\nfile = "lines.toml"\n'
        '[controller]\nname = "tracking"\n'
    )
    ran = CliRunner().invoke(app, ["run", "e.toml", "--out", "out"])
    assert ran.exit_code == 0, ran.output
    text = (here / "out" / "program.html").read_text()
    assert "off the programmed path, in segment" in text and "at the programmed feed throughout" not in text
    assert (here / "out" / "program-path.png").is_file()


@pytest.mark.parametrize("period", [2e-5, 1e-4])
def test_a_hold_at_a_short_sample_period_comes_to_rest(period: float) -> None:
    """A ramp lasts for 20 ms at least, which are more samples than a step of one may otherwise have."""
    machine = load_machine("mini-cnc")
    method = Method(library_interpolator("constant-velocity"))
    made = program_of("path", [LineSegment((0.0,), (8.0,), 5.0)], [1], {}, (), method, machine, ["X"], period)
    follower = Interpolated(made, period)
    for _ in range(round(1.0 / period)):
        follower.advance(0.0, follower.last)
    assert follower.rate == 0.0 and 0.0 < follower.position[0] < 3.0


def test_a_path_at_the_end_of_the_travel_and_in_whole_blu_is_followed(here: Path) -> None:
    machine = load_machine("mini-cnc")
    high = machine.axes["X"].travel[1]
    rows = [{"kind": "arc", "end": [0.0, 0.0], "centre": [high / 2.0, 0.0]}]
    reference = {"kind": "path", "start": [0.0, 0.0], "feed": 700, "segment": rows}
    circle = rds.Experiment(axis=["X", "Y"], controller="tracking", sample_period=0.01, reference=reference).run()
    assert circle["X_reference"].max() == pytest.approx(high, abs=0.01)
    line = {"kind": "path", "start": [0.0], "feed": 700, "segment": [{"kind": "line", "end": [1.0]}]}
    line["interpolator"] = "reference-pulse"
    pulses = rds.Experiment(axis="X", controller="p", sample_period=0.0002, reference=line).run()
    assert pulses["X_reference"][-1] == 1.0


def test_a_part_program_is_read_with_the_setup_of_its_reference(here: Path) -> None:
    """Its tool table stands beside the experiment; of a path there is nothing to set up."""
    (here / "short.ngc").write_text("G21 G90\nT1 M6\nG43\nF600\nG1 X1 Z1\n")
    (here / "tools.tbl").write_text("T1 P1 Z2 D3\n")
    setup = {"tools": "tools.tbl", "open_end": True}
    words = {"kind": "path", "file": "short.ngc", "setup": setup}
    run = rds.Experiment(axis=["X", "Y", "Z"], controller="tracking", reference=words).run()
    assert (run["X_reference"][-1], run["Z_reference"][-1]) == (1.0, 3.0)  # the tool is 2 mm long
    with pytest.raises(InputError, match=r"there is no 'open-end'; .* did you mean 'open_end'"):
        rds.Experiment(axis=["X", "Y", "Z"], reference=words | {"setup": {"open-end": True}}).run()
    with pytest.raises(InputError, match="is of part programs, and this is a path"):
        rds.Experiment(axis=["X", "Y"], reference={"kind": "path", "file": "circle.toml", "setup": setup}).run()
