"""Iterative learning control: what trials leave of the error, where it stops, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.core.errors import InputError
from rds.modes.experiment.learning import learn, low_pass
from tests.documents import ROOT

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


def test_a_trial_whose_timing_was_off_is_told() -> None:
    """Its late samples were blamed on the gains."""
    learned = learn(experiment(), 2)
    first, last = learned.results
    late = rds.Result(last.columns, last.units, last.meta | {"verdict": "void"})
    learned = replace(learned, results=(first, late))
    (note,) = (note for note in learned.notes if note.startswith("the timing of trial 2 was void"))
    assert "learnt from it" not in note  # nothing follows the last trial
    (note,) = (note for note in replace(learned, results=(late, first)).notes if "trial 1 was void" in note)
    assert "learnt from it" in note


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


@pytest.mark.parametrize("share", [0.3, 0.45, 0.499])
def test_half_of_the_cutoff_passes_up_to_nyquist_s_frequency(share: float) -> None:
    """A Gaussian that is cut into samples let 0.89 through there."""
    sine = np.sin(2 * np.pi * share * np.arange(8000) + 0.5)
    inside = low_pass(sine, share / 1e-3, 1e-3)[2000:-2000]
    np.testing.assert_allclose(inside, 0.5 * sine[2000:-2000], atol=1e-4)


def test_trials_are_those_of_the_lifted_system() -> None:
    """e_j = (1 - G) r - G w_j with the closed loop's matrix G, and w_j+1 = Q (w_j + gain e_j, early)."""
    from scipy.linalg import toeplitz
    from scipy.special import ive

    n, T, tau, K, P, gain, shift, cutoff = 200, 5e-3, 0.03, 2.0, 4.0, 0.8, 3, 20.0
    exact = {"saturation": False, "quantization": False}
    model = {"name": "linear-axis", "tau": tau, "K": K, "friction_plus": 0.0, "friction_minus": 0.0}
    plain = experiment(
        duration=n * T, sample_period=T, model=model, controller={"name": "p", "Pgain": P}, interface=exact
    )
    learned = learn(plain, 4, gain=gain, lead=shift * T, cutoff=cutoff)
    decay = np.exp(-T / tau)
    A = np.array([[1.0, tau * (1.0 - decay)], [0.0, decay]])
    B = K * np.array([T - tau * (1.0 - decay), 1.0 - decay])
    state, answer = B * P, [0.0]
    for _ in range(n - 1):
        answer.append(state[0])
        state = A @ state - B * P * state[0]
    G, r = toeplitz(answer, np.zeros(n)), 5.0 * np.sin(2 * np.pi * 0.4 * np.arange(n) * T)
    kernel = ive(np.arange(-150, 151), np.log(2.0) / (1.0 - np.cos(2 * np.pi * cutoff * T)))
    w = np.zeros(n)
    for result in learned.results:
        e = r - G @ (r + w)
        np.testing.assert_allclose(result["X_reference"] - result["X_measured"], e, atol=1e-9)
        early = np.concatenate([e[shift:], np.full(shift, e[-1])])
        w, before = np.convolve(np.pad(w + gain * early, 150, mode="edge"), kernel, mode="valid"), w
    np.testing.assert_allclose(learned.correction["X"], before, atol=1e-9)


def test_errors_that_grow_again_did_not_converge() -> None:
    """From 0.212 mm to 0.016 mm, but it was half of that in between."""
    learned = learn(experiment(), 20, gain=1.0, lead=0.05, cutoff=40.0)
    errors = learned.rms["X"]
    assert errors[-1] < 0.1 * errors[0] and errors[-1] > 1.5 * min(errors)
    assert not learned.converged and "the error grows: it was least in trial 5" in learned.notes[0]
    assert learn(experiment(), 4).notes == []


@pytest.mark.parametrize("own", [{}, {"maxoutput": 5.0}])
def test_where_the_voltage_is_at_its_limit_nothing_winds_up(own: dict[str, float]) -> None:
    """The correction came to 200 mm in 20 trials, growing with each, for a reference of 20 mm."""
    law = {"name": "p"} | own
    learned = learn(experiment(reference=SINE | {"amplitude": 20.0, "frequency": 1.0}, controller=law), 3)
    assert np.abs(learned.correction["X"]).max() < 0.5
    assert learned.converged and "the command was at its limit in 9" in learned.notes[0]


def test_a_law_that_is_at_its_limits_at_rest_is_not_told_to_move_slower() -> None:
    def bang_bang(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        return (10.0 if r.position > y else -10.0), state

    learned = learn(experiment(reference={"kind": "constant", "value": 0.0}, controller=bang_bang), 2)
    (note,) = (note for note in learned.notes if "at its limit" in note)
    assert note.endswith("lower the gains of the law")


def test_the_lead_is_two_samples_whatever_the_sample_period() -> None:
    slow = experiment(sample_period=5e-3)
    np.testing.assert_array_equal(learn(slow, 2).correction["X"], learn(slow, 2, lead=0.01).correction["X"])


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
        ({}, {"cutoff": 1e-6}, "too low for a trial of 2.5 s; give 0.04 or more"),
        ({"duration": 0.5}, {"lead": 0.5}, "lead = 0.5 s must be shorter than a trial, 0.5 s"),
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
    learned = learn(experiment(**words), 2, mode="implementation")
    assert learned.rms["X"][-1] < 0.7 * learned.rms["X"][0]


def test_a_place_for_the_results_is_looked_at_before_the_first_trial(tmp_path: Path) -> None:
    """A file of that name was found after the last one, and the trials were lost."""
    there = tmp_path / "there"
    there.write_text("mine")
    refused = CliRunner().invoke(app, ["learn", str(ROOT / "examples" / "experiment.toml"), "--out", str(there)])
    assert refused.exit_code == 2 and "is a file, not a folder" in refused.stderr and "trial 1" not in refused.stderr
