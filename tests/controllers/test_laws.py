"""All library laws: conduct of the tuned loops, options, purity, and the same arithmetic under numba."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from control_loops import RANGE, T, axis_model, plant, ramp, run, step
from hypothesis import given, settings
from hypothesis.strategies import floats, sampled_from, tuples

from rds.controllers import controller_module, controller_names, library_controller
from rds.core.errors import InputError
from rds.core.types import Reference

AXIS = ["X", "Y", "Z"]
COMPILED = [name for name in controller_names() if hasattr(controller_module(name), "law")]  # not those for delay
PERIODS = [1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2]


def make(name, axis="X", T=T, limit=RANGE, **options):
    unit = "rev/min" if axis == "spindle" else "mm"
    return library_controller(name, axis_model(axis), T, limit, unit=unit, **options)


def overshoot_and_end(controller, axis, height, T, delay):
    measured, _ = run(controller, plant(axis, friction=False), step(height, round(4 / T)), T, delay)
    return measured.max() / height - 1, measured[-1] / height


@pytest.mark.parametrize("axis", AXIS)
@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("name, most", [("p", 0.05), ("pid", 0.30), ("modified-pid", 0.02)])
def test_tuned_gains_damp_any_axis_at_any_period(name, most, axis, period, delay):
    overshoot, end = overshoot_and_end(make(name, axis, period), axis, 0.1, period, delay)
    assert overshoot < most
    assert end == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", ["pid", "modified-pid"])
@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("height", [500.0, 5000.0])
def test_tuned_spindle_reaches_its_speed_without_overshoot(name, period, height):
    for delay in (0, 1):
        overshoot, end = overshoot_and_end(make(name, "spindle", period), "spindle", height, period, delay)
        assert overshoot < 0.05
        assert end == pytest.approx(1.0, abs=1e-3)


def test_spindle_under_p_keeps_the_error_of_its_loop_gain():
    controller = make("p", "spindle")
    measured, _ = run(controller, plant("spindle"), step(900.0, 2000))
    loop_gain = controller.params["Pgain"] * axis_model("spindle")["K"]
    assert 900.0 - measured[-1] == pytest.approx(900.0 / (1 + loop_gain), rel=1e-6)


def test_p_follows_a_ramp_at_the_distance_of_its_gain():
    controller = make("p")
    reference = ramp(4.0, 2000)
    measured, _ = run(controller, plant("X", friction=False), reference)
    expected = 4.0 / (controller.params["Pgain"] * axis_model("X")["K"])
    assert reference.position[-1] - measured[-1] == pytest.approx(expected, rel=1e-6)


def test_modified_pid_follows_a_ramp_at_the_distance_that_its_docstring_says():
    controller = make("modified-pid")
    reference = ramp(4.0, 4000)
    measured, _ = run(controller, plant("X", friction=False), reference)
    p = controller.params
    expected = (1 - p["b"]) * p["Pgain"] / p["Igain"] * 4.0
    assert reference.position[-1] - measured[-1] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("axis", AXIS)
def test_integral_takes_friction_away_in_steady_motion(axis):
    reference = ramp(4.0, 3000)
    measured, _ = run(make("pid", axis), plant(axis), reference)
    assert abs(reference.position[-1] - measured[-1]) < 1e-5


@pytest.mark.parametrize("name", ["pid", "modified-pid"])
def test_anti_windup_keeps_a_long_saturated_move_from_overshooting(name):
    reference = step(20.0, 3000)
    bounded, voltages = run(make(name), plant("X", friction=False), reference)
    assert voltages.max() == RANGE
    assert bounded.max() < 20.0 * 1.01
    unprotected, _ = run(make(name, limit=inf), _saturated(plant("X", friction=False)), reference)
    assert unprotected.max() > bounded.max() + 2.0


def _saturated(model):
    """The axis behind a converter that the controller does not know of."""
    inner = model.motion

    def start(model, T):
        motion = inner(model, T)

        class Limited:
            read = staticmethod(motion.read)

            def write(self, voltage):
                motion.write(min(max(voltage, -RANGE), RANGE))

        return Limited()

    return replace(model, motion=start)


def test_pid_without_filter_is_linuxcncs_arithmetic():
    """A few samples by hand: bias + P e + I Σ e T + D Δe/T + FF, deadband and limits first."""
    controller = make(
        "pid",
        Pgain=2.0,
        Igain=3.0,
        Dgain=0.01,
        bias=0.1,
        FF0=0.2,
        FF1=0.3,
        FF2=0.01,
        deadband=0.1,
        maxerror=1.0,
        maxerrorI=0.0014,
        maxerrorD=50.0,
        maxoutput=5.0,
        derivative_filter=0.0,
    )
    state, p = controller.initial_state, controller.params
    u, state = controller.control(0.0, Reference(0.6, 0.0, 0.0), 0.0, state, p)
    assert u == pytest.approx(0.1 + 2 * 0.5 + 3 * 0.0005 + 0.2 * 0.6)
    u, state = controller.control(T, Reference(0.52, 1.0, 10.0), 0.0, state, p)  # error 0.42, slope -80 limited to -50
    assert u == pytest.approx(0.1 + 2 * 0.42 + 3 * 0.00092 - 0.5 + 0.2 * 0.52 + 0.3 + 0.1)
    u, state = controller.control(2 * T, Reference(5.0, 0.0, 0.0), 0.0, state, p)  # error limited to 1
    assert state[2] == pytest.approx(0.9)
    assert state[0] == pytest.approx(0.0014)
    assert u == pytest.approx(0.1 + 2 * 0.9 + 3 * 0.0014 + 0.5 + 1.0)
    u, _ = controller.control(3 * T, Reference(0.0, 100.0, 0.0), 0.0, state, p)
    assert u == 5.0


def test_what_is_fed_forward_is_limited_as_linuxcncs_and_has_a_third_order():
    """maxcmdD and maxcmdDD limit the command's derivatives before FF1 and FF2, FF3 takes the change of the second."""
    none = {"Pgain": 0.0, "Igain": 0.0, "Dgain": 0.0}
    controller = make("pid", **none, FF1=0.1, FF2=0.01, FF3=1e-4, maxcmdD=20.0, maxcmdDD=100.0)
    state, p = controller.initial_state, controller.params
    u, state = controller.control(0.0, Reference(0.0, 30.0, 50.0), 0.0, state, p)
    assert u == pytest.approx(0.1 * 20.0 + 0.01 * 50.0)  # there is no jerk before the second sample
    u, state = controller.control(T, Reference(0.0, -30.0, 60.0), 0.0, state, p)
    assert u == pytest.approx(-0.1 * 20.0 + 0.01 * 60.0 + 1e-4 * 10.0 / T)
    u, state = controller.control(2 * T, Reference(0.0, 10.0, 500.0), 0.0, state, p)
    assert u == pytest.approx(0.1 * 10.0 + 0.01 * 100.0 + 1e-4 * 40.0 / T)


