"""A law that is another one where it is linearized gets no margins; honest laws keep theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import Opened
from rds.grading.criteria.linear import PULSE, LinearLoop
from rds.grading.criteria.same_loop import MOST, difference, force, free_stretch
from rds.models import library_model
from tests.grading.made import HEAD, assignment_in

STEP = """
[[case]]
name = "step"
axis = "X"
duration = 0.8
{plant}

[case.reference]
kind = "constant"
value = 0.5

[[criterion]]
name = "phase"
kind = "phase-margin"
case = "step"
points = 10
full = 50
none = 20
unit = "°"
"""
LAW = """
def keen(r, y): return 75.0 * (r.position - y)  # 44 degrees
def meek(r, y): return 12.0 * (r.position - y)  # 78 degrees
def off(y): return abs(y / 0.001 - round(y / 0.001)) > 1e-6
"""
# by what it tells the linearized loop from a run, or tries to
CHEATS = {
    "rounding at this sample": """
def control(t, r, y, state, params):
    return (meek if off(y) else keen)(r, y), state
""",
    "rounding at any sample": """
initial_state = [False]
def control(t, r, y, state, params):
    seen = state[0] or off(y)
    return (meek if seen else keen)(r, y), [seen]
""",
    "less than a count at a time": """
initial_state = [0.0, False]
def control(t, r, y, state, params):
    seen = state[1] or 0.0 < abs(y - state[0]) < 0.0009
    return (meek if seen else keen)(r, y), [y, seen]
""",
    "standing still": """
initial_state = [0.0, 0]
def control(t, r, y, state, params):
    still = state[1] + 1 if abs(y - state[0]) < 0.0005 else 0
    return (meek if still > 2 else keen)(r, y), [y, still]
""",
    "a pulse": """
initial_state = [0.0, 0]
def control(t, r, y, state, params):
    left = 200 if 0.0 < abs(y - state[0]) < 0.0003 else max(state[1] - 1, 0)
    return (meek if left else keen)(r, y), [y, left]
""",
    "no limit of the voltage": """
initial_state = [False]
def control(t, r, y, state, params):
    seen = state[0] or 0.0 < t < 0.03 and y > 13.0 * t
    return (meek if seen else keen)(r, y), [seen]
""",
    "the count of samples": """
initial_state = [0]
def control(t, r, y, state, params):
    return (meek if 70 <= state[0] < 300 else keen)(r, y), [state[0] + 1]
""",
    "the time": """
def control(t, r, y, state, params):
    return (meek if t > 0.07 else keen)(r, y), state
""",
    "the time, at the pulse": """
def control(t, r, y, state, params):
    return (meek if 0.08 <= t < 0.13 else keen)(r, y), state
""",
    "the time, behind a spike to the limit": """
def control(t, r, y, state, params):
    return (meek if t > 0.25 else keen)(r, y) if abs(t - 0.25) > 1e-6 else 10.0, state
""",
    "the time, before a spike to the limit": """
def control(t, r, y, state, params):
    return (keen if t > 0.5 else meek)(r, y) if abs(t - 0.5) > 1e-6 else 10.0, state
""",
    "rounding, for half as much gain": """
def control(t, r, y, state, params):
    return (20.0 if off(y) else 30.0) * (r.position - y), state
""",
    "rounding, for damping": """
initial_state = [0.0]
def control(t, r, y, state, params):
    error = r.position - y
    return 75.0 * error + (500.0 * (error - state[0]) if off(y) else 0.0), [error]
""",
    "rounding, for a filter": """
initial_state = [0.0]
def control(t, r, y, state, params):
    slow = state[0] + (1.0 if off(y) else 0.15) * (r.position - y - state[0])
    return 60.0 * slow, [slow]
""",
}
HONEST = {
    "differences of positions": """
initial_state = {"last": None}
def control(t, r, y, state, params):
    last = y if state["last"] is None else state["last"]
    return 25.0 * (r.position - y) - 100.0 * (y - last), {"last": y}
""",
    "friction compensation by the measured velocity": """
from math import tanh
initial_state = [0.0, 0.0]
def control(t, r, y, state, params):
    speed = state[1] + 0.1 * ((y - state[0]) / 0.001 - state[1])
    return 30.0 * (r.position - y) - 0.1 * speed + 0.2 * tanh(speed), [y, speed]
