"""Hostile models, interpolators and functions end with a reason, and what comes of them is plain and finite."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import pytest

from rds.core.types import LineSegment
from rds.grading.assignment.unit_tests import difference
from rds.grading.grade import Status
from rds.grading.sandbox import LoadedSubmission, Pool, SubmissionError
from tests.grading.attacks import INSIDE, SHORT, Attack
from tests.grading.attacks.other_kinds import FUNCTIONS, INTERPOLATORS, MODELS

Written = Callable[..., Path]
LIMITS = replace(SHORT, wall_seconds=6.0, call_seconds=0.6, load_seconds=2.0)
LINE = LineSegment(start=(0.0, 0.0), end=(1.0, 0.0), feed_rate=10.0)
MOST = 2000  # rows


def _model(subject: LoadedSubmission) -> list[Any]:
    return [subject.begin_model(), *(subject.advance(1.0) for _ in range(5))]


def _rows(subject: LoadedSubmission) -> list[Any]:
    return [value for row in subject.rows(LINE, 1e-3, {}, MOST) for part in row for value in part]


def _call(subject: LoadedSubmission) -> list[Any]:
    """A wrong answer is wrong, whatever it says of itself when it is compared."""
    answer = subject.call("f", [1.0])
    assert difference(answer, 1.5, 1e-9) and difference(answer, "right", 0.0)
    return []


KINDS: dict[str, tuple[dict[str, Attack], Callable[[LoadedSubmission], list[Any]]]] = {
    "model": (MODELS, _model),
    "interpolator": (INTERPOLATORS, _rows),
    "functions": (FUNCTIONS, _call),
}
CASES = [(kind, name) for kind, (attacks, _) in KINDS.items() for name in attacks]


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_every_kind_ends_with_a_reason(kind: str, name: str, pool: Pool, written: Written) -> None:
    attacks, use = KINDS[kind]
    attack = attacks[name]
    status, reason, answers = Status.OK, "", []
    try:
        with pool.open(written(INSIDE + attack.text, ""), LIMITS, kind) as subject:
            answers = use(subject)
    except SubmissionError as error:
        status, reason = error.status, error.reason
    assert (status, bool(reason)) == (attack.status, attack.status is not Status.OK), reason
    assert re.search(attack.said, reason), reason
    assert all(type(value) is float and isfinite(value) for value in answers)
