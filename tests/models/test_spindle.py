"""The spindle, and the door to the library's models."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, integers

from rds.core.errors import InputError
from rds.identification.structures.structures import structure
from rds.models import library_model, model_names


@given(speed=floats(-1e4, 1e4), u=floats(-10, 10), T=floats(1e-4, 0.1), parts=integers(1, 20))
def test_one_sample_equals_its_parts(speed, u, T, parts):
    """Exact means that cutting a sample of constant voltage into pieces changes nothing."""
    spindle = library_model("spindle", tau=0.08, K=1000.0)
    whole = spindle.advance((speed,), u, T, spindle.params)
    x = (speed,)
    for _ in range(parts):
        x = spindle.advance(x, u, T / parts, spindle.params)
    assert x == pytest.approx(whole, abs=1e-7)


def test_motion_follows_the_first_order_response():
    spindle = library_model("spindle", tau=0.08, K=1000.0)
    motion, speeds = spindle.motion(spindle, 1e-3), []
    for _ in range(400):
        speeds.append(motion.read())
        motion.write(5.0)
    np.testing.assert_allclose(speeds, 5000.0 * (1 - np.exp(-np.arange(400) * 1e-3 / 0.08)), atol=1e-8)


@given(delay=floats(0.0, 0.01), offset=floats(-1.0, 1.0))
def test_offset_and_dead_time_are_those_that_a_fit_finds(delay: float, offset: float) -> None:
    """A voltage that is held acts `delay` later, be that whole samples or not; motion and `advance` agree."""
    values = {"tau": 0.08, "K": 1000.0, "offset": offset, "delay": delay}
    t, u = np.arange(60) * 1e-3, np.r_[0.0, 5.0 * np.sin(np.arange(1, 60))]
    spindle = library_model("spindle", **values)
    motion, x, speeds = spindle.motion(spindle, 1e-3), spindle.initial_state, []
    for voltage in u.tolist():
        assert x[0] == motion.read()
        speeds.append(x[0])
        x = spindle.advance(x, voltage, 1e-3, spindle.params)
        motion.write(voltage)
    fitted = structure("spindle", ("offset", "delay")).respond(t, u, (0.0,), values)
    np.testing.assert_allclose(speeds, fitted, atol=1e-6)


@pytest.mark.parametrize(
    "params, fault",
    [
        ({"tau": 0.08}, "needs K"),
        ({"tau": 0.0, "K": 1.0}, "more than 0"),
        ({"tau": 0.08, "K": "high"}, "must be a number"),
        ({"tau": 0.08, "K": 1.0, "friction": 2.0}, "no option 'friction'; it has tau, K"),
    ],
)
def test_bad_parameters_are_refused(params, fault):
    with pytest.raises(InputError) as error:
        library_model("spindle", **params)
    assert fault in str(error.value)


def test_unknown_model_lists_the_known_ones():
    with pytest.raises(InputError, match="no model 'lathe'; known models: linear-axis, spindle, machine-axis, "):
        library_model("lathe")
    own = ["linear-axis", "spindle", "machine-axis", "directional-axis"]
    assert set(model_names()) == {*own, "position-drive", "profile-drive", "dc-motor-axis"}


@pytest.mark.parametrize("name", ["spindle", "machine-axis"])
def test_a_delay_that_would_fill_the_memory_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"delay = 1000000\.0 must be from 0 to 1000 s"):
        library_model(name, tau=0.1, K=300.0, delay=1e6)
