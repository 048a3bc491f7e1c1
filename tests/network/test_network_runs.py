"""A network in a run: hand calculations of delayed loops, buffers as in equations 2.2 to 2.5, and every mode alike."""

from __future__ import annotations

from functools import partial
from itertools import repeat
from math import inf
from typing import Any

import numpy as np
import pytest
from lost_machines import unless_lost

import rds
from rds.modes.networked import LOST
from rds.network.delays import LinkModel
from rds.network.links import actuator_link, sensor_link

T, TAU, K = 0.001, 0.01, 2.0
PERFECT = {"saturation": False, "quantization": False}


def run(network: dict[str, Any] | None, mode: str = "simulation", **options: Any) -> Any:
    settings: dict[str, Any] = {
        "axis": "X",
        "duration": 0.4,
        "reference": rds.square(1.0, 5.0),
        "controller": {"name": "p", "Pgain": 20.0},
        "model": {"name": "linear-axis", "tau": TAU, "K": K, "friction_plus": 0.0, "friction_minus": 0.0},
        "interface": PERFECT,
        "network": network,
    }
    return rds.Experiment(**(settings | options)).run(mode)


def by_hand(delay: float, voltages: np.ndarray) -> np.ndarray:
    """Positions of the axis when each voltage acts `delay` samples late: x⁺ = Φ x + Γ₀ u_k-d + Γ₁ u_k-d-1."""

    def part(time: float) -> tuple[np.ndarray, np.ndarray]:
        e = np.exp(-time / TAU)
        phi = np.array([[1.0, TAU * (1 - e)], [0.0, e]])
        return phi, K * np.array([time - TAU * (1 - e), 1 - e])

    whole = int(delay)
    first, second = part((delay - whole) * T), part((1.0 - delay + whole) * T)
    x, positions = np.zeros(2), []
    for k in range(len(voltages)):
        positions.append(x[0])
        for (phi, gamma), at in ((first, k - whole - 1), (second, k - whole)):
            x = phi @ x + gamma * (voltages[at] if at >= 0 else 0.0)
    return np.array(positions)


def test_a_network_without_delay_changes_nothing() -> None:
    plain, networked = run(None), run({})
    assert all(np.array_equal(plain[name], networked[name]) for name in plain.columns)
    assert not any(networked[f"X_delay_{part}"].any() for part in ("sc", "c", "ca"))


@pytest.mark.parametrize("delay", [0.3, 1.0, 1.7, 2.0])
def test_a_constant_delay_of_the_actuator_is_exact_within_samples(delay: float) -> None:
    result = run({"actuator": {"kind": "constant", "delay": delay * T}}, duration=0.1)
    assert result["X_measured"] == pytest.approx(by_hand(delay, result["X_command"]), abs=1e-12)
    assert result["X_delay_ca"] == pytest.approx(delay * T)


def test_sensor_computing_and_actuator_add_up_when_the_law_is_event_driven() -> None:
    network = {
        "event": True,
        "sensor": {"kind": "constant", "delay": 0.0002},
        "computing": {"kind": "constant", "delay": 0.0001},
        "actuator": {"kind": "constant", "delay": 0.0004},
    }
    result = run(network, duration=0.1)
    assert result["X_measured"] == pytest.approx(by_hand(0.7, result["X_command"]), abs=1e-12)
    assert result["X_delay_sc"] + result["X_delay_c"] + result["X_delay_ca"] == pytest.approx(0.0007)


def test_buffers_make_a_random_network_time_invariant() -> None:
    """Equations 2.2 to 2.5: u acts Δ₁ samples late and w_k = y_k-Δ₂, whatever the network does below that."""
    random = {"kind": "uniform", "high": 0.0029}
    buffered = run({"sensor": random, "actuator": random, "actuator_buffer": 3, "controller_buffer": 3, "seed": 4})
    constant = {"kind": "constant", "delay": 0.003}
    same = run({"sensor": constant, "actuator": constant})
    assert np.array_equal(buffered["X_measured"], same["X_measured"])
    assert np.array_equal(buffered["X_voltage"][3:], buffered["X_command"][:-3])
    free = run({"sensor": random, "actuator": random, "seed": 4})
    assert not np.array_equal(free["X_measured"], same["X_measured"])


def test_what_the_law_gets_is_the_newest_that_has_arrived() -> None:
    result = run({"sensor": {"kind": "uniform", "high": 0.0035}})
    ages = np.rint(result["X_delay_sc"] / T).astype(int)
    assert ages[10:].min() == 0 or ages[10:].min() == 1
    assert ages.max() <= 4
    assert (np.diff(np.arange(len(ages)) - ages) >= 0).all()  # "drop": never back to an older one


def test_losses_are_told_and_hold_the_voltage() -> None:
    result = run({"actuator": {"loss": 0.3}, "seed": 2}, duration=4.0)
    lost = result["X_delay_ca"] == LOST
    assert lost.mean() == pytest.approx(0.3, abs=0.03)
    at = np.flatnonzero(lost[1:]) + 1
    assert np.array_equal(result["X_voltage"][at], result["X_voltage"][at - 1])
    kept = ~lost
    assert np.array_equal(result["X_voltage"][kept], result["X_command"][kept])


