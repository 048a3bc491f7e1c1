"""What the data do not tell is no number like the others, and a fit of nothing else fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.fit.estimate import Parameter
from rds.identification.fit.estimate_json import parameter_rows
from rds.identification.fit.fit import fit
from rds.identification.fit.made_estimate import made_estimate
from rds.identification.fit.missing_options import missing_option, with_hint
from rds.identification.fit.problem import Problem
from rds.identification.fit.search import stands_at_bound
from rds.identification.fit.solve import least_squares
from rds.identification.fit.uncertainty import Uncertainty
from rds.identification.fit.unidentifiable import unidentifiable_by
from rds.identification.structures.structures import structure
from tests.validation.validation_logs import STEP, T, X, log, moved, square

AXIS = structure("axis")


def test_an_interval_wider_than_its_value_and_a_value_at_a_bound_are_marked() -> None:
    estimate = fit([log(square(3.0))], AXIS)
    parameters = dict(estimate.parameters) | {
        "friction_plus": Parameter(0.5, 0.3, -0.1, 1.1, "mm/s"),
        "friction_minus": Parameter(-3e-33, 0.1, 0.0, 0.2, "mm/s"),  # what a search leaves of 0
    }
    marked = replace(estimate, parameters=parameters, details={"at_bound": ["friction_minus"]})
    _, rows = parameter_rows(marked)
    shown = {row[0]: row[1] for row in rows}
    assert shown["friction_plus"] == "(0.5, poorly determined)" and shown["friction_minus"] == "(0, at its bound)"
    assert shown["K"].startswith("1.76") and estimate.details["at_bound"] == [] and not estimate.unusable()


def test_where_nothing_is_told_nothing_is_to_be_used() -> None:
    data = log(square(3.0))
    wide = np.diag([value**2 for value in X.values()])  # standard errors as large as the values
    (said,) = made_estimate(AXIS, "simulation", [data], X, wide, 100.0).unusable()
    assert "not one of them is told" in said
    wide[1, 1] = 1e-6  # but for the gain
    assert not made_estimate(AXIS, "simulation", [data], X, wide, 100.0).unusable()


def test_a_search_leaves_a_bound_at_which_it_only_stands_still() -> None:
    """From no friction backward, whose derivative says little, the fit still ends where the data say."""
    data = log(square(3.0))
    problem = Problem([data], AXIS, {})
    values = X | {"friction_minus": -2e-33}
    held = least_squares(
        Problem([data], AXIS, {"friction_minus": -2e-33}), problem.point(values, [(0.7, 0.0)])[[0, 1, 2, 4, 5]]
    )
    point = np.insert(held.point, 3, -2e-33)
    stuck = replace(held, point=point)
    assert stands_at_bound(problem, stuck, 3) and not stands_at_bound(problem, stuck, 2)
    found = fit([data], AXIS, "simulation", {"start": values})
    assert abs(found.values()["friction_minus"] / X["friction_minus"] - 1.0) < 0.02


def test_a_hint_ends_no_fit() -> None:
    """The motion comes after the part on which other options are tried, from a pulse on that moves nothing."""
    u = np.concatenate([np.zeros(12_000), square(4.0)])
    swaying = moved(u) + 0.05 * (u != 0.0) * np.sin(2 * np.pi * 0.3 * np.arange(len(u)) * T)  # what no structure has
    u[1] = 0.01
    late = log(u, np.rint(swaying / STEP) * STEP)
    estimate = fit([late], AXIS)
    with pytest.raises(InputError):
        missing_option(estimate, [late])
    assert with_hint(estimate, [late]) == estimate


@pytest.mark.parametrize(("second", "word"), [(1.0, "ratio"), (-1.0, "product")])
def test_two_that_come_only_together_are_told_with_what_is_known_of_them(second: float, word: str) -> None:
    made = structure("axis")
    values = dict.fromkeys(made.parameters, 1.0)
    names, change = list(values), np.array([1.0, second, 0.0, 0.0])
    told = Uncertainty(np.eye(4) * 1e-6, (), (change,), 1, 100.0, 0.1)
    (sentence,) = unidentifiable_by(made, names, values, told)
    assert sentence == f"tau and K come only as their {word}: these data cannot tell them apart"


def test_an_axis_without_friction_is_no_alarm_and_one_that_friction_pushes_is() -> None:
    def at_bound(start: float, **friction: float) -> tuple[list[str], list[str]]:
        u = square(2.0)
        estimate = fit([log(u, moved(u, X | friction, STEP, start))], AXIS)
        return estimate.details["at_bound"], [warning for warning in estimate.warnings if "bound" in warning]

    free = [at_bound(start, friction_plus=0.0, friction_minus=0.0) for start in (0.7, 0.70065)]
    assert [names for names, _ in free] == [["friction_minus"], ["friction_plus"]]
    assert not any(warnings for _, warnings in free)
    names, warnings = at_bound(0.7, friction_plus=-0.02, friction_minus=0.0)
    assert names == ["friction_plus"]
    assert warnings[0].startswith("friction_plus = 0 lies at its bound") and "ask for a value beyond it" in warnings[0]
