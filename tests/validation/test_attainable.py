"""A model whose parameters are biased is not valid without reserve, however good its free run looks."""

from __future__ import annotations

import numpy as np
import pytest

from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.structures import structure
from rds.identification.validate import attainable
from rds.identification.validate.validate import validate
from rds.identification.validate.verdict import Bands, Side, Word
from tests.validation.validation_logs import STEP, X, candidate, log, square

AXIS = structure("axis")


def stairs(seed: int, period: float, noise: float) -> Log:
    """10 s of random voltages of 0.25 s each; `noise` mm before an encoder of 1 µm."""
    draw = np.random.default_rng(seed)
    t = np.arange(round(10.0 / period)) * period
    u = draw.uniform(-4.0, 4.0, 41)[(t / 0.25).astype(int)]
    y = AXIS.respond(t, u, (0.0, 0.0), X) + noise * draw.standard_normal(len(t))
    units = {"position": "mm", "command": "V"}
    return Log(f"stairs {seed}", t, u, np.round(y / STEP) * STEP, resolution=STEP, units=units, closed_loop=False)


@pytest.mark.parametrize(  # least share by which tau is off, by which friction_minus is, and the word for that
    ("period", "noise", "tau", "friction", "word"),
    [
        (0.0005, 0.001, 0.15, 0.1, Word.NOT),
        (0.0005, 0.003, 0.6, 0.0, Word.NOT),
        (0.001, 0.003, 0.1, 0.15, Word.PARTLY),
        (0.005, 0.001, 0.05, 0.2, Word.PARTLY),
    ],
)
def test_inverse_dynamics_of_noisy_data_is_not_valid_and_a_fit_of_the_free_run_is(
    period: float, noise: float, tau: float, friction: float, word: Word
) -> None:
    data, fresh = stairs(1, period, noise), stairs(2, period, noise)
    biased, right = (fit([data], AXIS, method) for method in ("inverse-dynamics", "simulation"))
    off = {name: abs(value / X[name] - 1.0) for name, value in biased.values().items()}
    assert off["tau"] > tau and off["friction_minus"] > friction  # this is what misleads
    misled, sound = validate(biased, fresh), validate(right, fresh)
    a = misled.assessments[fresh.name]
    assert a.free_run is not None and a.free_run.fit_percent > 90.0 and a.attainable is not None
    assert a.attainable.ratio > 4.0 and a.attainable.reached == pytest.approx(np.hypot(noise, STEP / 12**0.5), rel=0.1)
    assert misled.verdict.word is word
    against = {reason.kind: reason.what for reason in misled.verdict.reasons if reason.side is Side.AGAINST}
    assert f"{a.attainable.ratio:.3g} times as far off" in against["attainable"]
    assert sound.verdict.word is Word.VALID, str(sound)
    best = sound.assessments[fresh.name].attainable
    assert best is not None and best.ratio < 1.2 and max(p.apart for p in best.parameters) < 3.5


def test_a_parameter_beyond_its_interval_is_named_with_what_the_log_says() -> None:
    found = validate(candidate(X | {"tau": 0.9 * X["tau"]}, share=0.01), log(square()))
    (reason,) = [reason for reason in found.verdict.reasons if reason.kind == "parameters"]
    assert reason.what.startswith("beyond their intervals: tau 0.008949 s where this log says 0.00994")
    assert found.verdict.sentence.endswith("Do not take its parameters for the axis's own: this log contradicts them.")
    mild = validate(candidate(X | {"tau": 0.9 * X["tau"]}, share=0.01), log(square()), bands=Bands(apart=50.0))
    assert "parameters" not in {reason.kind for reason in mild.verdict.reasons}


def test_of_a_long_log_only_the_beginning_is_fitted_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attainable, "_LONGEST", 3000)
    found = validate(candidate(share=0.01), log(square()))
    (reason,) = [reason for reason in found.verdict.reasons if reason.kind == "attainable"]
    assert reason.side is Side.FOR and reason.what.endswith("over 3 s of the log)")
    rests = np.concatenate([np.zeros(4000), square()])  # at first, where nothing tells the gain
    found = validate(candidate(X | {"K": 1.1 * X["K"]}, share=0.01), log(rests))
    (reason,) = [reason for reason in found.verdict.reasons if reason.kind == "attainable"]
    assert reason.side is Side.AGAINST


def test_no_fit_is_a_measure_in_a_closed_loop_or_of_a_model_that_was_never_fitted() -> None:
    u = square()
    assert validate(candidate(share=0.01), log(u, closed_loop=True)).assessments["log"].attainable is None
    assert validate(candidate(), log(u)).assessments["log"].attainable is None