def test_the_seed_and_the_axis_say_the_delays() -> None:
    network = {"sensor": {"kind": "exponential", "mean": 0.001}, "seed": 7}
    once, twice, other = run(network), run(network), run(network | {"seed": 8})
    assert np.array_equal(once["X_delay_sc"], twice["X_delay_sc"])
    assert not np.array_equal(once["X_delay_sc"], other["X_delay_sc"])
    both = run(network, axis=("X", "Y"))
    assert np.array_equal(once["X_delay_sc"], both["X_delay_sc"])
    assert not np.array_equal(both["X_delay_sc"], both["Y_delay_sc"])


@pytest.mark.parametrize(
    ("order", "seen"), [("drop", [0, 0, 2, 2, 2]), ("take", [0, 0, 2, 1, 1]), ("keep", [0, 0, 0, 0, 2])]
)
def test_a_message_that_was_overtaken(order: str, seen: list[int]) -> None:
    """Sample 1 takes 2 samples, sample 2 none, later ones never arrive; "keep": 2 waits for 1, which takes 3."""
    delays = [0.0, 3.0 if order == "keep" else 2.0, 0.0, inf, inf]
    sensed = sensor_link(LinkModel(order=order), iter(delays), 0, False)
    assert [int(sensed(k, float(k))[0]) for k in range(5)] == seen
    sent, arrived = actuator_link(LinkModel(order=order), iter(delays), 0)
    held, got = 0.0, []
    for k in range(5):
        sent(k, float(k), float(k))
        for message in arrived(k):
            held = message[2]
        got.append(int(held))
    assert got == seen


@pytest.mark.parametrize("model", [
    {"name": "machine-axis", "tau": TAU, "K": K, "delay": 0.0013},
    {"name": "machine-axis", "tau": TAU, "K": K, "delay": 0.0},
], ids=("dead time", "none"))  # fmt: skip
def test_a_models_own_delay_comes_on_top(model: dict[str, Any]) -> None:
    result = run({"actuator": {"kind": "constant", "delay": 0.0004}}, model=model, duration=0.1)
    expected = by_hand(0.4 + model["delay"] / T, result["X_command"])
    assert result["X_measured"] == pytest.approx(expected, abs=1e-12)


def test_a_motor_with_current_moves_behind_a_network_as_well() -> None:
    """Without inductance and friction it is the linear axis."""
    motor = {"name": "dc-motor-axis", "resistance": 1.0, "inductance": 0.0, "torque_constant": 0.1, "inertia": 1e-4}
    network = {"actuator": {"kind": "constant", "delay": 0.0004}}
    result = run(network, model=motor | {"lead": 0.2 * K * np.pi}, duration=0.1)
    assert result["X_measured"] == pytest.approx(by_hand(0.4, result["X_command"]), abs=1e-12)


@pytest.mark.parametrize("axes", [("X", "Y", "spindle"), ("spindle", "X", "Y")])
def test_one_law_waits_for_the_last_of_its_own_measurements(axes: tuple[str, ...]) -> None:
    """And not for that of an axis with a law of its own."""

    def control(t: float, r: Any, y: Any, state: Any, params: Any) -> tuple[Any, Any]:
        return 0.0 * y, state

    delay = {"kind": "uniform", "low": 0.0, "high": 0.0009}
    steady: dict[str, Any] = {"controller": "p", "model": "spindle", "reference": {"kind": "constant", "value": 0.0}}
    result = rds.Experiment(
        axis=axes,
        duration=0.05,
        reference=rds.sinusoid(1.0, 1.0),
        controller={"control": control, "coupled": True},
        overrides={"spindle": steady},
        network={"event": True, "sensor": delay},
    ).run()
    waited = {name: result[f"{name}_delay_sc"] for name in axes}
    assert waited["X"] == pytest.approx(waited["Y"], abs=1e-12)
    assert np.abs(waited["spindle"] - waited["X"]).min() > 1e-9


def test_the_age_of_a_measurement_is_told_to_the_law() -> None:
    seen = []

    def control(t: float, r: Any, y: float, state: Any, params: Any) -> tuple[float, Any]:
        seen.append(getattr(y, "age", None))
        return 0.0, state

    run({"sensor": {"kind": "constant", "delay": 0.002}}, controller=control, duration=0.006)
    assert [age for age in seen if age is not None] == [
        0,
        1,
        2,
        2,
        2,
        2,
    ]  # the first is known from where the axis stands


def test_draws_do_not_depend_on_how_far_they_go() -> None:
    model = LinkModel(loss=0.2, loss_burst=5.0)
    draws = model.draws(np.random.default_rng(1), T)
    lost = np.array([next(draws) == inf for _ in range(100_000)])
    assert lost.mean() == pytest.approx(0.2, abs=0.01)
    ends = (lost[:-1] & ~lost[1:]).sum()
    assert lost.sum() / ends == pytest.approx(5.0, rel=0.05)
    assert next(LinkModel().draws(np.random.default_rng(1), T)) == next(repeat(0.0))


@pytest.mark.realtime
@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_live_modes_have_the_same_network(mode: str) -> None:
    network = {"sensor": {"kind": "uniform", "high": 0.003}, "actuator": {"loss": 0.1}, "seed": 3}
    again = partial(run, network, sample_period=0.002, model=None, interface=None)
    simulated, live = again(), unless_lost(lambda: again(mode))
    if mode == "emulation":
        assert all(np.array_equal(simulated[name], live[name]) for name in simulated.columns)
    else:  # has discarded periods on a busy computer, and nothing is sent in them
        assert set(simulated.columns) - {"X_plant_velocity"} <= set(live.columns)
        assert (live["X_delay_ca"] == LOST).mean() == pytest.approx(0.1, abs=0.07)
