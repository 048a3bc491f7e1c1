"""Laws for loops with delay and their margins: separation, late and lost measurements, closed forms."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.controllers import library_controller
from rds.core.linear_law import linear_law
from rds.core.types import Measured, Reference
from rds.network.cost import Law, cost
from rds.network.delays import Delay
from rds.network.margins import delay_margin, jitter_margin, margins, radius
from rds.network.sampled import Plant, response

TAU, K, T = 0.01, 2.0, 0.002
MODEL = {"tau": TAU, "K": K}
ONE = np.eye(1)
INTEGRATOR = Plant(np.zeros((1, 1)), ONE, ONE, ONE)
AXIS = Plant(
    np.array([[0.0, 1.0], [0.0, -1 / TAU]]), np.array([0.0, K / TAU]), np.array([[1.0, 0.0]]), np.diag([0.0, 4.0])
)


def law(delay: float, **options: float) -> rds.Controller:
    return library_controller("lqg", MODEL, T, inf, delay=delay, **options)


def run(controller: Any, network: dict[str, Any] | None, **options: Any) -> rds.Result:
    settings: dict[str, Any] = {
        "axis": "X",
        "duration": 2.0,
        "sample_period": T,
        "reference": rds.sinusoid(1.0, 1.0),
        "controller": controller,
        "model": {"name": "linear-axis", "tau": TAU, "K": K, "friction_plus": 0.0, "friction_minus": 0.0},
        "interface": {"saturation": False, "quantization": False},
        "network": network,
    }
    return rds.Experiment(**(settings | options)).run()


def test_gain_and_filter_are_those_of_python_control() -> None:
    """dlqe returns the predictor's gain A M; the filter's is M, and the law's covariance gives it."""
    design = law(0.0, drift=0.0).params["design"]
    a12, a22, b1, b2 = design.over
    Phi, Gamma = np.array([[1, a12], [0, a22]]), np.array([[b1], [b2]])
    q = np.array([[design.process[0], design.process[1]], [design.process[1], design.process[3]]])
    L, _, _ = control.dlqe(Phi, np.eye(2), np.array([[1.0, 0.0]]), q, np.array([[design.noise]]))
    before = np.array(design.covariance)[[0, 1]]
    mine = before / (before[0] + design.noise)
    assert mine == pytest.approx(np.linalg.solve(Phi, L)[:, 0], rel=1e-4)
    plain, _, _ = control.dlqr(Phi, Gamma, np.diag([1.0, 0.0]), 1e-4)
    assert design.gain[0] == pytest.approx(plain[0, 0], rel=0.2)  # whose cost is of the instants only


def test_the_linear_part_has_the_filter_that_has_settled() -> None:
    """The law's own filter poles are those of the stationary Kalman filter, not those of its first samples."""
    controller = law(0.0, drift=0.0)
    design = controller.params["design"]
    a12, a22, b1, b2 = design.over
    Phi, Gamma, seen = np.array([[1, a12], [0, a22]]), np.array([[b1], [b2]]), np.array([[1.0, 0.0]])
    q = np.array([[design.process[0], design.process[1]], [design.process[1], design.process[3]]])
    L, _, _ = control.dlqe(Phi, np.eye(2), seen, q, np.array([[design.noise]]))
    wanted = (np.eye(2) - np.linalg.solve(Phi, L) @ seen) @ (Phi - Gamma @ np.array([design.gain]))
    found = linear_law(controller).F
    assert np.sort(np.abs(np.linalg.eigvals(found)))[-2:] == pytest.approx(np.sort(np.abs(np.linalg.eigvals(wanted))))


@pytest.mark.parametrize("extreme", [{"error": 1e-300}, {"voltage": 1e-200}, {"drift": 1e200}])
def test_numbers_without_a_solution_are_refused(extreme: dict[str, float]) -> None:
    with pytest.raises(rds.InputError, match=r"there are no gains for .* choose numbers"):
        law(0.0, **extreme)


def test_the_covariance_stays_the_same_from_sample_to_sample() -> None:
    """That of a position, mm², is many powers of ten smaller than that of a drift, V²: rounding must not reach it."""
    options = {"disturbance": 0.0, "drift": 187.0, "noise": 1.2e-5}
    design = library_controller("lqg", {"tau": 0.096, "K": 1.66}, 0.0005, inf, **options).params["design"]
    _, corrected = design.corrected((0.0, 0.0, 0.0), design.covariance, 0.0)
    assert design.spread(corrected) == pytest.approx(design.covariance, rel=1e-4)


@pytest.mark.parametrize("delay", [0.0007, 0.002, 0.0113])
def test_a_known_delay_leaves_the_poles_where_they_are(delay: float) -> None:
    """Separation: with the predictor, the poles that are not 0 are those of the regulator and of the filter."""
    without, with_delay = linear_law(law(0.0)), linear_law(law(delay))
    assert radius(AXIS, with_delay, T, delay) == pytest.approx(radius(AXIS, without, T, 0.0), rel=1e-6)
    assert radius(AXIS, without, T, delay) > radius(AXIS, with_delay, T, delay)


