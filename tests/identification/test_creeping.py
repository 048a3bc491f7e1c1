"""An axis that moves little beside the noise: intervals that hold, or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rds.core.quantities import Quantity
from rds.identification.fit.fit import fit
from rds.identification.fit.problem import Problem
from rds.identification.fit.profile import widening
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from rds.identification.structures.structure import Structure
from tests.identification.fit_logs import mini_cnc

AXIS = make()


def creeping(seed: int, kind: str, share: float) -> Log:
    """3 s in which the X axis's whole reach is 40 times the noise; `share` of the voltage that overcomes friction."""
    values, t = mini_cnc("X"), np.arange(3000) * 1e-3
    draw = np.random.default_rng(seed)
    u = share * values["friction_plus"] / values["K"] * np.sin(2.0 * np.pi * 3.0 * t)
    u = np.abs(u).max() * np.sign(u) if kind == "square" else u
    y = AXIS.respond(t, u, (0.0, 0.0), values)
    return Log(kind, t, u, y + np.ptp(y) / 40.0 * draw.standard_normal(len(t)), units={"position": "mm"})


def test_a_profile_is_followed_to_the_bound_that_a_parameter_cannot_pass() -> None:
    def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        return x0[0] + values["a"] * u

    made = Structure("line", {"a": Quantity("slope", low=0.25)}, {"a": ""}, 1, respond, at_most={"a": 1.05})
    t = np.arange(100.0)
    u = t - t.mean()
    problem = Problem([Log("line", t, u, u)], made, {})
    allowed = (1.0 - 0.3) ** 2 * float(u @ u)  # of a slope of 0.3: the true end of the interval, near the bound
    widened = widening(problem, np.array([1.0, 0.0]), 0.0, {"a": 0.1}, allowed)
    assert widened["a"] == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize("kind", ["square", "sine"])
def test_intervals_hold_or_are_refused(kind: str) -> None:
    """The axis goes backward only, or nearly. Under a square voltage a K a thousand times too large explains that."""
    inside, told = [], 0
    for seed in (1, 3):
        found = fit([creeping(seed, kind, 1.1)], AXIS)
        assert any("intervals reach to where the residuals grow by more than chance" in w for w in found.warnings)
        for name, truth in mini_cnc("X").items():
            parameter = found.parameters[name]
            if kind == "square" and name == "K":
                assert parameter.value > 100.0 * truth and np.isinf(parameter.std_error)
            if np.isfinite(parameter.std_error):
                told += 1
                inside.append(parameter.low <= truth <= parameter.high)
            else:
                assert any(name in sentence for sentence in found.unidentifiable)
    assert told >= 2 and all(inside)


def test_a_structure_without_derivatives_keeps_its_intervals_and_says_so() -> None:
    slow = replace(AXIS, sensitivities=None)
    found = fit([creeping(0, "sine", 1.1).part(0, 1000)], slow, options={"fixed": {"tau": mini_cnc("X")["tau"]}})
    assert any("may be too narrow here" in warning for warning in found.warnings)
