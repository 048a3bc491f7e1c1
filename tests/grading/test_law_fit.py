"""The law that is measured is the one that ran, whatever it tells apart; honest laws keep their margins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import OpenSubmission
from rds.grading.criteria.applied_force import force, free_stretch
from rds.grading.criteria.law_fit import law_fits
from rds.grading.criteria.linear import LinearLoop, NoLoop, linear_loop
from rds.models import library_model
from tests.grading.made import HEAD, assignment_in

ASSIGNMENTS = Path(__file__).parents[2] / "examples" / "assignments"
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
SINE = """kind = "sinusoid"
amplitude = 2.0
frequency = 1.0
"""


def loop_of(folder: Path, law: str, seed: int = 1, plant: str = "", moving: bool = False) -> LinearLoop | NoLoop:
    text = HEAD + STEP.replace("{plant}", plant)
    if moving:
        text = text.replace("duration = 0.8", "duration = 1.5").replace('kind = "constant"\nvalue = 0.5\n', SINE)
    assignment = read_assignment(assignment_in(folder, text, law))
    opened = OpenSubmission(folder / "solution.py", assignment, TrustedFiles())
    try:
        loop = assignment.cases[0].run(opened, seed, 0, ("linear",)).linear
    finally:
        opened.close()
    assert loop is not None
    return loop[0]


@pytest.mark.parametrize("name", CHEATS)
def test_the_margins_are_those_of_the_law_that_ran(name: str, tmp_path: Path) -> None:
    """Keen has 44 degrees, meek 78: nobody who is keen for a good part of the run gets those of meek."""
    for seed in (1, 2):
        found = loop_of(tmp_path, LAW + CHEATS[name], seed)
        most = 64.0 if "half as much gain" in name else 50.0  # of the gain of 30
        assert isinstance(found, NoLoop) or found.margins[1] < most, f"{name}: {found.margins}"


@pytest.mark.parametrize("plant", ["", 'plant = "machine"', "noise = 0.003"])
@pytest.mark.parametrize("name", HONEST)
def test_honest_laws_have_their_margins(name: str, plant: str, tmp_path: Path) -> None:
    found = loop_of(tmp_path, HONEST[name], 1, plant)
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
    assert isinstance(found, NoLoop) and "under a force on the axis, it broke its interface" in found.why
    assert ("seen at" in found.why) is shown  # what a hidden case shows stays hidden


def test_a_law_that_counts_its_runs_by_the_clock_is_for_a_review(tmp_path: Path) -> None:
    """The first run, which is scored, is keen; those after it are meek, as is the one with the force. That may be a
    cheat, or somebody who takes the period from a clock: a person is to say which.
    """
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
    assert isinstance(found, NoLoop) and not found.is_known
    assert "at t = 0.000 s it answered the same samples otherwise" in found.why and "go by `t`" in found.why


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


SOLUTION = (ASSIGNMENTS / "tracking" / "solution.py").read_text().replace("def control(", "def exact(")
WRAPPED = """
def control(t, r, y, state, params):
    {before}
    u, state = exact(t, r, y, state, params)
    {after}
    return u, state
"""
ALIKE = {
    "rounded to millivolts": ("", "u = round(u, 3)"),
    "rounded to the bits of a converter": ("", "u = round(u / 10.0 * 2048) / 2048 * 10.0"),
    "measurement rounded": ("y = round(y / 0.005) * 0.005", ""),
    "two counts of dead band": ("y = r.position if abs(r.position - y) <= 0.002 else y", ""),
    "friction by the sign of the motion": ("", "u += 0.3 * ((r.velocity > 0) - (r.velocity < 0))"),
}


@pytest.mark.parametrize("plant", ["", 'plant = "machine"'])
@pytest.mark.parametrize("name", ALIKE)
def test_rounding_and_friction_compensation_cost_no_margin(name: str, plant: str, tmp_path: Path) -> None:
    before, after = ALIKE[name]
    law = SOLUTION + WRAPPED.format(before=before or "pass", after=after or "pass")
    found = loop_of(tmp_path, law, 1, plant, moving=bool(plant))
    assert isinstance(found, LinearLoop), found
    assert found.margins[0] == pytest.approx(11.1, abs=0.3)
    assert found.margins[1] == pytest.approx(62.8, abs=1.0)


def test_a_relay_has_no_loop_and_friction_by_the_sign_of_the_error_is_for_a_review(tmp_path: Path) -> None:
    relay = "def control(t, r, y, state, params):\n    return (10.0 if r.position > y else -10.0), state\n"
    found = loop_of(tmp_path, relay)
    assert isinstance(found, NoLoop) and found.is_known and "switches" in found.why
    compensated = WRAPPED.format(before="pass", after="u += 0.25 * ((r.position > y) - (r.position < y))")
    found = loop_of(tmp_path, SOLUTION + compensated, moving=True)
    assert isinstance(found, LinearLoop) or not found.is_known


# each was told now and then that its loop is not stable, by a nearest linear law that has a pole which it does not have
UNLIKE_ANY = {
    "friction by the sign of the error, with a dead band": """
