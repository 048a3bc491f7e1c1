"""Metrics against numbers worked out by hand."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_results import make_result

from rds.results import Result, axis_metrics, metric_notes, metric_units
from rds.results.metrics import error_metrics, fit_percent


def of(error: list[float], period: float | None = None, **more: list[float]) -> Result:
    columns = {"time": np.arange(len(error)) * 0.1, "X_reference": error, "X_measured": np.zeros(len(error)), **more}
    return Result(columns, meta={"axes": ["X"], "sample_period": 0.1, "period": {"X": period}})


def test_the_six_errors_by_hand() -> None:
    """Errors 1, -2, 3, -4: mean -0.5, mean square 7.5; sizes 1, 2, 3, 4: mean 2.5, variance 1.25."""
    metrics = axis_metrics(of([1.0, -2.0, 3.0, -4.0]))["X"]
    assert metrics == pytest.approx(
        {
            "mean_error": -0.5,
            "std_error": math.sqrt(7.5 - 0.25),
            "mean_abs_error": 2.5,
            "std_abs_error": math.sqrt(1.25),
            "max_abs_error": 4.0,
            "rms_error": math.sqrt(7.5),
        }
    )
    assert all(type(value) is float for value in metrics.values())


def test_error_is_reference_minus_measured() -> None:
    result = of([1.0, 1.0], X_measured=[0.25, 0.25])
    assert result.metrics["X"]["mean_error"] == 0.75


def test_fit_by_hand() -> None:
    """y = 0, 3, 6 about its mean: ‖·‖² = 18; ŷ off by 1, 1, 0: ‖·‖² = 2; fit 100·(1 - 1/3)."""
    assert fit_percent(np.array([0.0, 3.0, 6.0]), np.array([1.0, 2.0, 6.0])) == pytest.approx(200 / 3)
    assert fit_percent(np.array([0.0, 3.0, 6.0]), np.array([0.0, 3.0, 6.0])) == 100.0
    assert fit_percent(np.array([0.0, 3.0, 6.0]), np.full(3, 3.0)) == pytest.approx(0.0)


@given(st.floats(-1e3, 1e3), st.integers(1, 50))
def test_a_measured_response_that_never_moves_has_no_fit(value: float, samples: int) -> None:
    assert fit_percent(np.full(samples, value), np.zeros(samples)) is None
    assert fit_percent(np.array([0.0, 1e-200]), np.zeros(2)) is None, "its square is no number above 0"


def test_the_first_period_is_left_out() -> None:
    """Period 0.3 s at 0.1 s: samples 0, 1, 2 go; 3·0.1 in floating point is a little more than 0.3 and stays."""
    result = of([9.0, 9.0, 9.0, 1.0, 1.0, 1.0], period=0.3)
    assert result.metrics["X"]["max_abs_error"] == 1.0
    assert metric_notes(result) == ["X: the metrics leave out the first period of the reference (0.3 s)."]


def test_of_a_part_program_only_its_motion_counts() -> None:
    """State 0 runs and 6 goes home; held (1) and over (7) it does not move."""
    result = of([1.0, 9.0, 1.0, 9.0, 1.0], period=0.2, program_state=[0, 1, 6, 7, 0])
    assert result.metrics["X"]["max_abs_error"] == 1.0
    assert metric_notes(result) == [
        "The metrics leave out 2 of 5 samples, in which the part program waited, dwelt or was held."
    ]


def test_a_run_with_nothing_to_compare_says_nothing_of_metrics() -> None:
    """A system test has a periodic voltage and a measured response: no metric, so none that leaves a period out."""
    time = 0.1 * np.arange(6)
    result = Result(
        {"time": time, "X_measured": time, "X_voltage": time},
        meta={"axes": ["X"], "sample_period": 0.1, "period": {"X": 0.3}},
    )
    assert result.metrics["X"] == {} and metric_notes(result) == []


@pytest.mark.parametrize("periods", [1, 2, 3, 7])
@pytest.mark.parametrize("T", [0.001, 0.0003, 1 / 3000])
def test_exactly_one_period_goes_whatever_the_rounding(periods: int, T: float) -> None:
    time = np.arange(600 * periods + 600) * T
    first = np.where(np.arange(len(time)) < 600, 9.0, 1.0)
    meta = {"axes": ["X"], "sample_period": T, "period": {"X": 600 * T}}
    result = Result({"time": time, "X_reference": first, "X_measured": 0 * time}, meta=meta)
    assert result.metrics["X"]["mean_error"] == 1.0


def test_a_run_of_one_period_is_used_whole_and_says_so() -> None:
    result = of([9.0, 1.0, 1.0], period=0.3)
    assert result.metrics["X"]["max_abs_error"] == 9.0
    assert result.notes == [
        "X: the run is not longer than one period of the reference (0.3 s): the metrics use all of it."
    ]
    assert "only 0.1 s of the second" in of([9.0, 1.0, 1.0, 1.0], period=0.3).notes[0]


def test_without_a_reference_there_is_no_tracking_error() -> None:
    meta = {"axes": ["X"], "sample_period": 0.1}
    columns = {"time": [0.0, 0.1], "X_voltage": [1.0, 1.0], "X_measured": [0.0, 1.0]}
    assert Result(columns, meta=meta).metrics == {"X": {}}
    assert Result({**columns, "X_modelled": [0.0, 1.0]}, meta=meta).metrics == {"X": {"fit_percent": 100.0}}
    unmeasured = {"time": [0.0, 0.1, 0.2], "X_reference": [0.0, 1.0, 0.0], "X_modelled": [0.0, 1.0, 0.0]}
    result = Result(unmeasured, meta={**meta, "period": {"X": 0.1}})
    assert result.metrics == {"X": {}} and metric_notes(result) == []


def test_metrics_are_json_without_nan() -> None:
    empty = of([], X_modelled=[])
    huge = of([1e200, -1e200], X_modelled=[1e308, -1e308])
    for result in (empty, huge, make_result("implementation", "XY")):
        json.dumps(result.metrics, allow_nan=False)
    assert set(empty.metrics["X"].values()) == {None}


def test_metrics_of_a_large_offset_keep_their_digits() -> None:
    """A population standard deviation from E[x²] - E[x]² would be garbage here."""
    assert error_metrics(1e6 + np.array([0.001, -0.001]))["std_error"] == pytest.approx(0.001, rel=1e-6)


def test_units_follow_the_axis() -> None:
    result = Result(
        {"time": [0.0], "S_reference": [1.0], "S_measured": [1.0]},
        {"S_measured": "rev/min"},
        {"axes": ["S"], "sample_period": 0.1},
    )
    assert metric_units(result, "S")["rms_error"] == "rev/min"
    assert metric_units(result, "S")["fit_percent"] == "%"
    assert result.units == {"time": "s", "S_reference": "mm", "S_measured": "rev/min"}


def test_the_surface_of_a_result(result: Result) -> None:
    assert result.mode == "implementation"
    assert result.axes == ["X"]
    assert len(result) == 10_000
    assert "X_measured" in result and "Y_measured" not in result
    with pytest.raises(KeyError, match="no column 'Y_measured'; the columns are time, X_reference"):
        result["Y_measured"]
    with pytest.raises(KeyError, match="no axis 'Y'; this result has X"):
        result.metrics["Y"]
    with pytest.raises(KeyError, match=r"no metric 'rms'; this result has mean_error, .*rms_error, fit_percent"):
        pickle.loads(pickle.dumps(result.metrics))["X"]["rms"]
    with pytest.raises(ValueError, match="read-only"):
        result["time"][0] = 1.0
    assert list(result.table.columns) == list(result)
    assert result.table.attrs["units"]["X_voltage"] == "V"
    assert "RMS error [mm]" in result._repr_html_()
    assert "<strong>met</strong>" in result._repr_html_()


def test_numbers_of_numpy_and_enums_become_plain() -> None:
    from rds.core.types import Ending, Verdict

    meta = {"axes": ("X",), "sample_period": np.float64(0.1), "ending": Ending.DONE, "verdict": Verdict.MET}
    result = Result({"time": [0, 1]}, meta=meta | {"worst": float("inf"), "counts": np.arange(2)})
    assert json.loads(json.dumps(result.meta, allow_nan=False)) == result.meta
    assert type(result.verdict) is str
    assert result.meta["worst"] is None
    assert result["time"].dtype == np.int64


def test_importing_results_is_light() -> None:
    heavy = "{'pandas', 'pyarrow', 'scipy', 'matplotlib', 'control', 'can', 'IPython'}"
    program = f"import sys, rds.results; sys.exit(str({heavy} & set(sys.modules)) if {heavy} & set(sys.modules) else 0)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_discarded_periods_do_not_shorten_a_run() -> None:
    """Samples 1, 2 and 5 after 5 s were discarded: the run is as long as with them, and time decides what is used."""
    time = 5.0 + np.array([0, 3, 4, 6, 7]) * 0.1
    meta = {"axes": ["X"], "sample_period": 0.1, "period": {"X": 0.4}}
    result = Result({"time": time, "X_reference": [9, 9, 1, 1, 1], "X_measured": [0.0] * 5}, meta=meta)
    assert result.length == pytest.approx(0.8)
    assert result.metrics["X"]["max_abs_error"] == 1.0
    assert "only" not in result.notes[0]
