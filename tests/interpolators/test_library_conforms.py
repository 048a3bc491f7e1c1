"""Every interpolator of the library passes the check that users' interpolators have to pass."""

from __future__ import annotations

import pytest

from rds.checks import check_interpolator, clauses
from rds.interpolators import LIBRARY, interpolator_module, interpolator_names
from rds.interpolators.acceleration import make_acceleration, smooth


@pytest.mark.parametrize("name", interpolator_names())
def test_no_fault(name: str) -> None:
    report = check_interpolator(interpolator_module(name).interpolate, params={})
    # how long a call takes is said by a benchmark; at 0.01 mm, whole BLU are a tenth of the way in a sample
    known = {clauses.TIME} | ({clauses.VELOCITY} if name == "reference-pulse" else set())
    assert not [fault for fault in report.faults if fault.clause not in known], str(report)
    assert not [warning for warning in report.warnings if warning.clause not in known], str(report)


def test_whole_blu_of_a_micrometre_are_no_worth_a_warning() -> None:
    report = check_interpolator(interpolator_module("reference-pulse").interpolate, params={"blu": 0.001})
    assert not [warning for warning in report.warnings if warning.clause == clauses.VELOCITY], str(report)


@pytest.mark.parametrize("name", ["linear", "exponential", "s-shape"])
def test_filters_make_no_fault(name: str) -> None:
    method = interpolator_module("constant-velocity")

    def interpolate(segment, T, params):
        weights = make_acceleration(name).weights(T)
        yield from smooth(method.interpolate(segment, T, {}), segment.start, weights, T)

    report = check_interpolator(interpolate)
    faults = [fault for fault in report.faults if fault.clause not in (clauses.TIME, clauses.PATH)]
    assert not faults, str(report)


def test_each_name_has_options_and_says_where_it_is_from() -> None:
    for name, module in LIBRARY.modules.items():
        loaded = interpolator_module(name)
        assert set(getattr(loaded, "DEFAULTS", {})) == set(loaded.OPTIONS), module
        assert loaded.__doc__ and len(loaded.__doc__) > 60
