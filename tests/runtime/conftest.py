"""Runs with students' functions that behave in known ways."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import rds


@pytest.fixture
def experiment(alone: Path) -> Callable[..., rds.Experiment]:
    """One axis at 1 kHz after a sinusoid, under the given controller."""

    def maker(control: Any = None, **options: Any) -> rds.Experiment:
        controller = {"name": "p"} if control is None else control
        settings: dict[str, Any] = {"duration": 2.0, "reference": rds.sinusoid(2.0, 1.0), "controller": controller}
        return rds.Experiment(**(settings | options))

    return maker


@pytest.fixture
def during(alone: Path) -> Callable[[Callable[[], Any], int], Callable[[int, int], None]]:
    """A progress function that does something once, when so many samples have been taken."""

    def maker(action: Callable[[], Any], at: int = 200) -> Callable[[int, int], None]:
        done = []

        def progress(samples: int, of: int) -> None:
            if samples >= at and not done:
                done.append(samples)
                action()

        return progress

    return maker
