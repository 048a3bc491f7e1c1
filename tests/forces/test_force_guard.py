"""The feed override that keeps force and load within limits while a program runs, with the load cell in the loop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, integers, lists

from rds.core.errors import InputError
from rds.machines.forces.cut_file import CutFile, cut_of
from rds.modes.loop.force_guard import AHEAD, ForceGuard, ahead
from rds.nc.run.run import PartProgram

CUT = {"depth": 2.0, "teeth": 2, "diameter": 6.0, "speed": 500.0}
SQUARE = "G21 G90 G94 G61\nG0 X-5 Y-5\nG1 X5 F300\nY5\nX-5 F150\nY-5\nG0 X0 Y0\nM2\n"
CORNER = "G21 G90 G94 G61\nG0 X-2 Y-2\nG1 X1 F300\nY0\nM2\n"  # some seconds


def part(tmp_path, text=SQUARE, **words) -> PartProgram:
    path = tmp_path / "part.ngc"
    path.write_text(text)
    return PartProgram(path, cut=cut_of({**CUT, **words}), sample_period=0.002)


@given(lists(floats(0, 10), min_size=1, max_size=60), integers(1, 70))
def test_the_largest_of_what_comes(values, samples):
    found = ahead(np.array(values), samples * 0.01, 0.01)
    assert found.tolist() == [max(values[i : i + samples]) for i in range(len(values))]


def test_force_and_load_stay_within_their_limits(tmp_path):
    result = part(tmp_path, limits={"force": 250.0, "Y": 150.0}).run("simulation")
    force, line = result["cutting_force"], result["program_line"]
    assert result.units["cutting_force"] == "N"
    assert 225.0 < force.max() <= 250.0
    assert 130.0 < force[np.abs(result["Y_reference_velocity"]) > 0.01].max() <= 150.0
    assert result["program_override"][line == 4].min() < 0.4
    assert result.meta["ending"] == "done"
    told = result.meta["program"]["cutting_force"]
    assert told["line"] in (3, 5) and told["max"] == pytest.approx(force.max())


def test_without_limits_reached_the_run_is_the_plan(tmp_path):
    guarded = part(tmp_path, limits={"force": 1e6}).run("simulation")
    plain = PartProgram(tmp_path / "part.ngc", sample_period=0.002)
    assert np.array_equal(plain.run("simulation")["X_reference"], guarded["X_reference"])


@pytest.mark.parametrize("hardness", [0.7, 1.5, 2.0])
def test_the_load_cell_finds_out_how_hard_the_work_is(tmp_path, hardness):
    result = part(tmp_path, limits={"force": 250.0}, hardness=hardness).run("simulation")
    force, line, t = result["cutting_force"], result["program_line"], result["time"]
    inside = t > t[line == 3][0] + 0.5  # s: the law is corrected by then
    assert force[inside].max() <= 250.0 * 1.01
    assert force[inside].max() > 225.0 or hardness < 1.0


def test_the_operator_may_be_slower_but_not_faster(tmp_path):
    slow = part(tmp_path, limits={"force": 250.0}).run("simulation", changes=[(0.0, "override", 0.3)])
    assert slow["program_override"].max() <= 0.3 + 1e-9
    fast = part(tmp_path, limits={"force": 250.0}).run("simulation", changes=[(0.0, "override", 2.0)])
    assert fast["cutting_force"].max() <= 250.0


@pytest.mark.realtime
def test_emulation_repeats_the_guarded_run_exactly(tmp_path):
    made = part(tmp_path, CORNER, limits={"force": 400.0})
    simulated, emulated = made.run("simulation"), made.run("emulation", out=tmp_path / "run")
    assert simulated["program_override"].min() < 0.8  # it is guarded
    for name in ("cutting_force", "program_override", "X_reference"):
        assert np.array_equal(simulated[name], emulated[name]), name


def test_the_guard_looks_as_far_ahead_as_a_ramp_takes():
    force = np.where(np.arange(1000) < 600, 0.0, 100.0)
    guarding = ForceGuard(force, force / 50.0, 0.75).start(0.001)
    first = round(600 - AHEAD / 0.001) + 1
    assert guarding.allowed(first - 2, 1.0) == 2.0
    assert guarding.allowed(first, 1.0) < (0.5) ** (1 / 0.75)


def test_a_rate_above_one_keeps_the_limits_too_and_rises_in_steps():
    """0.97 s^(-1/α) of shares s below one; 0.88 after 0.90 would allow 3 % more, which is less than a step of 5 %."""
    share = np.array([0.90, 0.88, 0.80, 0.0])
    guarding = ForceGuard(share, share, 0.75).start(1.0)  # so long a sample that none is seen ahead
    found = [guarding.allowed(place, 1.0) for place in range(4)]
    assert found == pytest.approx([0.97 * 0.9 ** (-1 / 0.75)] * 2 + [0.97 * 0.8 ** (-1 / 0.75), 2.0])


@pytest.mark.parametrize("said, factor", [(0.0, 1.0), (None, 0.7), (60.0, 1.2), (1e9, 20.0)])
def test_a_machines_cell_lowers_the_rate_only(said, factor):
    """One that has said nothing yet is simulated, here with 0.7 of the law; 20 times the law is the most it may say."""
    guarding = ForceGuard(np.full(9, 50.0), np.full(9, 0.5), 0.75, hardness=0.7).start(0.01, lambda: said)
    for _ in range(200):
        guarding.allowed(0, 1.0)
    assert guarding.factor == pytest.approx(factor)


def test_a_cut_without_limits_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"the cut has no \[limits\]"):
        part(tmp_path)
    assert isinstance(cut_of(CUT), CutFile)
