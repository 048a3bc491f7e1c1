"""A machine of five axes in every mode: two frames with voltages, one tick."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from lost_machines import unless_lost

import rds
from rds.results import Result

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("alone")]

AXES = ("X", "Y", "Z", "A", "C")


@cache
def ran(mode: str) -> Result:
    """All five axes of the mill, each with a movement of its own."""
    movements = {name: {"reference": rds.sinusoid(1.0 + k, 1.0)} for k, name in enumerate(AXES)}
    experiment = rds.Experiment(
        machine="xyzac",
        axis=AXES,
        reference=rds.sinusoid(1.0, 1.0),
        controller={"name": "pid"},
        duration=0.6,
        sample_period=0.004,
        overrides=movements,
        mode=mode,
    )
    return unless_lost(experiment.run)


def measured(mode: str) -> np.ndarray:
    """Measured positions (samples, axes), mm and degrees."""
    return np.column_stack([ran(mode)[f"{axis}_measured"] for axis in AXES])


def test_emulation_repeats_simulation() -> None:
    assert np.array_equal(measured("emulation"), measured("simulation"))


def test_all_five_move_on_the_machine() -> None:
    ran.cache_clear()  # a try that the computer held up is made again
    result = ran("implementation")
    assert result.meta["ending"] == "done"
    moved, meant = measured("implementation"), measured("simulation")
    assert np.ptp(meant, axis=0).min() > 0.5
    assert abs(moved - meant).max(axis=0) == pytest.approx(np.zeros(5), abs=0.3)