def test_derivative_filter_is_exact_for_a_straight_error():
    controller = make("pid", Pgain=0.0, Igain=0.0, Dgain=1.0, FF1=0.0, FF2=0.0, derivative_filter=0.004)
    state, answers = controller.initial_state, []
    for k in range(30):
        u, state = controller.control(k * T, Reference(2.0 * k * T, 0.0, 0.0), 0.0, state, controller.params)
        answers.append(u)
    np.testing.assert_allclose(answers, 2.0 * (1.0 - np.exp(-np.arange(30) * T / 0.004)), rtol=1e-9)


def test_set_point_weights_of_one_make_the_modified_pid_a_pid():
    plain = make("pid", FF1=0.0, FF2=0.0)
    weighted = make("modified-pid", b=1.0, c=1.0)
    reference = step(0.1, 500)
    np.testing.assert_allclose(
        run(plain, plant("X"), reference)[0], run(weighted, plant("X"), reference)[0], rtol=0, atol=1e-12
    )


def test_a_step_gives_no_derivative_kick_under_the_modified_pid():
    state, params = (controller := make("modified-pid")).initial_state, controller.params
    _, state = controller.control(0.0, Reference(0.0, 0.0, 0.0), 0.0, state, params)
    u, _ = controller.control(T, Reference(0.1, 0.0, 0.0), 0.0, state, params)
    assert u == pytest.approx(0.1 * (params["Pgain"] * params["b"] + params["Igain"] * T))


