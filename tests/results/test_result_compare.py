"""Saved results compared without running again."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from made_results import make_result

from rds.core.errors import InputError
from rds.results import Result, compare, open_result, save_all


def small(measured: list[float], T: float = 0.1, start: int = 0, axis: str = "X", **meta: object) -> Result:
    time = (np.arange(len(measured)) + start) * T
    return Result({"time": time, f"{axis}_measured": measured}, meta={"axes": [axis], "sample_period": T, **meta})


def test_a_result_is_identical_to_itself_reopened(tmp_path) -> None:  # type: ignore[no-untyped-def]
    result = make_result("implementation", "XY")
    save_all(result, tmp_path)
    comparison = compare(result, open_result(tmp_path))
    assert comparison.identical
    assert comparison.axes["X"].identical and comparison.axes["X"].first_difference is None
    assert comparison.axes["X"].max_difference == 0.0
    assert comparison.axes["X"].fit_percent == 100.0
    assert comparison.axes["Y"].same_controller is True
    assert "identical sample for sample" in str(comparison)


def test_differences_by_hand() -> None:
    """a = 0, 3, 6, 9 and b = 1, 2, 6: common samples 0..2; differences 1, -1, 0; fit 100·(1 - √(2/18))."""
    axis = compare(small([0.0, 3.0, 6.0, 9.0]), small([1.0, 2.0, 6.0])).axes["X"]
    assert axis.samples == 3
    assert axis.max_difference == 1.0
    assert axis.rms_difference == pytest.approx(np.sqrt(2 / 3))
    assert axis.fit_percent == pytest.approx(200 / 3)
    assert not axis.identical and axis.first_difference == 0.0
    assert axis.same_controller is None


def test_samples_are_matched_by_number_not_by_row() -> None:
    comparison = compare(small([0.0, 1.0, 2.0, 3.0]), small([2.0, 3.0, 4.0], start=2))
    assert comparison.axes["X"].samples == 2
    assert comparison.axes["X"].identical
    assert not comparison.identical  # each has samples that the other lacks
    longer = compare(small([0.0, 1.0]), small([0.0, 1.0, 2.0]))
    assert not longer.identical
    assert longer.notes == ("2 samples are common; the first result has 2, the second 3",)
    assert "2 samples are common; the first result has 4, the second 3" in comparison.notes
    time, difference = comparison.difference("X")
    assert time.tolist() == pytest.approx([0.2, 0.3])
    assert difference.tolist() == [0.0, 0.0]


def test_a_column_that_one_result_lacks_is_not_compared() -> None:
    more = {"X_voltage": [1.0, 2.0], "X_speed": [1.0, 2.0]}
    driven = Result(dict(small([0.0, 1.0]).columns) | more, meta=small([]).meta)
    for pair in ((driven, small([0.0, 1.0])), (small([0.0, 1.0]), driven)):
        assert compare(*pair).identical


def test_signals_are_compared_in_one_unit_only() -> None:
    def run(unit: str, *told: float) -> Result:
        columns = dict(small([0.0, 1.0]).columns) | {"X_speed": list(told)}
        return Result(columns, {"X_speed": unit}, small([]).meta)

    same, other = compare(run("mm/s", 0.0, 1.0), run("mm/s", 3.0, 5.0)), compare(run("mm/s", 0, 1), run("m/s", 3, 5))
    speed = same.axes["X"].signals["speed"]
    assert (speed.unit, speed.max_difference, speed.rms_difference) == ("mm/s", 4.0, pytest.approx(np.sqrt(12.5)))
    assert not same.identical and other.identical and other.axes["X"].signals == {}
    note = "X_speed is in 'mm/s' in the first result and in 'm/s' in the second: left out"
    assert note in other.notes and note not in same.notes


def test_one_bit_is_a_difference() -> None:
    a = make_result("simulation")
    columns = {name: values.copy() for name, values in a.columns.items()}
    columns["X_voltage"][1234] = np.nextafter(columns["X_voltage"][1234], np.inf)
    columns["X_reference"][2000] = np.nextafter(columns["X_reference"][2000], np.inf)
    axis = compare(a, Result(columns, a.units, a.meta)).axes["X"]
    assert not axis.identical
    assert axis.first_difference == pytest.approx(1.234)
    assert axis.differing_columns == ("X_reference", "X_voltage")
    assert axis.max_difference == 0.0


def test_contour_errors_are_those_of_the_motion() -> None:
    def run(states: list[int], *errors: float) -> Result:
        time = np.arange(3) * 0.1
        columns = {"time": time, "X_measured": time, "contour_error": list(errors), "program_state": states}
        return Result(columns, meta={"axes": ["X"], "sample_period": 0.1})

    found = compare(run([0, 0, 1], 3.0, 4.0, 99.0), run([0, 1, 6], 2.0, 99.0, 2.0)).contour
    assert found == {
        "largest contour error": (4.0, 2.0),
        "RMS contour error": (pytest.approx(np.sqrt(12.5)), pytest.approx(2.0)),
    }
    assert compare(run([0, 0, 1], 3.0, 4.0, 99.0), run([1, 1, 1], 2.0, 99.0, 2.0)).contour == {}


def test_controllers_are_told_apart() -> None:
    def run(sha: str | None, gain: float) -> Result:
        return make_result(seconds=0.1, controller={"X": {"name": "p", "sha256": sha, "params": {"Kp": gain}}})

    same = compare(run("a", 1.0), run("a", 2.0)).axes["X"]
    assert (same.same_controller, same.same_params) == (True, False)
    assert "the same, different parameters" in str(compare(run("a", 1.0), run("a", 2.0)))
    assert compare(run("a", 1.0), run("b", 1.0)).axes["X"].same_controller is False
    assert compare(run("a", 1.0), run(None, 1.0)).axes["X"].same_controller is None
    assert compare(run(None, 1.0), run(None, 1.0)).axes["X"].same_controller is True  # both the library's "p"


@pytest.mark.parametrize(
    "a, b, message",
    [
        (small([0.0, 1.0]), small([0.0, 1.0], T=0.2), "sample periods differ (0.1 s and 0.2 s)"),
        (small([0.0, 1.0]), small([0.0, 1.0], axis="Y"), "no common axis"),
        (small([0.0, 1.0]), small([0.0, 1.0], start=10), "no common samples: 0 to 0.1 s and 1 to 1.1 s"),
        (small([0.0, 1.0]), small([]), "no common samples"),
        (
            small([0.0, 1.0]),
            Result({"time": [0.0, 0.13], "X_measured": [0.0, 1.0]}, meta={"axes": ["X"], "sample_period": 0.1}),
            "the second result has a sample at 0.13 s, which is no multiple",
        ),
        (
            small([0.0, 1.0]),
            Result({"time": [0.0], "X_measured": [0.0]}, {"X_measured": "°"}, {"axes": ["X"], "sample_period": 0.1}),
            "in mm in the first result and in ° in the second",
        ),
    ],
)
def test_what_cannot_be_compared_is_refused(a: Result, b: Result, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        compare(a, b)


def test_the_comparison_shows_itself() -> None:
    comparison = make_result("simulation", "XY", error=0.02).compare(make_result("implementation", "X"))
    told = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert told["axes"]["X"]["unit"] == "mm"
    assert told["axes"]["X"]["metrics_b"]["fit_percent"] > 90
    assert told["a"]["mode"] == "simulation"
    assert "only in the first result: axis Y" in told["notes"]
    text = str(comparison)
    assert re.search(r"mean \|error\| \[mm\] +0\.0\d+ +0\.0\d+ +0\.00\d+", text), text
    assert "fit [%]" in text
    assert "<table>" in comparison._repr_html_()


def test_different_references_are_noted() -> None:
    a = make_result(seconds=1.0)
    columns = dict(a.columns) | {"X_reference": a["X_reference"] * 2}
    notes = compare(a, Result(columns, a.units, a.meta)).notes
    assert "X: the references differ, so the tracking errors answer different tasks" in notes
