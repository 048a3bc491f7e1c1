"""Iterative learning control: what trials leave of the error, where it stops, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.modes.experiment.learning import learn, low_pass

SINE = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.4}


def experiment(**more: Any) -> rds.Experiment:
    own = dict(rds.load_machine("mini-cnc").axis("X").machine)
    words: dict[str, Any] = {"axis": "X", "duration": 2.5, "reference": SINE, "controller": {"name": "p"}}
    return rds.Experiment(**(words | {"model": {"name": "machine-axis", **own}} | more))


def test_trials_leave_a_tenth_of_the_error() -> None:
    """On the machine's axis with friction, play and offset, which the law knows nothing of."""
    heard = []
    learned = learn(experiment(), 8, trial=lambda number, result: heard.append((number, len(result))))
    errors = learned.rms["X"]
    assert errors[-1] < 0.1 * errors[0] and learned.converged
    assert heard == [(number, 2500) for number in range(1, 9)]
    assert len(learned.results) == 8 and learned.correction["X"].shape == (2500,)
    np.testing.assert_array_equal(learned.results[0]["X_reference"], learned.results[-1]["X_reference"])
    assert learned.results[-1].meta["controller"]["X"]["name"] == "p, learning"


def test_the_first_trial_is_the_experiment() -> None:
    plain = experiment().run()
    np.testing.assert_array_equal(learn(experiment(), 2).results[0]["X_measured"], plain["X_measured"])


def test_the_filter_lets_half_through_at_its_cutoff_without_phase() -> None:
    T, t = 1e-3, np.arange(8000) * 1e-3
    for frequency, through in ((10.0, 0.5), (1.0, 0.993), (20.0, 0.0625)):
        sine = np.sin(2 * np.pi * frequency * t)
        inside = low_pass(sine, 10.0, T)[2000:-2000]
        assert inside @ sine[2000:-2000] / (sine[2000:-2000] @ sine[2000:-2000]) == pytest.approx(through, rel=0.01)
        cosine = np.cos(2 * np.pi * frequency * t)[2000:-2000]
        assert abs(inside @ cosine) / len(cosine) < 1e-3


def test_axes_learn_together_each_its_own() -> None:
    both = experiment(axis=("X", "Y"), model=None, controller={"name": "tracking"})
    learned = learn(both, 4)
    assert all(errors[-1] < 0.6 * errors[0] for errors in learned.rms.values())


@pytest.mark.parametrize(
    "more, options, said",
    [
        ({}, {"trials": 1}, "trials = 1"),
        ({}, {"gain": 0.0}, "gain = 0"),
        ({}, {"cutoff": 600.0}, "half of the sample rate, 500 Hz"),
        ({"reference": None, "controller": None, "signal": {"kind": "constant", "value": 1.0}}, {}, "a voltage signal"),
    ],
)
def test_what_cannot_learn_is_refused(more: dict[str, Any], options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        learn(experiment(**more), **options)


def test_errors_are_told_in_the_axis_s_unit() -> None:
    speed = {"kind": "constant", "value": 500.0}
    learned = learn(rds.Experiment(axis="spindle", reference=speed, controller="pid", duration=0.1), 2.0)  # type: ignore[arg-type]
    assert len(learned.results) == 2 and repr(learned).endswith(" rev/min>")


@pytest.mark.realtime
def test_it_learns_on_the_machine() -> None:
    quick = {"kind": "sinusoid", "amplitude": 2.5, "frequency": 0.8}  # as fast, in half the time
    words = {"model": None, "sample_period": 0.002, "duration": 1.25, "reference": quick}
    learned = learn(experiment(**words), 3, mode="implementation")
    assert learned.rms["X"][-1] < 0.7 * learned.rms["X"][0]
