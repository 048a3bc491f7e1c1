"""A few machines of the factory of truths, of which `python -m benchmarks.verdicts` judges hundreds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rds
from benchmarks.truths import cases, machine
from benchmarks.verdicts import Row, rates, rows, table
from rds.identification.validate.assessment import assess
from rds.identification.validate.judge import judge
from rds.identification.validate.verdict import Bands, Word

OWN = """from math import tanh

params = {{"tau": {tau}, "K": {K}, "F": {F}}}
initial_state = [0.0, 0.0]


def advance(x, u, T, params):
    # ten steps of Runge and Kutta, in numbers
    tau, K, F = params["tau"], params["K"], params["F"]
    y, v, u, h = float(x[0]), float(x[1]), float(u[0]), T / 10

    def slope(v):
        return (K * u - F * tanh(v / 0.01) - v) / tau

    for _ in range(10):
        a = slope(v)
        b = slope(v + h / 2 * a)
        c = slope(v + h / 2 * b)
        d = slope(v + h * c)
        y += h * (v + h / 6 * (a + b + c))
        v += h / 6 * (a + 2 * b + 2 * c + d)
    return [y, v]
"""
KINDS = ("truth", "tau off by 30 %", "K 5 % off", "a hidden delay", "K 5 % off, a file of one's own")


@pytest.mark.parametrize("number", [8, 15])  # an open loop with noise, and a closed one
def test_right_models_are_valid_and_wrong_ones_are_not(number: int) -> None:
    found = rows(number, KINDS)
    assert [row.kind for row in found if row.right] == ["truth"] and len(found) == len(KINDS)
    assert [(row.kind, row.says) for row in found if row.error] == []
    right, wrong = rates(found)
    assert right.met and wrong.met and wrong.note == "0 of 4; at most 52.71 % with 95 % confidence"


def test_play_that_a_time_constant_makes_up_for_is_found() -> None:
    (row,) = rows(153, ["fitted without options"])
    assert row.says == "not valid" and not row.right


def test_friction_that_differs_by_direction_keeps_its_stribeck_part_in_a_verdict() -> None:
    truth = next(cases(172))
    assert truth.machine.options == ("stribeck",) and truth.suffices
    assert judge(truth.candidate, assess(truth.candidate, truth.log), Bands()).ok


def test_a_motion_within_the_play_tells_nothing() -> None:
    truth = next(cases(17))
    verdict = judge(truth.candidate, assess(truth.candidate, truth.log), Bands())
    assert verdict.word is Word.CANNOT_TELL and not truth.suffices
    assert any(reason.kind == "no-motion" and "its noise alone" in reason.what for reason in verdict.reasons)


def test_play_may_begin_anywhere_within_its_width() -> None:
    """Of a file of one's own, the way before axis and model have been driven the same way tells nothing."""
    (row,) = rows(333, ["truth, a file of one's own"])
    assert row.right and row.suffices and not row.error


@pytest.mark.parametrize(
    ("tau", "K", "F", "said"),
    [
        (9.943e-3, 1.764, 0.539, "is valid for"),
        (9.943e-3, 1.764, 0.0, "its speed is 18 % too high, by its gain or its friction"),
        (9.943e-3, 1.764 * 0.9, 0.539, "its speed is 11.8 % too low, by its gain or its friction"),
        (1.3 * 9.943e-3, 1.764, 0.539, "at 6.2 Hz its phase lags that of the axis by 5.6"),
    ],
)
def test_of_one_speed_each_way_gain_and_friction_are_told_together(
    tmp_path: Path, tau: float, K: float, F: float, said: str
) -> None:
    """3.528 - 0.539 mm/s at 2 V: without friction 18.0 % too high, with 0.9 of the gain 11.8 % too low."""
    (tmp_path / "mine.py").write_text(OWN.format(tau=tau, K=K, F=F))
    axis = rds.library_model("linear-axis", tau=9.943e-3, K=1.764, friction_plus=0.539, friction_minus=-0.539)
    time = np.arange(4000) * 1e-3
    volts = np.where(np.sin(2.0 * np.pi * time) >= 0.0, 2.0, -2.0)
    position = np.round(np.ravel(rds.lsim(axis, volts, time)[1]) / 0.0005) * 0.0005
    verdict = rds.validate(tmp_path / "mine.py", rds.Log("square", time, volts, position, resolution=0.0005)).verdict
    assert said in verdict.sentence and (verdict.word is Word.VALID) == (said == "is valid for")


