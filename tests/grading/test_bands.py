"""Bands, late penalties and seeds."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import assume, given
from hypothesis.strategies import floats, text

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.grading.assignment.assignment_file import LATE
from rds.grading.assignment.late_rules import LateRules, days_late, moved, read_late_rules
from rds.grading.assignment.seeds import part_seed, student_seed
from rds.grading.criteria.bands import Bands
from rds.grading.grade import Band

NUMBERS = floats(-1e6, 1e6)


@given(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
def test_a_better_value_never_earns_less(full: float, none: float, a: float, b: float) -> None:
    assume(abs(full - none) > 1e-6)
    bands = Bands(full, none)
    better, worse = (min(a, b), max(a, b)) if bands.more_is_worse else (max(a, b), min(a, b))
    assert 0.0 <= bands.share(worse) <= bands.share(better) <= 1.0


@pytest.mark.parametrize(
    "value, share, band",
    [(0.1, 1.0, Band.FULL), (0.2, 0.75, Band.PARTIAL), (0.4, 0.25, Band.PARTIAL), (0.5, 0.0, Band.NONE)],
)
def test_between_the_bounds_points_fall_in_a_straight_line(value: float, share: float, band: Band) -> None:
    bands = Bands(full=0.1, none=0.5)
    assert bands.share(value) == pytest.approx(share)
    assert bands.band(value) is band


def test_a_fixed_share_between_the_bounds() -> None:
    bands = Bands(full=45.0, none=20.0, partial=0.5)
    assert [bands.share(value) for value in (20.0, 20.1, 44.9, 45.0)] == [0.0, 0.5, 0.5, 1.0]


def test_no_number_earns_nothing() -> None:
    assert Bands(1.0, 2.0).share(float("nan")) == 0.0
    assert Bands(1.0, 2.0).share(float("inf")) == 0.0


@pytest.mark.parametrize(
    "hours, lost",
    [(0.0, 0.0), (1.0, 0.0), (1.01, 0.1), (24.0, 0.1), (24.1, 0.2), (100.0, 0.5), (168.0, 0.5), (169, 1.0)],
)
def test_each_day_that_has_begun_costs_up_to_the_cap(hours: float, lost: float) -> None:
    late = LateRules(percent_per_day=10.0, grace_hours=1.0, cap_percent=50.0, zero_after_days=7.0)
    assert late.lost(hours / 24.0) == pytest.approx(lost)


@pytest.mark.parametrize(
    "hours, left, spent, lost",
    [
        (1.0, None, 0, 0.0),
        (1.01, None, 1, 0.0),
        (48.0, None, 2, 0.0),
        (48.1, None, 2, 0.1),
        (72.0, 1, 1, 0.2),
        (72.0, 0, 0, 0.3),
        (168.0, 9, 2, 0.5),
        (168.1, None, 0, 1.0),  # nothing is left, so none is spent
    ],
)
def test_free_days_are_spent_where_they_help(hours: float, left: int | None, spent: int, lost: float) -> None:
    late = LateRules(percent_per_day=10.0, grace_hours=1.0, zero_after_days=7.0, free_days=2)
    assert (late.spent(hours / 24.0, left), late.lost(hours / 24.0, left)) == (spent, pytest.approx(lost))


def test_lateness_knows_time_zones() -> None:
    due = datetime(2026, 11, 30, 23, 59, tzinfo=timezone(timedelta(hours=1)))
    assert days_late(due, datetime(2026, 11, 30, 22, 59, tzinfo=UTC)) == 0.0
    assert days_late(due, datetime(2026, 12, 1, 10, 59, tzinfo=UTC)) == pytest.approx(0.5)
    assert days_late(None, due) == days_late(due, None) == 0.0


@pytest.mark.parametrize("minutes", [9, 18, 47, 60, 90])
def test_what_comes_in_to_the_second_costs_no_day(minutes: int) -> None:
    due = datetime(2026, 11, 30, 23, 59, tzinfo=UTC)
    late = LateRules(percent_per_day=10.0, grace_hours=minutes / 60)
    end = due + timedelta(minutes=minutes)
    assert late.lost(days_late(due, end)) == 0.0 and late.lost(days_late(due, end + timedelta(seconds=1))) == 0.1


@pytest.mark.parametrize("extension", [0.1, 1.2, 3.4, 7.3])
def test_an_extension_ends_to_the_second(extension: float) -> None:
    due = datetime(2026, 11, 30, 23, 59, tzinfo=UTC)
    days = moved(days_late(due, due + timedelta(days=1 + extension)), extension)
    late = LateRules(percent_per_day=10.0)
    assert days == 1.0 and late.lost(days) == late.lost(1e-6) == 0.1


def test_a_late_table_is_read_strictly() -> None:
    late = read_late_rules(TomlTable({"percent_per_day": 5, "free_days": 2}, LATE))
    assert late == LateRules(percent_per_day=5.0, free_days=2)
    assert read_late_rules(TomlTable(dict(late.to_table()), LATE)) == late and "zero_after_days" not in late.to_table()
    with pytest.raises(InputError, match="did you mean 'percent_per_day'"):
        read_late_rules(TomlTable({"percent_a_day": 5}, LATE))
    with pytest.raises(InputError, match="from 0 to 100"):
        read_late_rules(TomlTable({"percent_per_day": 500}, LATE))


def test_the_seed_of_a_student_is_written_down_here() -> None:
    """The same on every computer and in every version: whoever changes this changes everybody's plants."""
    assert student_seed("not told to anybody", "ada") == SEED
    assert part_seed(1, "a", "bc") != part_seed(1, "ab", "c")


@given(text(), text())
def test_students_and_secrets_have_seeds_of_their_own(a: str, b: str) -> None:
    assume(a != b)
    assert student_seed("secret", a) != student_seed("secret", b)
    assert student_seed(a, "ada") != student_seed(b, "ada")
    assert 0 <= student_seed("secret", a) < 1 << 63


SEED = 3961030686922636105
