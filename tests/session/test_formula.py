"""Formulas of time: what they are worth, and what is no formula."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.panels.session.formula import formula_file, formula_values
from rds.references import make_signal, sample_voltage

TIMES = np.linspace(0.0, 2.0, 201)


@given(a=st.floats(-50, 50), f=st.floats(0.01, 20), c=st.floats(-5, 5))
def test_a_formula_is_worth_what_it_says(a: float, f: float, c: float) -> None:
    values = formula_values(f"{a!r}*sin(2*pi*{f!r}*t) + {c!r}*t**2 - (t > 1)", TIMES)
    expected = [a * math.sin(2 * math.pi * f * t) + c * t**2 - (t > 1) for t in TIMES]
    assert np.allclose(values, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("__import__('os').system('true')", "cannot stand in a formula"),
        ("sin.__class__", "cannot stand in a formula"),
        ("open(t)", "knows no 'open'"),
        ("(lambda: 1)()", "cannot stand in a formula"),
        ("[t for t in (1,)]", "cannot stand in a formula"),
        ("3*sin(2*pi*", "not a formula of t"),
        ("3*t +", "at its end; write it as in 3"),
        ("3*t + 2t", "at character 7; write it as in 3"),
        ("x + 1", "knows no 'x'"),
        ("sin(t, 2)", r"sin\(\) takes 1 value, not 2"),
        ("1/t", "is inf at t = 0 s"),
        ("sqrt(-1-t)", "is nan at t = 0 s"),
        ("9**9**9**9", "is inf at t = 0 s"),
        ("'a'*t", "cannot stand"),
        ("t" + "+t" * 400, "500 are allowed"),
        ("(" * 240 + "t", "not a formula of t"),
    ],
)
def test_what_is_no_formula_is_refused_with_the_reason(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        formula_values(text, TIMES)


def test_its_file_gives_the_formula_at_every_sample(tmp_path: Path) -> None:
    name = formula_file(tmp_path, "3*sin(2*pi*0.5*t)", 2.0, 0.001)
    signal = make_signal("user", file=str(tmp_path / name))
    assert np.array_equal(
        sample_voltage(signal, 0.001, 2000), formula_values("3*sin(2*pi*0.5*t)", np.arange(2000) * 0.001)
    )
    assert formula_file(tmp_path, "3*sin(2*pi*0.5*t)", 2.0, 0.001) == name
    assert formula_file(tmp_path, "2*sin(2*pi*0.5*t)", 2.0, 0.001) != name


def test_a_formula_of_too_many_samples_is_told_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="100000 samples, not 3600002; shorten the final time"):
        formula_file(tmp_path, "t", 3600.0, 0.001)
    assert not list(tmp_path.iterdir())
