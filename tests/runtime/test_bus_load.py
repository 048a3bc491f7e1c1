"""A bus that a run would overload is told before anything moves, with what would do."""

from __future__ import annotations

from typing import Any

import pytest

import rds
from rds.core.errors import InputError
from rds.modes.process.machine import check_load

WORDS: dict[str, Any] = {"duration": 1.0, "reference": rds.constant(0.0), "controller": {"name": "pid"}}


def plan(period: float, axis: str = "X") -> Any:
    return rds.Experiment(axis=axis, sample_period=period, **WORDS).plan()


@pytest.mark.parametrize(
    ("bus", "bitrate", "period", "said"),
    [
        # a command and four answers of 135 bits at most
        ({"interface": "rds"}, 250_000, 0.001, r"X, Y, Z, spindle take 270 % .*sample_period = 0.00338\), or 1000000"),
        ({"interface": "rds"}, 125_000, 0.004, r"take 135 % .*0.00675\), or 250000 bit/s"),
        ({"interface": "socketcan"}, 250_000, 0.001, r"command and answers of X take 108 %"),
        ({"interface": "rds"}, 125_000, 0.0002, r"would do \(sample_period = 0.00675\)$"),
    ],
)
def test_a_full_bus_is_refused_with_what_would_do(bus: dict[str, Any], bitrate: int, period: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        check_load(plan(period), bus, bitrate)


def test_a_nearly_full_bus_is_told_and_one_with_room_is_not(recwarn: pytest.WarningsRecorder) -> None:
    check_load(plan(0.001), {"interface": "rds"}, 1_000_000)
    check_load(plan(0.001), {"interface": "rds"}, 0)  # no bit timing: nothing is too much
    check_load(plan(0.001), {"interface": "rds"}, "fast")  # said by the interface
    assert not recwarn.list
    with pytest.warns(UserWarning, match="take 90 % of the bus at 500000 bit/s"):
        check_load(plan(0.0015), {"interface": "rds"}, 500_000)


@pytest.mark.realtime
def test_a_run_on_a_full_bus_does_not_begin(tmp_path: Any) -> None:
    bus = {"channel": "full", "bitrate": 125_000}
    with pytest.raises(rds.InputError, match="540 % of the bus at 125000 bit/s"):
        rds.Experiment(axis="X", mode="implementation", bus=bus, **WORDS).run(out=tmp_path / "run")