""",
    "friction compensation by the error": """
from math import tanh
def control(t, r, y, state, params):
    error = r.position - y
    return 25.0 * error + 0.25 * tanh(error / 0.02), state
""",
    "gain by the error": """
def control(t, r, y, state, params):
    error = r.position - y
    return (20.0 + 30.0 * min(abs(error), 0.2)) * error, state
""",
    "a limit of its own": """
def control(t, r, y, state, params):
    return max(-4.0, min(4.0, 25.0 * (r.position - y))), state
""",
    "a limit of its rate": """
initial_state = [0.0]
def control(t, r, y, state, params):
    u = state[0] + max(-2.0, min(2.0, 25.0 * (r.position - y) - state[0]))
    return u, [u]
""",
    "anti-windup": """
initial_state = [0.0]
def control(t, r, y, state, params):
    error = r.position - y
    asked = 20.0 * error + state[0]
    u = max(-9.0, min(9.0, asked))
    return u, [state[0] + 0.001 * (400.0 * error + 20.0 * (u - asked))]
""",
    "a deadband": """
def control(t, r, y, state, params):
    error = r.position - y
    return 25.0 * (0.0 if abs(error) < 0.002 else error - 0.002 if error > 0.0 else error + 0.002), state
""",
}
IN_MOTION = {"a deadband", "anti-windup"}  # a step ends within the deadband, and the integral takes long to end
SINE = """kind = "sinusoid"
amplitude = 2.0
frequency = 1.0
"""


def loop_of(folder: Path, law: str, seed: int = 1, plant: str = "", moving: bool = False) -> LinearLoop | str:
    text = HEAD + STEP.replace("{plant}", plant)
    if moving:
        text = text.replace("duration = 0.8", "duration = 1.5").replace('kind = "constant"\nvalue = 0.5\n', SINE)
    assignment = read_assignment(assignment_in(folder, text, law))
    opened = Opened(folder / "solution.py", assignment, TrustedFiles())
    try:
        loop = assignment.cases[0].run(opened, seed, 0, ("linear",)).linear
    finally:
        opened.close()
    assert loop is not None
    return loop


@pytest.mark.parametrize("name", CHEATS)
def test_a_law_that_is_another_one_where_it_is_linearized_has_no_margins(name: str, tmp_path: Path) -> None:
    for seed in (1, 2):
        found = loop_of(tmp_path, LAW + CHEATS[name], seed)
        assert isinstance(found, str), f"{name}: {found.margins}"
        assert "otherwise than in the linearized loop" in found or "in proportion" in found


@pytest.mark.parametrize("plant", ["", 'plant = "machine"', "noise = 0.003"])
@pytest.mark.parametrize("name", HONEST)
def test_honest_laws_have_their_margins(name: str, plant: str, tmp_path: Path) -> None:
    found = loop_of(tmp_path, HONEST[name], 1, plant, name in IN_MOTION)
    assert isinstance(found, LinearLoop), found


def test_a_law_at_its_limit_is_linearized_when_it_has_left_it(tmp_path: Path) -> None:
    """A tenth of the run is within the stretch of 0.5 V that the axis starts with: a pulse there moves no voltage."""
    law = "def control(t, r, y, state, params):\n    return max(-2.0, min(2.0, 12.0 * (r.position - y))), state\n"
    found = loop_of(tmp_path, law)
    assert isinstance(found, LinearLoop)
    assert found.margins[1] == pytest.approx(77.8, abs=0.2)


RAISES = """
initial_state = [0.0]
def control(t, r, y, state, params):
    if t > 0.5 and abs(y - state[0]) > 0.0015:
        raise ValueError(f"seen at {t}")
    return 12.0 * (r.position - y), [y]
