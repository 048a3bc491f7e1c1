"""Each rule of the verdict at its bound: what is just within it speaks for a model, what is beyond it against."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from rds.identification.fit.estimate import Errors
from rds.identification.validate.assessment import Assessment, assess
from rds.identification.validate.attainable import Attainable
from rds.identification.validate.discrepancy import Off
from rds.identification.validate.judge import _overfit, _said_of, judge
from rds.identification.validate.verdict import Bands, Reason
from rds.identification.validate.within import Measure
from tests.validation.validation_logs import candidate, log, square

MODEL = candidate()


@pytest.fixture(scope="module")
def plain() -> Assessment:
    """Of a model whose free run fails, with nothing known of gain and phase, and no noise."""
    a = assess(MODEL, log(square(2.0)))
    fails = Errors(50.0, 1.0, 2.0, "mm")
    return replace(a, free_run=fails, velocity=None, as_axis=None, as_motion=None, noise=0.0, attainable=None)


def reason(a: Assessment, kind: str, **more: object) -> Reason | None:
    found = judge(MODEL, replace(a, **more), Bands()).reasons  # type: ignore[arg-type]
    return next((each for each in found if each.kind == kind), None)


def side(a: Assessment, kind: str, **more: object) -> str | None:
    found = reason(a, kind, **more)
    return found and str(found.side)


def fits(percent: float) -> Errors:
    return Errors(percent, 1.0, 2.0, "mm")


@pytest.mark.parametrize(
    ("gain", "kind", "said"),
    [
        (-0.86, "sign", "is reversed"),
        (-1.16, "sign", "moves the other way"),
        (510.0, "unit", "1000 times smaller"),
        (1960.0, "unit", "1000 times smaller"),
        (0.00051, "unit", "1000 times larger"),
        (25.4 * 1.14, "unit", "in mm where inches are stated"),
        (1.14 / 25.4, "unit", "in inches where mm are stated"),
        (60.0 * 0.86, "unit", "per minute where it is stated per second"),
        (0.86 / 60.0, "unit", "per second where it is stated per minute"),
    ],
)
def test_factors_of_a_unit_or_sign_are_named(plain: Assessment, gain: float, kind: str, said: str) -> None:
    found = reason(plain, kind, gain=gain)
    assert found is not None and said in found.what and found.side == "against"
    assert reason(plain, kind, gain=gain, free_run=fits(95.0)) is None  # a run that fits has no wrong unit


@pytest.mark.parametrize("gain", [490.0, 2040.0, 25.4 * 1.16, 60.0 * 0.84, 1.0, 0.0, None])
def test_other_factors_are_none(plain: Assessment, gain: float | None) -> None:
    assert reason(plain, "unit", gain=gain) is None and reason(plain, "sign", gain=gain) is None


def test_a_fit_near_its_band_is_borderline(plain: Assessment) -> None:
    found = [reason(plain, "free-run", free_run=fits(percent)) for percent in (87.4, 87.5, 89.9, 90.0, 92.5, 92.6)]
    said = [(str(each.side), "borderline" in each.what) for each in found if each]
    against, borne = ("against", True), ("for", True)
    assert said == [("against", False), against, against, borne, borne, ("for", False)]


def test_the_voltage_and_the_parameters_have_bands(plain: Assessment) -> None:
    def needed(percent: float | None) -> str | None:
        return side(plain, "voltage", voltage=SimpleNamespace(relative_percent=percent, rmse=0.1, extra=np.zeros(3)))

    assert [needed(percent) for percent in (15.0, 15.1, None)] == ["for", "against", "note"]

    def beside(
        rmse: float, apart: float = 0.0, noise: float = 0.5, samples: int = 2000, **more: object
    ) -> dict[str, Reason | None]:
        parameter = SimpleNamespace(name="K", model=1.0, unit="", here=2.0, apart=apart)
        found = Attainable(rmse, 1.0, noise, samples, (parameter,))  # type: ignore[arg-type]
        return {k: reason(plain, k, attainable=found, **more) for k in ("attainable", "parameters")}

    assert beside(2.0)["attainable"] is None  # the run fails: that no fit comes nearer says nothing for it
    within, beyond = beside(2.0, free_run=fits(95.0))["attainable"], beside(2.1)["attainable"]
    assert within is not None and within.side == "for" and "the noise" not in within.what
    assert beyond is not None and beyond.side == "against" and "2.1 times as far off" in beyond.what
    told = beside(9.0, noise=1.5, samples=1000)["attainable"]
    assert told is not None and "1.5 mm for the measurement's noise, over 1 s of the log" in told.what
    assert beside(1.0, apart=3.5)["parameters"] is None
    off = beside(1.0, apart=3.6)["parameters"]
    assert off is not None and off.side == "against" and "K 1 where this log says 2 (3.6 standard errors)" in off.what


def test_the_residual_has_its_tests(plain: Assessment) -> None:
    def tested(p: float, outside: float = 0.0, blocks: int = 50, fit: float = 95.0) -> list[str | None]:
        lags = SimpleNamespace(largest=(0.2, 0.01), outside=outside)
        tests = SimpleNamespace(p_white=p, p_command=p, auto=lags, cross=lags, blocks=blocks, block=5)
        return [side(plain, kind, tests=tests, free_run=fits(fit)) for kind in ("whiteness", "command")]

    assert tested(0.01) == ["against"] * 2 and tested(0.011) == ["for"] * 2
    assert tested(0.01, blocks=49) == [None] * 2
    # wide intervals allow for as much: of a model that fails, that says nothing for it
    assert tested(0.5, 0.11) == ["for"] * 2 and tested(0.5, 0.11, fit=50.0) == ["note"] * 2
    assert tested(0.5, 0.1, fit=50.0) == ["for"] * 2


def test_predictions_are_held_against_none(plain: Assessment) -> None:
    def ahead(*rmse: float) -> Reason:
        given = {k: Errors(0.0, each, each, "mm") for k, each in zip((1, 10, 100), rmse, strict=False)}
        found = reason(plain, "ahead", ahead=given, naive={k: Errors(0.0, 1.0, 1.0, "mm") for k in given})
        assert found is not None
        return found

    assert ahead(0.49, 0.5).side == "note" and ahead(0.5, 0.5).side == "against"
    said = ahead(0.4, 1.0, 1.1).what
    assert "; 10 ahead, the error is 0.5 times that without a model, or more, whatever its fit" in said
    assert "; 100 ahead, the model is worse than none" in said


def test_what_the_structure_lacks_is_told_from_three_times_the_noise_on(plain: Assessment) -> None:
    def left(noise: float, reached: float | None = None) -> str | None:
        found = None if reached is None else Attainable(reached, reached, noise, 2000, ())
        return side(plain, "structure", noise=noise, attainable=found)

    assert left(1.0 / 3.0) is None and left(0.33) == "against"  # the free run leaves 1 mm
    assert left(0.33, 0.99) is None and left(0.33, 1.0) == "against" and left(0.0, 1.0) is None

    held = replace(plain.log, closed_loop=True)  # by the farthest prediction, of which noise alone makes √2
    for rmse, told in ((2.99 * 2**0.5, None), (3.01 * 2**0.5, "against")):
        ahead = {1: Errors(0.0, 99.0, 99.0, "mm"), 100: Errors(0.0, rmse, rmse, "mm")}
        assert side(plain, "structure-held", log=held, noise=1.0, ahead=ahead, naive=ahead) == told


def test_errors_grow_by_twice_of_what_they_were_on_the_fit_s_data(plain: Assessment) -> None:
    def grown(rmse: float, own: float, fitted: float | None = 10.0, seen: float = 0.05, **more: object) -> str:
        given = {k: Errors(0.0, value, value, "mm") for k, value in ((1, 0.0), (10, own))}
        of = SimpleNamespace(fit_predictions=lambda: [given])
        speed = SimpleNamespace(here=(-5.0, 20.0), fitted=None if fitted is None else (-fitted, 0.0))
        here = {k: Errors(0.0, value, value, "mm") for k, value in ((1, 9.0), (10, rmse), (100, 99.0))}
        a = replace(
            plain,
            ahead=here,
            ranges={**plain.ranges, "velocity": speed},  # type: ignore[dict-item]
            overlap=SimpleNamespace(share=seen),  # type: ignore[arg-type]
            **more,  # type: ignore[arg-type]
        )
        return next(iter(_overfit(of, a, Bands())), Reason("note", "", "")).what  # type: ignore[arg-type]

    assert not grown(4.0, 1.0) and grown(4.1, 1.0).startswith("10 samples ahead, the RMSE is 2.0 times")
    assert grown(2.1, 1.0, fitted=40.0) and grown(2.1, 1.0, fitted=None) and grown(2.1, 1.0, fitted=0.0)
    assert not grown(4.1, 1.0, seen=0.051)
    assert not grown(4.1, 1.0, attainable=Attainable(1.0, 1.0, 1.0, 9, ()))
    step = 1e-3 / 12**0.5  # what the encoder's rounding makes counts as the fit's own error
    assert not grown(1.99 * step, 0.0, None) and grown(2.01 * step, 0.0, None)


@pytest.mark.parametrize(
    ("kind", "off", "said"),
    [
        ("gain", Off(2.0, 0.1, "%"), "its gain is 2 % too high"),
        ("gain", Off(-2.0, 0.1, "%", 5.0), "its gain at 5 Hz is 2 % too low"),
        ("gain", Off(inf, 0.1, "%"), "does not move as the model does"),
        ("speed", Off(-4.0, 0.1, "%"), "its speed is 4 % too low, by its gain or its friction"),
        ("speed", Off(4.0, 2.0, "%"), "its speed is 4 % too high"),
        ("phase", Off(3.0, 0.1, "°"), "at 8 Hz its phase leads that of the axis by 3°"),
        ("phase", Off(-3.0, 0.1, "°"), "its phase lags that"),
        ("delay", Off(0.002, 0.0, "s"), "its delay is 2 ms too long"),
        ("delay", Off(-0.002, 0.0, "s"), "its delay is 2 ms too short"),
        ("friction", Off(1.0, 0.1, "%"), "its friction is too high by 1 % of the largest command"),
        ("friction", Off(-1.0, 0.1, "%"), "its friction is too low by"),
    ],
)
def test_what_a_model_is_off_by_is_a_clause(kind: str, off: Off, said: str) -> None:
    found = _said_of(Measure(kind, off, 3.0), 8.0)
    assert said in found and ("tell apart" in found) == (off.value == -4.0)
