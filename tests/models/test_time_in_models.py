"""A model's equations know the time since the run began, whichever way the model is given and run."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest

import rds

T = 1e-3
TIMES = np.arange(0.0, 1.0, T)
PUSHED = -np.cos(3.0 * TIMES) / 9.0 + 1.0 / 9.0  # of x'' = cos(3 t) from rest


def derivatives(t: float, x: Any, u: Any, params: Any) -> list[float]:
    return [x[1], np.cos(3.0 * t)]


def drifting(t: float, x: Any, u: Any, params: Any) -> float:
    """An encoder that drifts by `drift` mm/s."""
    return float(x[0] + params["drift"] * t)


def system(**more: Any) -> control.NonlinearIOSystem:
    return control.nlsys(
        derivatives, more.pop("output", lambda t, x, u, p: x[0]), inputs=1, outputs=1, states=2, **more
    )


MODELS = {
    "functions": {"derivatives": derivatives},
    "nlsys": system(),
    "nlsys of a discrete system": control.nlsys(
        lambda t, x, u, p: [x[0] + T * x[1], x[1] + T * np.cos(3.0 * t)],
        lambda t, x, u, p: x[0],
        inputs=1,
        outputs=1,
        states=2,
        dt=T,
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_alone_and_in_a_run(name: str) -> None:
    within = 1e-3 if "discrete" in name else 1e-9  # Euler's method
    _, y, x = rds.lsim(MODELS[name], 0.0, TIMES)
    np.testing.assert_allclose(y, PUSHED, atol=within)
    np.testing.assert_allclose(x[:, 0], PUSHED, atol=within)
    signal = rds.constant(0.0)
    run = rds.Experiment(model=MODELS[name], signal=signal, duration=1.0, interface={"quantization": False}).run()
    np.testing.assert_allclose(run["X_measured"], PUSHED, atol=within)


def test_alone_from_a_later_time() -> None:
    _, _, x = rds.lsim({"derivatives": derivatives}, 0.0, TIMES + 0.4)
    np.testing.assert_allclose(x[:, 1], (np.sin(3.0 * (TIMES + 0.4)) - np.sin(1.2)) / 3.0, atol=1e-9)


@pytest.mark.parametrize(
    "model",
    [
        {"derivatives": lambda t, x, u, p: [x[1], 0.0], "output": drifting, "params": {"drift": 0.5}},
        {"advance": lambda x, u, T, p: x, "output": drifting, "params": {"drift": 0.5}},
        control.nlsys(lambda t, x, u, p: [x[1], 0.0], drifting, inputs=1, outputs=1, states=2, params={"drift": 0.5}),
    ],
    ids=("derivatives", "advance", "nlsys"),
)
def test_an_output_knows_time_and_parameters(model: Any) -> None:
    np.testing.assert_allclose(rds.lsim(model, 0.0, TIMES)[1], 0.5 * TIMES, atol=1e-12)
    np.testing.assert_allclose(rds.lsim(model, 0.0, TIMES, params={"drift": 2.0})[1], 2.0 * TIMES, atol=1e-12)
    run = rds.Experiment(model=model, signal=rds.constant(0.0), duration=0.2, interface={"quantization": False}).run()
    np.testing.assert_allclose(run["X_measured"], 0.5 * run["time"], atol=1e-12)


def test_a_continuous_system_of_python_control_advances_within_a_sample() -> None:
    """Behind a network voltages change within a sample; a linear system is then as exact as the library's model."""
    tau, K = 9.943e-3, 1.764
    words: dict[str, Any] = {
        "reference": rds.sinusoid(5.0, 1.0),
        "controller": "p",
        "duration": 0.5,
        "network": {"seed": 1, "actuator": {"kind": "uniform", "low": 0.0002, "high": 0.0008}},
        "interface": {"quantization": False},
    }
    free = {"name": "linear-axis", "friction_plus": 0.0, "friction_minus": 0.0, "tau": tau, "K": K}
    expected = rds.Experiment(model=free, **words).run()["X_measured"]
    linear = control.ss([[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], [[0]])
    np.testing.assert_allclose(rds.Experiment(model=linear, **words).run()["X_measured"], expected, atol=1e-9)
    same = control.nlsys(lambda t, x, u, p: [x[1], (K * u[0] - x[1]) / tau], None, inputs=1, outputs=2, states=2)
    np.testing.assert_allclose(rds.Experiment(model=same, **words).run()["X_measured"], expected, atol=1e-7)
    with pytest.raises(rds.InputError, match="made for a sample period"):
        rds.Experiment(model=control.sample_system(linear, T), **words).run()
