"""Acceleration filters: the tables of the thesis to the printed digit, and no distance lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interpolators.strategies import arcs, lines
from rds.core.errors import InputError
from rds.core.types import LineSegment, Segment
from rds.interpolators import interpolator_names
from rds.interpolators.acceleration import adder_output, make_acceleration, output_pulses, smooth
from rds.interpolators.interpolator import library_interpolator
from rds.interpolators.path import interpolate

# oacs-thesis, tables N30 and N31: eight samples of 5, adder output and output pulse at k = 1 ... 12
INPUT = [5] * 8
ADDER_N30 = [5, 10, 15, 20, 25, 25, 25, 25, 20, 15, 10, 5]
OUTPUT_N30 = [1, 2, 3, 4, 5, 5, 5, 5, 4, 3, 2, 1]
ADDER_N31 = [5, 15, 30, 40, 45, 45, 45, 45, 40, 30, 15, 5]
OUTPUT_N31 = ["0.56", "1.67", "3.33", "4.44", "5", "5", "5", "5", "4.44", "3.33", "1.67", "0.56"]
T = 0.01


def test_table_n30() -> None:
    assert adder_output(INPUT, [1] * 5).tolist() == ADDER_N30
    assert output_pulses(INPUT, [1] * 5).tolist() == OUTPUT_N30


def test_table_n31() -> None:
    assert adder_output(INPUT, [1, 2, 3, 2, 1]).tolist() == ADDER_N31
    printed = [f"{value:.2f}" for value in adder_output(INPUT, [1, 2, 3, 2, 1]) / 9]
    assert [text.removesuffix(".00") for text in printed] == OUTPUT_N31


@pytest.mark.parametrize(("multipliers", "output"), [((1,) * 5, OUTPUT_N30), ((1, 2, 3, 2, 1), OUTPUT_N31)])
def test_the_tables_through_the_filter_of_a_motion(multipliers: tuple[float, ...], output: list) -> None:
    weights = make_acceleration("s-shape", multipliers=multipliers).weights(1.0)
    rows = [(np.array([5.0 * k]), None, None) for k in range(1, 9)]
    found = list(smooth(rows, [0.0], weights, 1.0))
    assert [f"{row[1][0]:.2f}".removesuffix(".00") for row in found] == [str(value) for value in output]
    assert found[-1][0][0] == 40.0


@given(
    st.lists(st.integers(-1000, 1000), min_size=1, max_size=60),
    st.lists(st.integers(0, 20), min_size=1, max_size=30).filter(any),
)
def test_whole_pulses_are_conserved_exactly(pulses: list[int], multipliers: list[int]) -> None:
    out = output_pulses(pulses, multipliers)
    assert out.sum() == sum(pulses) and out.dtype == np.int64
    exact = np.cumsum(adder_output(pulses, multipliers)) / sum(multipliers)
    carried = np.cumsum(out) - exact
    assert carried.max() <= 1e-9 and carried.min() > -1.0  # less than a pulse is ever held back


FILTERS = st.one_of(
    st.builds(lambda t: make_acceleration("linear", time=t), st.floats(0.0, 0.5)),
    st.builds(lambda t: make_acceleration("exponential", time_constant=t), st.floats(0.001, 0.1)),
    st.builds(lambda t: make_acceleration("s-shape", time=t), st.floats(0.0, 0.5)),
    st.builds(
        lambda m: make_acceleration("s-shape", multipliers=m),
        st.lists(st.floats(0.0, 9.0), min_size=1, max_size=40).filter(lambda m: sum(m) > 0.1),
    ),
)
METHODS = [name for name in interpolator_names() if name not in ("linear", "circular", "euler")]


@settings(max_examples=40)
@given(segment=lines() | arcs(), filter_=FILTERS, name=st.sampled_from(METHODS))
def test_the_end_is_reached_exactly_by_every_method_and_filter(segment: Segment, filter_, name: str) -> None:
    method = library_interpolator(name)
    try:
        plain = method.rows(segment, T)
    except InputError:  # too fast for one BLU
        return
    weights = filter_.weights(T)
    rows = np.array(list(smooth(plain, segment.start, weights, T)))
    assert len(rows) == len(plain) + len(weights) - 1
    assert tuple(rows[-1, 0]) == segment.end
    assert np.allclose(np.array(segment.start) + rows[:, 1].sum(axis=0) * T, segment.end, atol=1e-8)
    assert np.allclose(rows[:, 2].sum(axis=0) * T, rows[-1, 1], atol=1e-7)
    top = np.abs(np.diff(np.vstack([[segment.start], plain[:, 0]]), axis=0)).max(axis=0) / T
    assert (np.abs(rows[:, 1]) <= top * (1 + 1e-6) + 1e-9).all()  # a mean is no faster than the fastest


@given(lines(), FILTERS)
def test_a_straight_move_stays_straight(segment: LineSegment, filter_) -> None:
    done = interpolate([segment], T, acceleration=filter_)
    assert done.path_error.max() < 1e-9 and done.chord_error.max() < 1e-9


def test_accelerations_are_those_of_the_formulas() -> None:
    line = LineSegment((0.0,), (10.0,), 10.0)

    def largest(name: str, **options: float) -> float:
        return float(interpolate([line], 1e-3, acceleration=make_acceleration(name, **options)).acceleration_rows.max())

    assert largest("linear", time=0.1) == pytest.approx(10.0 / 0.1)
    assert largest("s-shape", time=0.1) == pytest.approx(2 * 10.0 / 0.1, rel=0.02)
    assert largest("exponential", time_constant=0.1) == pytest.approx(10.0 / 0.1, rel=0.01)


def test_exact_stop_rests_at_each_corner_and_keeps_to_it() -> None:
    corner = [LineSegment((0.0, 0.0), (10.0, 0.0), 10.0), LineSegment((10.0, 0.0), (10.0, 10.0), 10.0)]
    filter_ = make_acceleration("s-shape", time=0.2)
    stopped = interpolate(corner, T, acceleration=filter_, exact_stop=True)
    rounded = interpolate(corner, T, acceleration=filter_)
    assert stopped.path_error.max() < 1e-9 and (stopped.position == (10.0, 0.0)).all(axis=1).any()
    assert rounded.samples == 200 + 19 and stopped.samples == 200 + 2 * 19
    assert 0.1 < rounded.path_error.max() < 10.0 * 0.2 / 2


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("wobble", {}, "there is no acceleration 'wobble'; known accelerations: linear, exponential, s-shape$"),
        ("linear", {"tim": 0.1}, "did you mean 'time'"),
        ("linear", {"time": -0.1}, "must be at least 0"),
        ("linear", {"multipliers": [1, 2]}, "has no multipliers, it has time; use s-shape"),
        ("s-shape", {"multipliers": [1, -2]}, "multiplier -2 must be a number of at least 0"),
        ("s-shape", {"multipliers": [0.0, 0.0]}, "sum up to 0"),
        ("s-shape", {"multipliers": [1], "time": 0.1}, "with multipliers has no option 'time'"),
    ],
)
def test_refusals(name: str, options: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make_acceleration(name, **options)


def test_a_filter_out_of_all_measure_is_refused() -> None:
    with pytest.raises(InputError, match=r"takes 1e\+07 samples"):
        make_acceleration("linear", time=1e4).weights(1e-3)