"""


@pytest.mark.parametrize("shown", [True, False])
def test_what_breaks_its_interface_under_the_force_keeps_its_run(shown: bool, tmp_path: Path) -> None:
    found = loop_of(tmp_path, RAISES, plant="" if shown else "visible = false")
    assert isinstance(found, str) and "under a force, it broke its interface" in found
    assert ("seen at" in found) is shown  # what a hidden case shows stays hidden


def test_a_law_that_counts_its_runs_by_the_clock_has_no_margins(tmp_path: Path) -> None:
    """The first run, which is scored, is keen; those after it are meek, as is the one with the force."""
    been = tmp_path / "been"  # in place of a clock, which a sandbox leaves it
    law = f"""
from pathlib import Path
initial_state = [None]
def control(t, r, y, state, params):
    meekly = state[0]
    if meekly is None:
        meekly = Path({str(been)!r}).exists()
        Path({str(been)!r}).touch()
    return (meek if meekly else keen)(r, y), [meekly]
"""
    found = loop_of(tmp_path, LAW + law)
    assert isinstance(found, str) and "at t = 0.000 s it answered the same samples otherwise" in found


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("where", ["True", "off(y)", "t > 0.3 and abs(y - state[0]) > 0.004"])
def test_voltages_beyond_all_numbers_are_no_warning(where: str, tmp_path: Path) -> None:
    law = f"""
initial_state = [0.0]
def control(t, r, y, state, params):
    side = 1.0 if round(t * 1000) % 2 else -1.0
    return (1.7e308 * side if {where} else meek(r, y)), [y]
"""
    loop_of(tmp_path, LAW + law)


def loop_with(gain: float) -> tuple[LinearLoop, np.ndarray, np.ndarray]:
    """A loop of u = -gain y about a first-order lag, and its deviations under noise."""
    y, driven = np.zeros(400), np.zeros(400)
    push = np.random.default_rng(1).standard_normal(400)
    for k in range(399):
        y[k + 1] = 0.9 * y[k] + 0.01 * ((PULSE if k == 0 else 0.0) - gain * y[k])
        driven[k + 1] = 0.9 * driven[k] + 0.01 * (push[k] - gain * driven[k])
    return LinearLoop(-gain * y, y, 0.001), -gain * driven, driven


def test_another_gain_departs_by_its_share() -> None:
    loop, voltage, position = loop_with(5.0)
    assert difference(loop, voltage, position) == ""
    within, beyond = 1.0 / (1.0 - MOST) - 0.01, 1.0 / (1.0 - MOST) + 0.01
    assert difference(loop, within * voltage, position) == ""
    assert "by 26 % (at most 25 %)" in difference(loop, 1.01 * beyond * voltage, position)
    asleep = np.where(np.arange(400) < 25, 0.0, voltage)
    assert "for a while" in difference(loop, asleep, position)
    assert "moves nothing" in difference(loop, 0.0 * voltage, 0.0 * position)


def test_the_stretch_is_where_the_law_is_at_no_limit() -> None:
    command, position = np.linspace(5.0, -5.0, 100), np.arange(100.0)
    assert free_stretch(command, position, 10.0) == (0, 100)
    assert free_stretch(np.where(np.arange(100) < 30, 9.5, command), position, 10.0) == (30, 100)
    assert free_stretch(np.minimum(command, 2.0), position, 10.0) == (29, 100)  # 2 V is a limit of its own
    assert free_stretch(np.where(np.arange(100) == 40, 10.0, 0.0), position, 10.0) == (0, 100)  # a spike
    assert free_stretch(np.where(np.arange(100) % 5 == 0, 10.0, 0.0), position, 10.0) == (0, 100)


def test_the_force_overcomes_friction_and_leaves_the_law_off_its_limits() -> None:
    model = library_model("linear-axis", tau=0.01, K=0.5, friction_plus=1.0, friction_minus=-0.5)
    made = force(model, np.zeros(1000), (10.0, 10.0), (100, 900), 7)
    assert not made[:100].any() and not made[900:].any()
    assert np.abs(made[100:900]).min() > 1.0 / 0.5 and np.abs(made).max() < 1.0 / 0.5 + 1.0
    assert np.array_equal(made, force(model, np.zeros(1000), (10.0, 10.0), (100, 900), 7))
    near = np.where(np.arange(1000) < 500, 8.0, 0.0)
    assert np.abs(force(model, near, (10.0, 10.0), (0, 1000), 7)[:450]).max() <= 0.5 * (9.0 - 8.0)
