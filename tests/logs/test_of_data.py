"""A data object with u, y and sampling_time, as of nonlinear_benchmarks, becomes a log when its units are said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rds
from rds.identification.logs.log import apart

UNITS = {"command": "V", "position": "mm"}
TAU, K, T = 0.01, 1.8, 1e-3


def data(**more: Any) -> SimpleNamespace:
    time = T * np.arange(3000)
    u = 4.0 * np.sin(2 * np.pi * 0.9 * time) + np.sin(2 * np.pi * 7.0 * time)
    model = {"name": "linear-axis", "tau": TAU, "K": K, "friction_plus": 0.0, "friction_minus": 0.0}
    _, y, _ = rds.lsim(model, u, time)
    made = {"u": u[:, None], "y": np.round(y, 3)[:, None], "sampling_time": T, "name": "bench"}
    return SimpleNamespace(**made | more)


def test_it_is_fitted_as_any_log() -> None:
    log = rds.Log.of(data(), UNITS, closed_loop=False)
    assert (log.name, len(log), log.sample_period) == ("bench", 3000, pytest.approx(T))
    found = rds.fit(log, "axis").values()
    assert found["tau"] == pytest.approx(TAU, rel=1e-2) and found["K"] == pytest.approx(K, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "units", "said"),
    [
        ({}, {"command": "V"}, "units has no 'position'"),
        ({}, UNITS | {"current": "A"}, "units has 'current', which the data have not"),
        ({"u": ["one", "two"]}, UNITS, "u and y must be arrays of numbers"),
        ({"u": np.zeros((3000, 2))}, UNITS, r"u has shape \(3000, 2\)"),
        ({"sampling_time": 0.0}, UNITS, "sampling_time = 0.0 must be more than 0 s"),
        ({"y": np.zeros(10)}, UNITS, "position has shape"),
    ],
)
def test_what_is_refused(more: dict[str, Any], units: dict[str, str], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        rds.Log.of(data(**more), units)


def test_a_fit_of_the_object_itself_says_how_it_becomes_a_log() -> None:
    with pytest.raises(rds.InputError, match=r"is no log; rds\.Log\.of\(data, units=\.\.\.\)"):
        rds.fit(data(), "axis")


def test_names_that_repeat_are_numbered_as_no_other_is_called() -> None:
    assert apart(["a", "b"]) == ["a", "b"]
    assert apart(["a", "a", "a (1)", "b"]) == ["a (2)", "a (3)", "a (1)", "b"]
