"""Multisine, chirp and staircase: the frequencies they hold, their peaks and derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, sampled_from

from rds.core.errors import InputError
from rds.references import chirp, make_signal, multisine, sample_voltage, staircase


@settings(max_examples=25)
@given(
    base=sampled_from([0.25, 0.5, 1.0]), first=integers(1, 9), count=integers(1, 40), lines=sampled_from(["all", "odd"])
)
def test_a_multisine_holds_its_lines_and_no_others(base: float, first: int, count: int, lines: str) -> None:
    signal = multisine(5.0, base, base * first, base * (first + count), lines)
    samples = round(1000 / base)
    u = sample_voltage(signal, 1e-3, samples)
    size = np.abs(np.fft.rfft(u)) * 2 / samples
    there = np.flatnonzero(size > 1e-9)
    expected = [k for k in range(first, first + count + 1) if lines == "all" or k % 2]
    assert there.tolist() == expected
    np.testing.assert_allclose(size[there], size[there][0], rtol=1e-9)
    assert np.abs(u).max() == pytest.approx(5.0, rel=0.02)
    assert np.abs(u).max() <= 5.0 * (1.0 + 1e-9)


def test_a_multisine_reaches_its_amplitude_and_no_more() -> None:
    fine = np.linspace(0.0, 1.0 / 1.5, 40001)
    assert np.abs(multisine(10.0, 1.5, 1.5, 16.5).value(fine)).max() == pytest.approx(10.0, rel=1e-6)


def test_a_multisine_s_voltage_is_the_position_of_its_motion_to_the_last_bit() -> None:
    signal, t = multisine(5.0, 0.5, 1.0, 20.0, offset=0.3), np.arange(3000) * 1e-3
    assert np.array_equal(signal.value(t), signal.motion(t)[0])


def test_schroeder_s_phases_keep_the_peak_low() -> None:
    u = sample_voltage(multisine(1.0, 0.5, 0.5, 40.0), 1e-3, 2000)
    assert np.abs(u).max() / np.sqrt(np.mean(u**2)) < 2.0  # equal phases: about 12


@settings(max_examples=25)
@given(low=floats(0.1, 5.0), more=floats(0.0, 30.0), sweep=floats(0.5, 10.0), kind=sampled_from(["chirp", "multisine"]))
def test_derivatives_belong_to_the_position(low: float, more: float, sweep: float, kind: str) -> None:
    signal = (
        chirp(2.0, low, low + more, sweep, 1.0) if kind == "chirp" else multisine(2.0, low, low, low + more, offset=1.0)
    )
    t = np.linspace(0.0, 2.5 * sweep, 2001)[1:] + 1e-5
    step = 1e-6
    before, here, after = (signal.reference(t + s) for s in (-step, 0.0, step))
    fast = 2.0 * np.pi * (low + more)
    slope = 2.0 * np.pi * more / sweep if kind == "chirp" else 0.0
    assert np.abs((after.position - before.position) / (2 * step) - here.velocity).max() < 1e-4 * 2.0 * fast + 1e-6
    second = (after.velocity - before.velocity) / (2 * step)
    at_corner = np.abs(np.mod(t + sweep / 2, sweep) - sweep / 2) < 2 * step
    assert np.abs(second - here.acceleration)[~at_corner].max() < 1e-3 * 2.0 * (fast**2 + slope) + 1e-6


def test_a_chirp_goes_up_and_down_through_its_band() -> None:
    signal = chirp(1.0, 1.0, 21.0, 10.0)
    t = np.arange(0, 40, 1e-4)
    rising = np.flatnonzero(np.diff(np.sign(signal.value(t))) > 0)
    frequency = 1.0 / np.diff(t[rising])
    middle = 0.5 * (t[rising][1:] + t[rising][:-1])
    expected = 21.0 - 20.0 * np.abs(np.mod(middle, 20.0) - 10.0) / 10.0
    slow = expected > 3.0  # below, the frequency changes much within one period
    np.testing.assert_allclose(frequency[slow], expected[slow], rtol=0.1)


def test_a_staircase_level_by_level() -> None:
    u = sample_voltage(staircase(4.0, 1.0, 2, offset=1.0), 0.125, 16)
    np.testing.assert_array_equal(u, [1, 3, 5, 3, 1, -1, -3, -1] * 2)
    with pytest.raises(InputError, match="whole number"):
        staircase(4.0, 1.0, 2.5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="half the sampling frequency"):
        sample_voltage(staircase(4.0, 100.0, 5), 1e-3, 100)


@pytest.mark.parametrize("lines, multiples", [("all", [4, 5, 6, 7, 8]), ("odd", [5, 7])])
def test_a_multisine_begins_and_ends_with_its_band(lines: str, multiples: list[int]) -> None:
    spectrum = np.abs(np.fft.rfft(multisine(1.0, 1.0, 3.9, 8.0, lines).value(np.arange(100) * 0.01)))
    assert np.flatnonzero(spectrum > 1e-6).tolist() == multiples


def test_what_will_not_do_is_refused() -> None:
    with pytest.raises(InputError, match="exchange them"):
        chirp(1.0, 5.0, 2.0, 1.0)
    with pytest.raises(InputError, match="0 odd multiples"):
        multisine(1.0, 1.0, 2.0, 2.5, "odd")
    with pytest.raises(InputError, match=r"1000 Hz is more than 1e\+06 times frequency = 1e-12 Hz; give a higher"):
        multisine(1.0, 1e-12, 1.0, 1e3)  # and the memory of no computer is filled
    with pytest.raises(InputError, match="half the sampling frequency"):
        sample_voltage(staircase(1.0, 1.0, 10**10), 1e-3, 10)
    with pytest.raises(InputError, match="lines = 'even'"):
        multisine(1.0, 1.0, 2.0, 20.0, "even")
    with pytest.raises(InputError, match="half the sampling frequency"):
        sample_voltage(multisine(1.0, 1.0, 2.0, 600.0), 1e-3, 1000)
    with pytest.raises(InputError, match="half the sampling frequency"):
        sample_voltage(make_signal("chirp", amplitude=1.0, lowest=1.0, highest=501.0, sweep=1.0), 1e-3, 1000)
