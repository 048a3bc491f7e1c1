"""General tracking control of a spindle: its pole, the error that friction leaves, options, live gain."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from control_loops import RANGE, T, axis_model, plant, run, step

import rds
from rds.controllers import library_controller
from rds.core.errors import InputError
from rds.core.types import Reference
from rds.models import library_model


def tracking(period=T, **options):
    return library_controller("tracking", axis_model("spindle"), period, RANGE, unit="rev/min", **options)


@pytest.mark.parametrize("pole", [-20.0, -32.0, -80.0])
def test_the_error_dies_away_by_the_pole(pole):
    measured, voltages = run(tracking(speed_pole=pole), plant("spindle"), step(1000.0, 400))
    assert voltages.max() < RANGE
    settled = round(4.0 / -pole / T)  # four time constants: 0.125 s of the default
    assert 1000.0 - measured[settled] == pytest.approx(1000.0 * exp(-4.0), rel=0.2)  # the voltage is held for 1 ms
    assert measured.max() <= 1000.0 + 1e-9 and measured[-1] == pytest.approx(1000.0, abs=1.0)


def test_a_speed_that_rises_evenly_is_followed_within_half_a_sample():
    t = np.arange(1000) * T
    rise = 2000.0  # rev/min/s
    measured, _ = run(tracking(), plant("spindle"), Reference(rise * t, np.full(1000, rise), np.zeros(1000)))
    assert abs(rise * t - measured)[200:].max() < rise * T


def test_friction_leaves_the_error_that_is_said():
    """F/(τ |pole|): 40 rev/min over 0.08 s and 32 1/s."""
    braked = library_model("spindle", **axis_model("spindle"), offset=-0.04)  # V, of 1000 rev/min each
    measured, _ = run(tracking(), braked, step(1000.0, 1000))
    assert 1000.0 - measured[-1] == pytest.approx(40.0 / (0.08 * 32.0), rel=0.01)


@pytest.mark.parametrize(
    "options, fault",
    [
        ({"poles": [-20, -30]}, "nothing to observe; remove poles, or give speed_pole"),
        ({"gains": [1600, -36]}, "remove gains"),
        ({"observer_pole": -320}, "remove observer_pole"),
        ({"speed_pole": 5}, "less than 0"),
        ({"speed_pole": -3000}, "choose a slower pole"),
    ],
)
def test_options_that_will_not_do_are_refused(options, fault):
    with pytest.raises(InputError) as error:
        tracking(**options)
    assert fault in str(error.value)


def test_an_axis_has_two_poles():
    with pytest.raises(InputError, match="has its position controlled; remove speed_pole, or give poles"):
        library_controller("tracking", axis_model("X"), T, RANGE, speed_pole=-32)


def test_an_experiment_follows_a_sine_and_its_gain_can_be_changed_while_it_runs():
    def follow(**options):
        words = {"amplitude": 300.0, "frequency": 0.5, "offset": 1000.0}
        return rds.Experiment(
            axis="spindle",
            duration=1.0,
            reference={"kind": "sinusoid", **words},
            controller={"name": "tracking", **options},
        )

    result = follow().run()
    late = result["time"] > 0.5
    assert np.abs((result["spindle_reference"] - result["spindle_measured"])[late]).max() < 2.0  # rev/min
    faster = 80.0 - 1.0 / 0.08  # the gain of a pole at -80 1/s
    changed = follow().run(changes=[(0.0, "spindle.g1", faster)])
    assert np.array_equal(changed["spindle_command"], follow(speed_pole=-80.0).run()["spindle_command"])
