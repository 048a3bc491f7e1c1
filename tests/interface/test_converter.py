"""What stands between computer and machine: levels, limits, and values that are no voltage."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, integers

from rds.core.errors import ContractError
from rds.machines.converter import as_voltage, converted, converter, limits
from rds.machines.encoder import counted, encoder

STEP = 20.0 / 4096


def test_twelve_bits_have_4096_levels() -> None:
    convert = converter(10.0, 12)
    levels = {convert(u) for u in np.linspace(-11.0, 11.0, 50_001)}
    assert levels == {k * STEP for k in range(-2048, 2048)}


@given(u=floats(-10.0, 10.0 - STEP))
def test_the_nearest_level_is_taken(u: float) -> None:
    assert abs(converter(10.0, 12)(u) - u) <= STEP / 2


@given(u=floats(allow_nan=False, allow_infinity=False), bits=integers(2, 24))
def test_the_range_is_kept_and_a_level_stays_itself(u: float, bits: int) -> None:
    convert = converter(10.0, bits)
    level = convert(u)
    assert -10.0 <= level <= 10.0 - 20.0 / 2**bits
    assert convert(level) == level
    assert converter(10.0, bits, saturation=False)(level) == level


@given(u=floats(allow_nan=False, allow_infinity=False))
def test_each_effect_can_be_switched_off(u: float) -> None:
    assert converter(10.0, 12, saturation=False, quantization=False)(u) == u
    assert converter(10.0, 12, quantization=False)(u) == min(max(u, -10.0), 10.0)
    assert abs(converter(10.0, 12, saturation=False)(u) - u) <= STEP / 2


CONVERTERS = [
    converter(10.0, 12, saturation=saturation, quantization=quantization)
    for saturation in (True, False)
    for quantization in (True, False)
]


@pytest.mark.parametrize("convert", CONVERTERS)
@pytest.mark.parametrize(
    "value",
    [
        nan,
        inf,
        -inf,
        "1.0",
        b"1",
        True,
        np.True_,
        None,
        [1.0],
        (1.0,),
        1j,
        10**400,
        Decimal(1),
        np.array([1.0, 2.0]),
        np.array([]),
        np.array([True]),
        np.array(["1"]),
        np.array([nan]),
        np.array([1.0], dtype=object),
        np.array([1j]),
        np.ma.masked,
        np.ma.array([1.0], mask=True),
        float,
    ],
    ids=repr,
)
def test_what_is_no_voltage_is_refused_with_its_value(convert: Any, value: Any) -> None:
    with pytest.raises(ContractError, match="must be one finite number in V") as refusal:
        convert(value)
    assert repr(value)[:20] in str(refusal.value)
    assert len(str(refusal.value)) < 400


@pytest.mark.parametrize("convert", CONVERTERS)
@pytest.mark.parametrize(
    "value",
    [
        1,
        1.0,
        np.float64(1),
        np.float32(1),
        np.int16(1),
        np.uint8(1),
        np.array(1.0),
        np.array([1.0]),
        np.array([[1]]),
        np.ma.array(1.0),
        Fraction(1),
    ],
    ids=repr,
)
def test_one_number_of_any_kind_is_a_voltage(convert: Any, value: Any) -> None:
    answer = convert(value)
    assert type(answer) is float
    assert answer == pytest.approx(1.0, abs=STEP)
    assert as_voltage(value) == 1.0


@given(position=floats(-1e6, 1e6))
def test_the_encoder_reads_the_nearest_count(position: float) -> None:
    measure = encoder(0.001)
    assert measure is not None
    measured = measure(position)
    assert measured == round(position / 0.001) * 0.001
    assert abs(measured - position) <= 0.0005 + 1e-9
    assert encoder(0.001, quantization=False) is None


@pytest.mark.parametrize("position", [nan, inf, -inf])
def test_a_model_that_diverged_is_named_by_the_encoder(position: float) -> None:
    measure = encoder(0.001)
    assert measure is not None
    with pytest.raises(ContractError, match=r"position became .*must stay finite"):
        measure(position)


@given(u=floats(-1e6, 1e6) | floats(allow_nan=False, allow_infinity=False), bits=integers(2, 24))
def test_what_compiled_loops_use_gives_the_same(u: float, bits: int) -> None:
    for saturation in (True, False):
        for quantization in (True, False):
            effects = {"saturation": saturation, "quantization": quantization}
            assert converted(u, *limits(10.0, bits, **effects)) == converter(10.0, bits, **effects)(u)
    if abs(u) <= 1e6:
        measure = encoder(0.01)
        assert measure is not None and counted(u, 0.01) == measure(u) and abs(counted(u, 0.01) - u) < 0.00501
    assert counted(u, 0.0) == u and encoder(0.01, quantization=False) is None


def test_without_saturation_the_levels_go_on() -> None:
    convert = converter(10.0, 12, saturation=False)
    assert [convert(u) for u in (12.3, -12.3, STEP * 2.6)] == [2519 * STEP, -2519 * STEP, 3 * STEP]
