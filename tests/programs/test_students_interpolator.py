"""An interpolator as a student writes it from docs/experiments.md, for lines and arcs: in all modes, on a circle and on
a part program; held and slowed down by hand while it runs; too slow, which the verdict says and names.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner
from waiting import wait_for

import rds
from rds.cli.main import app
from rds.modes.experiment.run import Run
from rds.modes.loop.execution import State
from rds.nc.run.report import findings
from rds.nc.run.run import PartProgram

T = 0.005
MINE = '''"""Lines and arcs at constant speed."""

import time
from math import atan2, ceil, cos, dist, hypot, pi, sin

params = {"work": 0.0}  # s in each row, of nothing useful


def interpolate(segment, T, params):
    for row in (arc if hasattr(segment, "centre") else line)(segment, T):
        until = time.perf_counter() + params["work"]
        while time.perf_counter() < until:
            pass
        yield row


def line(segment, T):
    way = [b - a for a, b in zip(segment.start, segment.end)]
    samples = max(1, ceil(dist(segment.start, segment.end) / segment.feed_rate / T))
    for k in range(1, samples + 1):
        at = [a + each * k / samples for a, each in zip(segment.start, way)]
        yield at, [each / (samples * T) for each in way], [0.0] * len(way)


def arc(segment, T):
    (i, j), centre = segment.plane, segment.centre
    x, y = segment.start[i] - centre[i], segment.start[j] - centre[j]
    radius, begin = hypot(x, y), atan2(y, x)
    sweep = atan2(segment.end[j] - centre[j], segment.end[i] - centre[i]) - begin
    sweep = (-sweep if segment.clockwise else sweep) % (2 * pi) or 2 * pi
    others = [b - a for a, b in zip(segment.start, segment.end)]
    others[i] = others[j] = 0.0
    samples = max(1, ceil(hypot(radius * sweep, *others) / segment.feed_rate / T))
    turn = (-sweep if segment.clockwise else sweep) / (samples * T)
    for k in range(1, samples + 1):
        angle = begin + turn * k * T
        at = [a + each * k / samples for a, each in zip(segment.start, others)]
        velocity = [each / (samples * T) for each in others]
        acceleration = [0.0] * len(at)
        at[i], at[j] = centre[i] + radius * cos(angle), centre[j] + radius * sin(angle)
        velocity[i], velocity[j] = -radius * turn * sin(angle), radius * turn * cos(angle)
        acceleration[i], acceleration[j] = -turn * turn * (at[i] - centre[i]), -turn * turn * (at[j] - centre[j])
        yield at, velocity, acceleration
'''
CIRCLE = {"start": [0.0, 0.0], "feed": 300, "segment": [{"kind": "arc", "end": [0.0, 0.0], "centre": [1.0, 0.0]}]}
PART = "G21 G90 G17 F300\nG1 X1\nG3 X1 Y2 I0 J1 Z-0.5\nG2 X0 Y2 I-0.5 J0\nM2\n"
MODES = ["simulation", pytest.param("emulation", marks=pytest.mark.realtime)]
MODES.append(pytest.param("implementation", marks=pytest.mark.realtime))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path


def circle(**words: Any) -> rds.Experiment:
    reference = {"kind": "path", "interpolator": "mine.py", "acceleration": "s-shape", **CIRCLE, **words}
    return rds.Experiment(axis=["X", "Y"], controller="tracking", sample_period=T, reference=reference)


@pytest.mark.parametrize(("last", "notes"), [("samples + 1", 0), ("samples", 1)])
def test_a_last_row_that_is_not_the_end_of_the_path_is_told(here: Path, last: str, notes: int) -> None:
    """Whoever writes range(1, samples) leaves 5 mm/s in 5 ms, 0.025 mm, of each segment out."""
    (here / "mine.py").write_text(MINE.replace("range(1, samples + 1)", f"range(1, {last})"))
    found = circle().run().meta["notes"]
    assert [note for note in found if "mine.py is 0.0249 mm from the end of the path" in note] == found
    assert len(found) == notes


def apart(here: Path) -> dict[str, str]:
    """The same as two modules, a linear and a circular interpolator, neither of which can do the other's work."""
    choice = '(arc if hasattr(segment, "centre") else line)(segment, T)'
    (here / "lines.py").write_text(MINE.replace(choice, "line(segment, T)"))
    (here / "arcs.py").write_text(MINE.replace(choice, "arc(segment, T)"))
    return {"interpolator": "lines.py", "arc_interpolator": "arcs.py"}


