"""A run ends where an axis is too far from its reference: LinuxCNC's FERROR, falling with the speed to MIN_FERROR."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.types import Ending
from rds.modes import load_mode
from rds.modes.loop.following_error import ErrorLimits, FollowingGuard, Watched

SINE = rds.sinusoid(5.0, 0.5)  # its speed is 15.7 mm/s at most


def run(following_error: dict[str, float], **words: Any) -> rds.Result:
    given: dict[str, Any] = {"reference": SINE, "controller": "p", "duration": 2.0}
    return rds.Experiment(axis="X", following_error=following_error, **given | words).run()


def test_a_law_of_the_wrong_sign_ends_at_once_at_zero_volts_and_its_samples_are_kept(tmp_path: Path) -> None:
    def control(t, r, y, state, params):
        return -50.0 * (r.position - y), state

    result = rds.Experiment(following_error={"ferror": 1.0}, reference=SINE, controller=control, duration=2.0).run(
        out=tmp_path
    )
    error = np.abs(result["X_reference"] - result["X_measured"])
    assert result.meta["ending"] == "following error" and ", ended: following error" in repr(result)
    assert (error[:-1] <= 1.0).all() and 1.0 < error[-1] < 1.05
    assert abs(result["X_command"][-1]) > 10.0 and result["X_voltage"][-1] == 0.0
    assert "axis X was 1.0" in result.meta["ending_reason"] and "[following_error]" in result.meta["ending_reason"]
    assert len(rds.open_result(tmp_path)) == len(result) < 300


@pytest.mark.realtime
@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_in_real_time_and_on_the_machine_it_ends_as_well(alone: Path, mode: str) -> None:
    law = {"name": "p", "Pgain": 0.0}
    experiment = rds.Experiment(following_error={"ferror": 1.0}, reference=SINE, controller=law, duration=2.0)
    result = experiment.run(mode, out=alone / "run")
    error = np.abs(result["X_reference"] - result["X_measured"])
    assert result.meta["ending"] == "following error" and "axis X was 1.0" in result.meta["ending_reason"]
    assert (error[:-1] <= 1.0).all() and error[-1] > 1.0
    assert mode != "implementation" or len(result["X_simulated"]) == len(result)


def test_less_is_allowed_when_the_reference_is_slower() -> None:
    """Under a P law the error follows the speed, and what is allowed follows it down to MIN_FERROR."""
    usual = run({"ferror": 100.0})
    error, speed = np.abs(usual["X_reference"] - usual["X_measured"]), np.abs(usual["X_reference_velocity"])
    top = rds.load_machine("mini-cnc").axes["X"].limits.velocity
    ferror = 1.01 * error.max()
    assert usual.meta["ending"] == "done"
    ramp = run({"ferror": ferror, "min_ferror": 0.2 * error.max()})
    allowed = np.maximum(0.2 * error.max(), ferror * np.minimum(1.0, speed / top))
    beyond = np.flatnonzero(error > allowed)
    assert len(beyond) and len(ramp) == beyond[0] + 1  # the first sample that is beyond what is allowed at its speed
    assert run({"ferror": ferror}).meta["ending"] == "done"  # and MIN_FERROR is FERROR where it is not given


def test_what_is_allowed_and_the_first_that_is_beyond_it_by_hand() -> None:
    limits = ErrorLimits(at_rest=0.2, at_top_speed=1.0, top_speed=50.0)
    assert [limits.at(velocity) for velocity in (0.0, 5.0, 25.0, -25.0, -80.0)] == [0.2, 0.2, 0.5, 0.5, 1.0]
    guard = FollowingGuard([Watched("X", "mm", limits, 0), Watched("Y", "mm", limits, 4)], [1], 0.001)
    voltages = [1.0, 2.0]
    guard.law(6, [], [0.5, -25.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2], voltages)
    assert guard.over() is None and voltages == [1.0, 2.0], "both are off by just what is allowed"
    guard.law(7, [], [0.0, 0.0, 0.0, 0.0, 0.0, -10.0, 0.0, 0.25], voltages)
    guard.law(8, [], [9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], voltages)
    ending, reason = guard.over() or (None, "")
    assert ending is Ending.FOLLOWING_ERROR and voltages == [1.0, 0.0]
    assert reason.startswith(
        "axis Y was 0.25 mm from its reference at t = 0.007 s, and 0.2 mm are allowed at 10 mm/s; "
    )


def test_one_axis_ends_all() -> None:
    result = rds.Experiment(
        axis=["X", "Y"],
        reference=SINE,
        controller="tracking",
        duration=1.0,
        overrides={"Y": {"controller": {"name": "p", "Pgain": 0.0}, "following_error": {"ferror": 0.5}}},
    ).run()
    assert result.meta["ending"] == "following error" and "axis Y" in result.meta["ending_reason"]
    assert result["X_voltage"][-1] == result["Y_voltage"][-1] == 0.0
    assert abs(result["X_voltage"][-2]) > 0.0


def test_the_last_sample_counts_as_the_others_do() -> None:
    """Where only the end point is off, the run is not done."""
    result = run({"ferror": 0.5}, reference={"kind": "constant", "value": 2.0}, duration=0.001)
    assert len(result) == 1 and result.meta["ending"] == "following error"


def test_so_it_is_where_all_periods_after_it_are_discarded() -> None:
    plan = rds.Experiment(
        following_error={"ferror": 0.5}, reference={"kind": "constant", "value": 2.0}, controller="p", duration=1.0
    ).plan()
    loop = replace(load_mode("simulation").build(plan, None), wait=lambda k: k and plan.samples)
    assert loop.run() is Ending.FOLLOWING_ERROR and loop.changes is not None and "axis X" in loop.changes.reason


def test_a_part_program_ends_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("part.ngc").write_text("G21 G90\nG1 X5 F600\nM2\n")
    Path("watched.toml").write_text('controller = { name = "p", Pgain = 1.0 }\n[following_error]\nferror = 0.1\n')
    result = rds.PartProgram("part.ngc", experiment="watched.toml").run()
    assert result.meta["ending"] == "following error"
    assert "axis X" in result.meta["ending_reason"]


def test_compiled_runs_say_that_they_are_not() -> None:
    assert "its following error is watched" in run({"ferror": 100.0}, compiled=True).meta["notes"][0]


def test_a_spindle_is_not_watched() -> None:
    words: dict[str, Any] = {"axis": "spindle", "reference": {"kind": "constant", "value": 500.0}}
    result = rds.Experiment(controller="pid", duration=0.2, following_error={"ferror": 1.0}, **words).run()
    assert result.meta["ending"] == "done"
    for key, table in (("following_error", {"ferror": 1.0}), ("error_compensation", {})):
        with pytest.raises(rds.InputError, match=rf"\[axis.spindle.{key}\] is for position axes.*: remove it"):
            rds.Experiment(controller="pid", duration=0.2, overrides={"spindle": {key: table}}, **words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"following_error": {}}, "ferror is missing"),
        ({"following_error": {"ferror": 0.0}}, "ferror = 0.0 must be more than 0 axis unit"),
        ({"following_error": {"ferror": 1.0, "min_ferror": 2.0}}, "min_ferror = 2.0 must be at most ferror, 1"),
        ({"following_error": {"ferror": 1.0, "ferorr": 2.0}}, "unknown key 'ferorr'.*did you mean 'ferror'"),
        ({"following_error": {"ferror": 1.0}, "controller": "relay", "error_compensation": {}}, "leave it out"),
        (
            {"following_error": {"ferror": 1.0}, "controller": None, "reference": None, "signal": SINE},
            "remove \\[following_error\\]",
        ),
    ],
)
def test_what_is_refused(words: dict[str, Any], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        run(words.pop("following_error"), **words)