def test_it_costs_less_than_a_law_that_does_not_know_of_the_delay() -> None:
    delay = Delay.named("constant", delay=0.0065)
    plant = Plant(AXIS.A, AXIS.B, AXIS.C, np.outer(AXIS.B, AXIS.B) * 1e-4, 4e-6)
    known, unknown = (cost(plant, linear_law(law(each)), T, delay).cost for each in (0.0065, 0.0))
    assert known < unknown


def test_late_and_lost_measurements_are_filtered_at_their_own_instant() -> None:
    network = {
        "sensor": {"kind": "uniform", "high": 0.008, "loss": 0.2},
        "actuator": {"kind": "constant", "delay": 0.003},
    }
    errors = {}
    for name, controller in (("lqg", {"name": "lqg", "delay": 0.003}), ("tracking", {"name": "tracking"})):
        result = run(controller, network)
        errors[name] = np.abs(result["X_reference"] - result["X_measured"])[500:].max()
    assert errors["lqg"] < 1e-3  # mm: without disturbance the estimate is exact, however late
    assert errors["tracking"] > 20.0 * errors["lqg"]


def test_a_lost_measurement_widens_the_covariance_and_the_next_one_counts_more() -> None:
    controller, r = law(0.0), Reference(0.0, 0.0, 0.0)
    state = controller.initial_state
    for _ in range(300):
        _, state = controller.control(0.0, r, 0.0, state, controller.params)
    steady = state[5]
    old = Measured(0.0)
    for age in range(1, 6):
        old.age = age
        _, state = controller.control(0.0, r, old, state, controller.params)
    assert state[1] == 5.0
    _, state = controller.control(0.0, r, 0.0, state, controller.params)
    assert state[1] == 0.0
    assert state[5] > steady


@pytest.mark.parametrize("name", ["lqg", "smith"])
def test_nothing_of_a_law_that_is_designed_as_a_whole_changes_while_it_runs(name: str) -> None:
    """Its numbers are there to be read: to set one of them would change nothing, or half of the law."""
    plan = rds.Experiment(reference=rds.sinusoid(1.0, 1.0), controller={"name": name, "delay": 0.002}).plan()
    assert [channel.name for channel in plan.channels()] == ["stop"]


def test_a_constant_disturbance_is_compensated() -> None:
    result = run({"name": "lqg", "delay": 0.004}, {"actuator": {"kind": "constant", "delay": 0.004}},
                 model={"name": "linear-axis", "tau": TAU, "K": K, "friction_plus": 2.0, "friction_minus": -2.0},
                 reference=lambda t: (0.5 * t, 0.5, 0.0))  # fmt: skip
    assert abs(result["X_reference"] - result["X_measured"])[-100:].max() < 1e-4


@pytest.mark.parametrize("delay", [0.0012, 0.006])
def test_the_smith_predictor_shifts_the_response(delay: float) -> None:
    """With the right model the loop is that without delay, `delay` later: from rest, its step response too."""
    settings = {"reference": rds.constant(1.0), "duration": 0.4}
    network = {"actuator": {"kind": "constant", "delay": delay}}
    plain = run({"name": "tracking"}, None, **settings)
    smith = run({"name": "smith", "delay": delay}, network, **settings)
    assert smith["X_command"] == pytest.approx(plain["X_command"], abs=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.0012, 0.006])
def test_the_smith_predictors_poles_are_those_without_delay_and_the_axis_own(delay: float) -> None:
    """Nothing in it only adds up: the loop would not be stable, and rounding would decide what a study says of it."""
    plain, smith = (library_controller(name, MODEL, T, inf, **options) for name, options in (
        ("pid", {}), ("smith", {"delay": delay, "law": "pid"})))  # fmt: skip
    wanted = max(radius(AXIS, linear_law(plain), T, 0.0), np.exp(-T / TAU))
    assert radius(AXIS, linear_law(smith), T, delay) == pytest.approx(wanted, rel=1e-6)


def _pd(p: float, d: float) -> Law:
    return Law(np.zeros((1, 1)), np.array([[1.0]]), np.array([[d]]), -(p + d))


def _left(plant: Plant, law: Law, delays: np.ndarray) -> float:
    """What is left of an initial state, where each voltage comes so much later, s, at most a sample of 1 s."""
    held = {time: response(plant, time) for delay in set(delays.tolist()) for time in (delay, 1.0 - delay)}
    x, z, acting = np.ones(len(plant.A)), np.zeros(len(law.F)), 0.0
    for delay in delays.tolist():
        y = float((plant.C @ x)[0])
        u = float((law.H @ z).sum() + law.D * y)
        z = law.F @ z + law.G[:, 0] * y
        for time, voltage in ((delay, acting), (1.0 - delay, u)):
            Phi, Gamma = held[time]
            x = Phi @ x + Gamma * voltage
        acting = u
    return float(np.abs(x).max())