@pytest.mark.parametrize("name", controller_names())
def test_a_law_starts_wherever_the_axis_stands(name):
    """Where 0 is on an axis changes no voltage."""
    t = np.arange(400) * T
    about = Reference(0.5 * np.sin(6.0 * t), 3.0 * np.cos(6.0 * t), -18.0 * np.sin(6.0 * t))
    voltages = []
    for place in (0.0, 64.0):
        model = replace(plant("X"), initial_state=[place, 0.0])
        voltages.append(run(make(name), model, about._replace(position=place + about.position))[1])
    np.testing.assert_allclose(*voltages, rtol=0, atol=1e-9)


numbers = floats(-1e3, 1e3)


@pytest.mark.parametrize("name", COMPILED)
@given(
    r=tuples(numbers, numbers, numbers),
    y=numbers,
    state=tuples(*[numbers] * 6, sampled_from([0.0, 1.0])),
    axis=sampled_from(AXIS),
)
@settings(max_examples=100, deadline=None)
def test_voltage_stays_within_the_converters_range_and_the_law_keeps_nothing(name, r, y, state, axis):
    controller = make(name, axis)
    state = state[-len(controller.initial_state) :]
    first = controller.control(0.0, Reference(*r), y, state, controller.params)
    again = controller.control(7.0, Reference(*r), y, state, controller.params)
    assert first == again
    assert abs(first[0]) <= RANGE
    assert len(first[1]) == len(controller.initial_state)


@pytest.mark.parametrize("name", COMPILED)
def test_numba_compiles_the_law_unchanged_to_the_same_bits(name):
    numba = pytest.importorskip("numba")
    law = controller_module(name).law
    compiled = numba.njit(law)
    random = np.random.default_rng(1)
    limits = {"deadband": 0.01, "maxerror": 1.0, "maxerrorI": 0.1, "maxerrorD": 30.0, "maxcmdD": 4.0, "maxcmdDD": 40.0}
    options = {"pid": limits | {"FF3": 1e-5}}.get(name, {})
    controller = make(name, **options)
    c = controller.params["coefficients"]
    for started in (0.0, 1.0):
        for _ in range(300):
            r = (random.normal(0, 0.2), random.normal(0, 5), random.normal(0, 50))
            y = random.normal(0, 0.2)
            state = (*random.normal(0, 1, len(controller.initial_state) - 1).tolist(), started)
            assert compiled(*r, y, state, c) == law(*r, y, state, c)


@pytest.mark.parametrize("name", ["p", "pid", "modified-pid"])
@pytest.mark.parametrize(
    "option, value, fault",
    [
        ("Pgain", "high", "must be a number"),
        ("Pgain", True, "must be a number"),
        ("Pgain", float("nan"), "finite"),
        ("Pgain", -1, "at least 0"),
        ("maxoutput", -1, "at least 0"),
        ("bias", float("inf"), "finite"),
        ("pgain", 1.0, "no option 'pgain'; it has Pgain"),
    ],
)
def test_bad_options_are_refused_with_a_remedy(name, option, value, fault):
    with pytest.raises(InputError) as error:
        make(name, **{option: value})
    assert fault in str(error.value)
    assert option in str(error.value)


def test_unknown_controller_lists_the_known_ones():
    with pytest.raises(InputError, match="known controllers: p, pid, modified-pid, tracking"):
        make("pdi")


def test_a_model_without_tau_and_K_cannot_be_tuned_for():
    with pytest.raises(InputError, match="needs the axis's tau"):
        library_controller("pid", {"mass": 1.0}, T, RANGE)


@pytest.mark.parametrize("T, limit", [(0.0, 10.0), (float("nan"), 10.0), (1e-3, 0.0), (1e-3, -10.0)])
def test_impossible_loops_are_refused(T, limit):
    with pytest.raises(InputError):
        library_controller("p", axis_model("X"), T, limit)


def test_maxoutput_lowers_the_limit_and_cannot_raise_it():
    assert make("p", maxoutput=3.0).params["coefficients"][-1] == 3.0
    assert make("p", maxoutput=30.0).params["coefficients"][-1] == RANGE