def test_lines_and_arcs_have_interpolators_of_their_own(here: Path) -> None:
    segments = [{"kind": "line", "end": [2.0, 0.0]}, {"kind": "arc", "end": [2.0, 2.0], "centre": [2.0, 1.0]}]
    one, two = circle(segment=segments).run(), circle(segment=segments, **apart(here)).run()
    assert all(np.array_equal(one[name], two[name]) for name in one.columns)
    assert two.meta["program"]["interpolator"] == "lines.py, arcs by arcs.py"
    library = circle(segment=segments, acceleration=None, interpolator="linear", arc_interpolator="circular").run()
    assert library.meta["program"]["path_error"]["max"] < 1e-9  # mm
    of_program = [PartProgram("part.ngc", sample_period=T, interpolator=each) for each in ("mine.py", apart(here))]
    one, two = (part.run() for part in of_program)
    assert all(np.array_equal(one[name], two[name]) for name in one.columns)
    with pytest.raises(rds.InputError, match=r"arc_interpolator.* there is no file .*none.py"):
        circle(segment=segments, arc_interpolator="none.py")
    with pytest.raises(rds.InputError, match="arc_interpolator goes with an interpolator"):
        planned = {"kind": "path", "profile": "planned", "arc_interpolator": "circular", **CIRCLE}
        rds.Experiment(axis=["X", "Y"], controller="tracking", reference=planned)
    words = ["nc", "run", "part.ngc", "--arc-interpolator", "circular"]
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2 and "--arc-interpolator goes with --interpolator" in refused.stderr


def test_velocities_that_are_not_the_positions_are_told(here: Path) -> None:
    """Which `tracking` feeds forward; and the jump from rest to 5 mm/s, which no difference between rows shows."""
    words = {"segment": [{"kind": "line", "end": [2.0, 0.0]}], "acceleration": None}
    right = circle(**words).run()
    (here / "still.py").write_text(MINE.replace("[each / (samples * T) for each in way]", "[0.0] * len(way)"))
    wrong = circle(interpolator="still.py", **words).run()
    assert "still.py differ from the change of its positions, of X by 100% on average" in wrong.meta["notes"][-1]
    assert not any("differ" in note for note in right.meta["notes"])
    pulses = circle(interpolator="reference-pulse", **words).run()  # 2 or 3 BLU in a sample
    assert not any("differ" in note for note in pulses.meta["notes"])
    slant = {"segment": [{"kind": "line", "end": [2.0, 0.004]}], "acceleration": None}  # Y moves by no whole BLU
    still = circle(interpolator="reference-pulse", **slant).run()
    assert not any("differ" in note for note in still.meta["notes"])
    assert right.meta["program"]["limit_shares"]["X"]["acceleration"] == pytest.approx(5.0 / T / 200.0)
    told = " ".join(findings(right.meta["program"]))
    assert re.search(r"at most [\d,]+ times a limit \(jerk of [XY]\)\. An interpolator does not plan within", told)


def part() -> PartProgram:
    return PartProgram("part.ngc", interpolator="mine.py", acceleration="s-shape", sample_period=T)


def by_hand(run: Run) -> rds.Result:
    """Slow it down, hold it as soon as it moves, and let it go on."""
    assert run.ready(60.0)
    run.live_values.set("override", 0.5)
    run.live_values.set("hold", 1.0)
    wait_for(lambda: run.done or (run.rows is not None and run.rows["program_state"][-1] == State.HELD))
    run.live_values.set_all({"hold": 0.0, "override": 0.8})
    return run.wait()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("of", ["circle", "part program"])
def test_it_runs_in_every_mode_held_and_slowed_down(here: Path, of: str, mode: str) -> None:
    made = circle() if of == "circle" else part()
    if mode == "simulation":
        result = made.run(changes=[(0.2, "override", 0.5), (0.3, "hold", 1), (0.9, "hold", 0), (1.0, "override", 0.8)])
    else:
        result = by_hand(made.start(mode))
    about = result.meta["program"]
    assert result.meta["ending"] == "done" and about["interpolator"] == "mine.py"
    assert (result["program_state"] == State.HELD).any() and result["program_override"].max() < 1.01
    # the filter cuts corners; what it is off the path, and the loop, is told
    assert about["path_error"]["max"] < 0.15 and about["contour_error"]["max"] < 0.3
    assert all(about["limit_shares"][axis]["acceleration"] < 1.0 for axis in about["limit_shares"])
    end = [0.0, 0.0] if of == "circle" else [0.0, 2.0, -0.5]
    assert [result[f"{axis}_reference"][-1] for axis in "XYZ"[: len(end)]] == pytest.approx(end, abs=1e-12)
    if mode != "simulation":
        assert result["interpolate"].max() > 0.0 and "interpolate" in result.meta["timing"]
    if mode == "emulation":
        again = made.run("simulation", changes=[(at, name, new) for at, name, _, new in result.meta["changes"]])
        for column in again.columns:
            assert np.array_equal(again[column], result[column]), column


@pytest.mark.realtime
@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_too_slow_it_has_missed_and_is_named_and_sends_no_axis_ahead(here: Path, mode: str) -> None:
    short = [{"kind": "arc", "end": [0.0, 0.0], "centre": [0.2, 0.0]}]
    result = circle(params={"work": 1.3 * T}, segment=short, acceleration=None).run(mode)
    assert result.verdict == "missed", result.meta["verdict_reason"]
    reason = result.meta["verdict_reason"]
    assert "the interpolator (9" in reason or "the interpolator (100%" in reason
    assert result.meta["program"]["completed"]
    steps = np.hypot(np.diff(result["X_reference"]), np.diff(result["Y_reference"]))
    assert steps.max() < 1.01 * 5.0 * T  # a row at each sample, however many periods were discarded before it
