"""A speed as reference: position, velocity and acceleration belong together, and steps are taken on time."""

from __future__ import annotations

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.references import make_signal, sample


def test_the_position_is_the_integral_of_the_speed():
    reference = sample(make_signal("speed", points=[[0.7, 2.0], [4.5, 2.0], [5.2, 6.0]]), 1e-3, 8000)
    v, dt = np.asarray(reference.velocity), 1e-3
    assert np.diff(reference.position) == pytest.approx(0.5 * (v[1:] + v[:-1]) * dt, abs=1e-12)
    assert v[[0, 350, 700, 4000, 4850, 7999]] == pytest.approx([0.0, 1.0, 2.0, 2.0, 4.0, 6.0])
    assert np.asarray(reference.acceleration)[[100, 1000, 4800, 6000]] == pytest.approx([2 / 0.7, 0.0, 4 / 0.7, 0.0])


def test_two_points_at_one_time_are_a_step():
    signal = make_signal("speed", points=[[0.0, 1.0], [0.3, 1.0], [0.3, -2.0]])
    v = np.asarray(sample(signal, 1e-3, 600).velocity)  # 300 * 1e-3 is a little less than 0.3
    assert (v[:300] == 1.0).all() and (v[300:] == -2.0).all()
    assert signal.reference(0.5).position == pytest.approx(0.3 - 0.4)


@pytest.mark.parametrize(
    "points, fault",
    [
        ([], "points, each"),
        ([[0.0]], "points, each"),
        ([[1.0, 2.0], [0.5, 2.0]], "must not fall"),
        ([[-1.0, 2.0]], "begin at 0 s or later"),
        ([[1.0, 2.0], [1.0, 3.0], [1.0, 4.0]], "three points are at one time"),
    ],
)
def test_bad_points_are_refused(points, fault):
    with pytest.raises(InputError, match=fault):
        make_signal("speed", points=points)


def test_it_is_no_voltage():
    with pytest.raises(InputError, match=r"no voltage; give it under \[reference\]"):
        make_signal("speed", points=[[0.0, 1.0]]).value(0.0)
