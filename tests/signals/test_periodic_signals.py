"""Square, triangle, sinusoid and constant, and the door to signals."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, sampled_from

from rds.core.errors import InputError
from rds.references import constant, make_signal, sample, sample_voltage, signal_kinds, sinusoid, square, triangle

amplitudes = floats(0.01, 100)
frequencies = floats(0.01, 50)
offsets = floats(-50, 50)
phases = floats(-720, 720)


def test_sinusoid_is_the_papers_reference():
    position, velocity, acceleration = sample(sinusoid(amplitude=5.0, frequency=0.2), 1e-3, 5000)
    t = np.arange(5000) * 1e-3
    omega = 2 * np.pi * 0.2
    np.testing.assert_allclose(position, 5 * np.sin(omega * t), atol=1e-12)
    np.testing.assert_allclose(velocity, 5 * omega * np.cos(omega * t), atol=1e-12)
    np.testing.assert_allclose(acceleration, -5 * omega**2 * np.sin(omega * t), atol=1e-12)


@given(make=sampled_from([sinusoid, triangle]), A=amplitudes, f=frequencies, offset=offsets, phase=phases)
def test_position_velocity_and_acceleration_belong_together(make, A, f, offset, phase):
    """Between samples the position moves by the integral of the velocity, and that by the acceleration's."""
    signal = make(A, f, offset, phase)
    t = np.linspace(0, 2 / f, 4001)
    dt = t[1]
    p, v, a = signal.reference(t)
    away_from_corners = np.abs(np.diff(v)) < 2 * A * f  # a triangle's corner lies inside one interval
    assert away_from_corners.mean() > 0.99
    np.testing.assert_allclose(
        np.diff(p)[away_from_corners], ((v[1:] + v[:-1]) / 2 * dt)[away_from_corners], atol=1e-6 * A
    )
    np.testing.assert_allclose(
        np.diff(v)[away_from_corners], ((a[1:] + a[:-1]) / 2 * dt)[away_from_corners], atol=1e-5 * A * f
    )


@given(make=sampled_from([sinusoid, triangle, square]), A=amplitudes, f=frequencies, offset=offsets, phase=phases)
def test_signals_stay_within_their_amplitude_and_repeat(make, A, f, offset, phase):
    signal = make(A, f, offset, phase)
    t = np.linspace(0, 1 / f, 400, endpoint=False) + 0.123 / f / 400
    values = signal.value(t)
    assert np.abs(values - offset).max() <= A * (1 + 1e-9)
    assert np.ptp(values) >= 1.97 * A
    if make is not square:  # whose edges may fall on either side of a rounding error
        np.testing.assert_allclose(signal.value(t + signal.period), values, atol=1e-6 * A)


def test_square_and_triangle_sample_by_sample():
    t = np.arange(8) / 8
    np.testing.assert_array_equal(square(2, 1).value(t), [2, 2, 2, 2, -2, -2, -2, -2])
    np.testing.assert_array_equal(square(2, 1, offset=1, phase=90).value(t), [3, 3, -1, -1, -1, -1, 3, 3])
    np.testing.assert_allclose(triangle(2, 1).value(t), [0, 1, 2, 1, 0, -1, -2, -1])
    np.testing.assert_allclose(triangle(2, 1, phase=90).value(t), [2, 1, 0, -1, -2, -1, 0, 1])
    np.testing.assert_allclose(sinusoid(2, 1, phase=90).value(t), 2 * np.cos(2 * np.pi * t), atol=1e-15)
    _, velocity, acceleration = triangle(2, 1).reference(t)
    np.testing.assert_array_equal(velocity, [8, 8, -8, -8, -8, -8, 8, 8])
    np.testing.assert_array_equal(acceleration, 0)
    assert not np.any(square(2, 1).reference(t)[1:])


@pytest.mark.parametrize("T", [1e-3, 7e-4, 0.1])
def test_edges_are_not_moved_by_the_rounding_of_sample_times(T):
    """Each half period of a whole number of samples has that number of samples."""
    half = 50
    values = sample_voltage(square(1.0, 1 / (2 * half * T)), T, 200 * half)
    np.testing.assert_array_equal(values, np.tile(np.repeat([1.0, -1.0], half), 100))


def test_constant_stands_still():
    signal = constant(3)
    assert signal.value(7.0) == 3.0
    assert signal.reference(7.0) == (3.0, 0.0, 0.0)
    assert signal.period is None


def test_one_time_gives_floats():
    assert np.ndim(sinusoid(5, 0.2).value(1.0)) == 0
    assert all(isinstance(part, float) for part in sinusoid(5, 0.2).reference(1.0))


def test_signals_can_be_pickled():
    signal = pickle.loads(pickle.dumps(sinusoid(5, 0.2)))
    assert signal.value(1.25) == pytest.approx(5.0)


@pytest.mark.parametrize("T, fine", [(1e-3, 500.0), (1e-2, 50.0)])
def test_sampling_must_be_twice_as_fast_as_the_signal(T, fine):
    sinusoid(1, fine).check_sampling(T)
    with pytest.raises(InputError, match="half the sampling frequency"):
        sample(sinusoid(1, fine * 1.001), T, 10)


@pytest.mark.parametrize(
    "options, fault",
    [
        ({"kind": "sine"}, "known kinds: square, triangle, sinusoid, user, constant"),
        ({"kind": "sinusoid", "amplitude": 5.0}, "needs frequency"),
        ({"kind": "sinusoid", "amplitude": 5.0, "freq": 1.0}, "no option 'freq'"),
        ({"kind": "square", "amplitude": "5", "frequency": 1.0}, "amplitude = '5' must be a number"),
        ({"kind": "square", "amplitude": -5, "frequency": 1.0}, "phase = 180"),
        ({"kind": "triangle", "amplitude": 5, "frequency": 0}, "more than 0"),
        ({"kind": "triangle", "amplitude": 5, "frequency": float("nan")}, "finite"),
        ({"kind": "triangle", "amplitude": 5, "frequency": True}, "must be a number"),
        ({"kind": "constant", "value": float("inf")}, "finite"),
        ({"kind": "user"}, "either a function of time or a file"),
    ],
)
def test_bad_options_are_refused_with_a_remedy(options, fault):
    with pytest.raises(InputError) as error:
        make_signal(**options)
    assert fault in str(error.value)


def test_kinds_are_listed():
    kinds = ["square", "triangle", "sinusoid", "user", "constant", "multisine", "chirp", "staircase", "speed"]
    assert signal_kinds() == kinds
    assert make_signal("sinusoid", amplitude=5, frequency=0.2).settings["phase"] == 0.0