def control(t, r, y, state, params):
    e = r.position - y
    u = 30.0 * e + (r.velocity + 0.00994 * r.acceleration) / 1.764
    return u + 0.3 * (e > 0.002) - 0.15 * (e < -0.002), state
""",
    "an integrator that is cleared where the error changes its sign": """
initial_state = (0.0, 0.0)
def control(t, r, y, state, params):
    q, last = state
    e = r.position - y
    q = 0.0 if e * last < 0.0 else max(-1.0, min(1.0, q + 0.12 * e))
    return max(-10.0, min(10.0, 27.0 * e + q + r.velocity / 1.764)), (q, e)
""",
    "a gain of the feedforward that adapts itself": """
initial_state = (1.764, None, 0.0)
def control(t, r, y, state, params):
    k, last, slow = state
    v = 0.0 if last is None else (y - last) / 0.001
    k = min(max(k + 0.002 * (v / slow - k), 1.4), 2.1) if abs(slow) > 1.0 else k
    u = max(-10.0, min(10.0, 30.0 * (r.position - y) + (r.velocity + 0.00994 * r.acceleration) / k))
    return u, (k, y, 0.98 * slow + 0.02 * u)
""",
}


@pytest.mark.parametrize("plant", ["", 'plant = "machine"'])
@pytest.mark.parametrize("name", UNLIKE_ANY)
def test_no_honest_law_is_called_unstable_by_a_law_that_is_only_near_it(name: str, plant: str, tmp_path: Path) -> None:
    for seed in (2, 3, 6, 7):  # the nearest law alone would be called unstable with one or more
        found = loop_of(tmp_path, UNLIKE_ANY[name], seed, plant, moving=True)
        if isinstance(found, NoLoop):
            assert not found.is_known, (seed, found)
            found = found.nearest
        assert found is None or found.margins[1] > 45.0, (seed, found)  # nor paid as one until somebody has looked


@pytest.mark.parametrize(
    "law",
    [
        "return round(1500.0 * e + r.velocity / 1.764, 3), state",
        "return (max(-10.0, min(10.0, 1e4 * e)) if 0.2 < t < 0.9 else 30.0 * e + r.velocity / 1.764), state",
        "return (10.0 if e > 0.0 else -10.0) if 0.6 < t < 0.7 else 30.0 * e + r.velocity / 1.764, state",
        "return 30.0 * e + r.velocity / 1.764 + (2.0 if round(t * 1000.0) % 2 else -2.0), state",
    ],
    ids=["unstable and rounded", "a relay for half of the run", "a relay for a moment", "a dither of 2 V"],
)
def test_what_swings_or_switches_has_no_loop(law: str, tmp_path: Path) -> None:
    for seed in (1, 2, 3):
        text = f"def control(t, r, y, state, params):\n    e = r.position - y\n    {law}\n"
        found = loop_of(tmp_path, text, seed, moving=True)
        assert isinstance(found, NoLoop) and found.is_known, (seed, found)


@pytest.mark.parametrize("step", [0.01, 0.02, 0.05])
def test_coarse_rounding_is_measured_or_is_for_a_review(step: float, tmp_path: Path) -> None:
    law = SOLUTION + WRAPPED.format(before=f"y = round(y / {step}) * {step}", after="pass")
    for moving in (False, True):
        found = loop_of(tmp_path, law, moving=moving)
        if isinstance(found, NoLoop):
            assert not found.is_known
            found = found.nearest
        assert found is None or found.margins[1] > 50.0


def deviations(gain: float) -> tuple[np.ndarray, np.ndarray]:
    """Of u = -gain y about a first-order lag, under noise."""
    y, push = np.zeros(400), np.random.default_rng(1).standard_normal(400)
    for k in range(399):
        y[k + 1] = 0.9 * y[k] + 0.01 * (push[k] - gain * y[k])
    return -gain * y, y


def test_a_law_is_found_exactly_with_its_memory_also_in_a_part() -> None:
    from scipy.signal import lfilter

    _, position = deviations(5.0)
    a, b = [1.0, -1.2, 0.3], [-5.0, 4.0, 0.5]
    for part in (slice(None), slice(200, 300)):
        *_, fit = law_fits(lfilter(b, a, position), position, part)
        assert fit.is_exact and fit.a == pytest.approx(a, abs=1e-6) and fit.b == pytest.approx(b, abs=1e-6)


def test_the_least_stable_of_several_laws_counts() -> None:
    axis = library_model("linear-axis", tau=0.01, K=1.764)
    voltage, position = deviations(12.0)
    still = np.zeros(400)
    whole = linear_loop(voltage, position, still, 10.0, axis, 0.001)
    several = linear_loop(np.where(np.arange(400) < 200, 6.0, 1.0) * voltage, position, still, 10.0, axis, 0.001)
    assert isinstance(whole, LinearLoop) and isinstance(several, LinearLoop)
    assert several.margins[1] < 45.0 < 75.0 < whole.margins[1]
    none = linear_loop(0.0 * voltage, position, still, 10.0, axis, 0.001)
    assert isinstance(none, NoLoop) and none.is_known and "no loop" in none.why
    unseen = linear_loop(voltage, 0.0 * position, still, 10.0, axis, 0.001)
    assert isinstance(unseen, NoLoop) and not unseen.is_known


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