def test_the_delay_margin_of_the_integrator(monkeypatch: pytest.MonkeyPatch) -> None:
    """z² - (1 - (1 - τ) L) z + τ L = 0 has its poles on the unit circle at τ = 1/L, for L from 1 on."""
    monkeypatch.setattr("rds.network.margins._LONGEST", 8)
    assert delay_margin(INTEGRATOR, Law.gain(-1.25), 1.0) == pytest.approx(0.8)
    assert delay_margin(INTEGRATOR, Law.gain(-2.5), 1.0) == 0.0
    stable = Plant(-ONE, ONE, ONE, ONE)
    assert delay_margin(stable, Law.gain(-0.1), 1.0) == inf


def test_no_jitter_within_the_margin_makes_the_loop_unstable() -> None:
    J = jitter_margin(INTEGRATOR, Law.gain(-0.7), 1.0, 0.0)
    assert 0.2 < J < delay_margin(INTEGRATOR, Law.gain(-0.7), 1.0)
    rng = np.random.default_rng(0)
    for pattern in (rng.random(2000), np.arange(2000) % 2, np.arange(2000) // 2 % 2):
        x, acting = 1.0, 0.0
        for share in pattern:
            tau = min(J, 1.0) * share
            u = -0.7 * x
            x, acting = x + tau * acting + (1 - tau) * u, u
        assert abs(x) < 1e-6
    found = margins(INTEGRATOR, Law.gain(-0.7), 1.0, points=6)
    assert found.J[-1] == 0.0 and (found.delay >= found.J).all()


@pytest.mark.parametrize("L", [0.0, 0.4])
@pytest.mark.parametrize(
    ("plant", "law"),
    [
        (Plant(-ONE, ONE, ONE, ONE), Law.gain(-1.2)),
        (Plant(0.5 * ONE, ONE, ONE, ONE), Law.gain(-0.9)),  # unstable without its law
        # a double integrator, and an axis with its time constant, under u = -p y - d (y - y of the sample before)
        (Plant(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([0.0, 1.0]), np.eye(1, 2), np.eye(2)), _pd(0.1, 0.5)),
        (Plant(np.array([[0.0, 1.0], [0.0, -2.0]]), np.array([0.0, 2.0]), np.eye(1, 2), np.eye(2)), _pd(0.5, 0.3)),
    ],
    ids=("first order", "unstable", "double integrator", "axis"),
)
def test_the_jitter_margin_of_other_plants_holds(plant: Plant, law: Law, L: float) -> None:
    """Whatever the pattern of delays from L to L + J: the state dies out. Well beyond the delay margin, it does not."""
    N = 600
    J, most = jitter_margin(plant, law, 1.0, L), delay_margin(plant, law, 1.0)
    assert 0.02 < J < most - L
    rng = np.random.default_rng(1)
    drawn = rng.integers(0, 9, N) / 8
    patterns = (drawn, drawn > 0.5, np.arange(N) % 2, np.arange(N) // 3 % 2, np.ones(N))
    for pattern in patterns:
        assert _left(plant, law, np.minimum(L + J * pattern, 1.0)) < 1e-6
    if most < 1.0 / 1.1:
        assert _left(plant, law, np.full(N, 1.1 * most)) > 1e3


def test_the_command_designs_for_a_delay(tmp_path: Path) -> None:
    file, out, picture = tmp_path / "loop.toml", tmp_path / "law.toml", tmp_path / "m.png"
    text = 'axis = "X"\nduration = 0.1\nsample_period = 0.002\n[reference]\nkind = "constant"\nvalue = 0.0\n'
    file.write_text(text + '[controller]\nname = "pid"\n')
    words = ["design", "lqg", str(file), "--delay", "0.003", "--out", str(out), "--plot", str(picture), "--json"]
    ran = CliRunner().invoke(app, words)
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    assert told["delay_margin_s"] > 0.003 and told["bears_jitter"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    file.write_text(text + out.read_text())
    assert rds.Experiment.from_toml(file).plan().axes[0].controller.params["delay"] == 0.003  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        ({"name": "lqg", "delay": 1.0}, "more than 200 samples"),
        ({"name": "lqg", "dealy": 0.1}, "did you mean 'delay'"),
        ({"name": "smith", "law": "lqg"}, "law = 'lqg' is unknown"),
        ({"name": "smith", "options": {"Pgain": 1.0}}, "has no option 'Pgain'"),
    ],
)
def test_what_will_not_do_is_refused(controller: dict[str, Any], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        run(controller, None)