@pytest.mark.parametrize(("back", "noise"), [(2.0, 0.03), (1.97, 0.015)])
def test_noise_of_a_measured_voltage_makes_no_second_level_of_it(tmp_path: Path, back: float, noise: float) -> None:
    """A gain twice too high, with the friction that makes the same speed of it: it was called 10 % too low."""
    friction = 0.539 + 1.764 * (2.0 + back) / 2.0
    (tmp_path / "mine.py").write_text(OWN.format(tau=9.943e-3, K=2 * 1.764, F=friction))
    axis = rds.library_model("linear-axis", tau=9.943e-3, K=1.764, friction_plus=0.539, friction_minus=-0.539)
    time = np.arange(4000) * 1e-3
    volts = np.where(np.sin(2.0 * np.pi * time) >= 0.0, 2.0, -back)
    volts += noise * np.random.default_rng(3).standard_normal(4000)
    position = np.round(np.ravel(rds.lsim(axis, volts, time)[1]) / 0.0005) * 0.0005
    verdict = rds.validate(tmp_path / "mine.py", rds.Log("square", time, volts, position, resolution=0.0005)).verdict
    kinds = {reason.kind for reason in verdict.reasons}
    assert "speed" in kinds and not {"gain", "gain-unidentifiable", "friction"} & kinds


def test_a_linear_axis_beside_one_that_does_more_is_not_blamed_for_gain_and_friction_apart() -> None:
    """A pitch error of 20 µm: the best axis took it for gain and friction, off by several of their standard errors."""
    values = {"tau": 9.943e-3, "friction_plus": 0.539, "friction_minus": -0.539}
    time = np.arange(4000) * 1e-3
    volts = np.where(np.sin(2.0 * np.pi * time) >= 0.0, 2.0, -2.0)
    position = np.ravel(rds.lsim(rds.library_model("linear-axis", K=1.764, **values), volts, time)[1])
    position = np.round((position + 0.02 * np.sin(np.pi * position)) / 0.0005) * 0.0005
    log = rds.Log("square", time, volts, position, resolution=0.0005)
    verdict = rds.validate(rds.library_model("linear-axis", K=1.1 * 1.764, **values), log).verdict
    assert verdict.word is Word.NOT and "by its gain or its friction" in verdict.sentence
    assert "its gain" not in verdict.sentence.replace("its gain or its friction", "")


def test_a_few_steps_of_an_encoder_without_noise_do_not_suffice() -> None:
    few, many = next(cases(504)), next(cases(8))
    assert np.ptp(few.log.position) < 20.0 * few.machine.resolution and not few.suffices and many.suffices


def test_the_rates_count_what_is_called_otherwise_than_it_is() -> None:
    made = [
        Row(1, "truth", right=True, suffices=True, says="cannot tell", error=True),
        Row(1, "truth", right=True, suffices=False, says="cannot tell", error=True),  # noise hides it: no error
        Row(1, "K 5 % off", right=False, suffices=True, says="valid", error=True),
        Row(2, "K 5 % off", right=False, suffices=True, says="not valid", error=False),
    ]
    right, wrong = rates(made)
    assert right.note.startswith("1 of 1") and wrong.note.startswith("1 of 2") and not wrong.met
    assert ("truth, log too weak", 1, "1 cannot tell") in table(made)


def test_a_machine_is_the_same_in_every_run() -> None:
    assert machine(8) == machine(8) != machine(9) and not machine(8).closed_loop and machine(15).closed_loop
