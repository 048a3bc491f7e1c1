"""What tests of grading share: a pool of sandboxes, and submissions written down as text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rds.grading.sandbox import Pool, available

CONTROL = """
def control(t, r, y, state, params):
    return 1.0, state
"""
"""A controller that does nothing wrong: put behind an attack, it shows what is left of it."""


@pytest.fixture(scope="session")
def pool() -> Iterator[Pool]:
    """Warm interpreters for all tests; skipped, with the remedy, where the sandbox does not hold."""
    fault = available()
    if fault:
        pytest.skip(fault)
    with Pool() as made:
        yield made


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    """A file of a submission: its text, and a controller behind it unless told otherwise."""

    def write(text: str, ending: str = CONTROL, name: str = "submission.py") -> Path:
        path = tmp_path / name
        path.write_text(text + ending)
        return path

    return write
