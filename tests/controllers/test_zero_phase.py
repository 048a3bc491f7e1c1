"""Zero-phase-error tracking of the sampled axis, with and without a delay in the loop."""

from __future__ import annotations

import numpy as np
import pytest
from control_loops import RANGE, T, axis_model, plant, run

from rds.controllers import library_controller
from rds.controllers.observer import held_axis
from rds.controllers.zero_phase import acceleration_gain
from rds.core.errors import InputError
from rds.core.types import Reference


def sine(amplitude: float = 0.5, frequency: float = 2.0) -> Reference:
    w, t = 2 * np.pi * frequency, np.arange(3000) * T
    x = amplitude * np.sin(w * t)
    return Reference(x, amplitude * w * np.cos(w * t), -w * w * x)


def rms(name: str, delay: int, **options: int) -> float:
    """RMS error in µm in the steady state, of an axis without friction."""
    controller = library_controller(name, axis_model("X", friction=False), T, RANGE, **options)
    reference = sine()
    measured, _ = run(controller, plant("X", friction=False), reference, delay=delay)
    return float(1e3 * np.sqrt(np.mean((reference.position - measured)[1500:] ** 2)))


def test_its_gain_is_that_of_the_sampled_axis() -> None:
    """A constant acceleration through u = v/K + β a leaves the held axis no error, lead samples later."""
    tau, K = (axis_model("X")[name] for name in ("tau", "K"))
    a12, a22, b1, b2 = held_axis(tau, K, T)
    for lead in (0, 1, 4):
        beta, a = acceleration_gain(tau, K, T, lead), 100.0
        x, v, waiting = 0.0, -a * (0.5 * T + T * lead), [0.0] * lead
        off = []
        for k in range(2000):
            waiting.append(a * k * T / K + beta * a)
            u = waiting.pop(0)
            off.append(x - 0.5 * a * (k * T) ** 2)
            x, v = x + a12 * v + b1 * u, a22 * v + b2 * u
        # the start leaves a constant; from then on it moves as the reference does
        assert np.ptp(off[1500:]) < 1e-9


def test_it_leaves_an_eighth_of_what_tracking_leaves() -> None:
    assert rms("tracking", 0) == pytest.approx(1.73, abs=0.02)
    assert rms("zero-phase", 0) < rms("tracking", 0) / 7.0


def test_lead_makes_up_for_the_delay_of_a_bus() -> None:
    assert rms("zero-phase", 1, lead=1) < rms("feedforward", 1) / 5.0
    assert rms("zero-phase", 1, lead=1) < rms("zero-phase", 1) / 3.0
    assert rms("zero-phase", 3, lead=3) < rms("zero-phase", 3) / 4.0


def test_gains_change_while_it_runs_and_keep_the_lead() -> None:
    controller = library_controller("zero-phase", axis_model("X"), T, RANGE, lead=2)
    assert controller.retune is not None
    values = {name: controller.params[name] for name in controller.tunable}
    assert controller.retune(values)["coefficients"] == controller.params["coefficients"]
    changed = controller.retune(values | {"g1": 900.0})
    assert changed["lead"] == 2 and changed["coefficients"][-1] == controller.params["coefficients"][-1]


@pytest.mark.parametrize("lead, said", [(-1, "from 0 to 100"), (1.5, "whole number"), (1000, "from 0 to 100")])
def test_a_lead_that_cannot_be_is_refused(lead: float, said: str) -> None:
    with pytest.raises(InputError, match=rf"lead = .*{said}"):
        library_controller("zero-phase", axis_model("X"), T, RANGE, lead=lead)


def test_an_axis_that_nothing_can_be_computed_with_is_refused() -> None:
    with pytest.raises(InputError, match=r"'zero-phase' cannot be computed .* K = 1e\+300"):
        library_controller("zero-phase", {"tau": 0.01, "K": 1e300}, 0.001, 10.0, gains=[1.0, 1.0])
