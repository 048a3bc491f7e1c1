"""A command older than two sample periods, and commands outside the limits, act on nothing."""

from __future__ import annotations

import math

import pytest

from rds.bus.modules.dialects import open_drivers
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Kind, Status
from rds.bus.modules.rds.freshness import OLDEST, Freshness, Verdict
from rds.bus.modules.rds.module import AxisModule
from rds.core.errors import InputError
from rds.machines import load_machine

from .conftest import Bench, T, expect, tell

START = 100.0  # s
PERIOD = 0.001
VOLTS = frames.encode_voltages([8.0])


@pytest.mark.realtime
def test_a_command_that_waits_on_its_way_moves_nothing(bench: Bench) -> None:
    """One command of 6 V is held back for six periods; all others before and after it are of zero volts."""
    bench.serve()
    host = bench.host(0.0, *(["--patient"] if bench.dialect == "cia402" else []))
    expect(host, "moving")
    identifier = 0x200 + bench.node if bench.dialect == "cia402" else frames.COMMAND
    tell(host, f"6.0 {6 * T} {identifier}")
    if bench.dialect == "cia402":
        assert "CAN identifier collision" in expect(host, "lost")
    else:
        expect(host, "refused")
    assert bench.counts() == bench.start_counts


def module(set_up: bool = True) -> AxisModule:
    made = AxisModule(load_machine("mini-cnc").axis("X"), 0, PERIOD, START)
    if set_up:
        made.receive(frames.SETUP, frames.encode_setup(PERIOD), START)
    return made


def number(at: float) -> int:
    """As the host's clock says it."""
    return 1 + int(at * 2.0 / PERIOD + 1e-6) % frames.NUMBERS


def say(made: AxisModule, sent: float, came: float, data: bytes = VOLTS) -> Status | None:
    """The status in the answer to a command, None if it is refused."""
    answers = [
        frames.decode_answer(0, a)
        for a in made.receive(frames.COMMAND, frames.number_voltages(data, number(sent)), came)
    ]
    return next((Status(a.status) for a in answers if a.kind == Kind.ANSWER), None)


@pytest.mark.parametrize("late", [3.1, 5.0, 20.0, 60.0, 100.0])
def test_a_command_older_than_two_periods_is_refused(late: float) -> None:
    made, zero = module(), frames.encode_voltages([])
    for k in range(120):
        at = START + k * PERIOD
        say(made, at, at, zero)
    assert say(made, at + (0.5 - late) * PERIOD, at + 0.5 * PERIOD) is None
    assert say(made, at + PERIOD, at + PERIOD, zero) == Status.ENABLED | Status.REFUSED
    made.motion.advance(at + 5 * PERIOD)
    assert made.motion.position == 0.0


@pytest.mark.parametrize("late", [0.0, 0.9, 1.9])
def test_a_younger_one_is_obeyed(late: float) -> None:
    made = module()
    for k in range(10):
        at = START + k * PERIOD
        assert say(made, at, at) is not None
    assert say(made, at + (1.0 - late) * PERIOD, at + PERIOD) == Status.ENABLED


@pytest.mark.parametrize(
    "sent, came, verdict",
    [
        (12, 12.0, Verdict.FRESH),
        (12, 17.0, Verdict.FRESH),
        (12, 17.01, Verdict.OLD),
        (12, 31.0, Verdict.OLD),
        (12, 31.01, Verdict.FIRST),  # nothing was heard for ten periods
        (36, 12.0, Verdict.FRESH),  # the first ones may have been twelve periods late
        (37, 12.0, Verdict.STRANGE),
        (12, 12.0 + frames.NUMBERS, Verdict.FIRST),
    ],
)
def test_the_age_of_a_command_by_its_number(sent: int, came: float, verdict: Verdict) -> None:
    """A sample period of 1 s, instants in half periods as the numbers; those before were on time."""
    freshness = Freshness(1.0)
    assert freshness.judge(10, 5.0) == Verdict.FIRST and not freshness.followed(5.0)
    assert freshness.judge(11, 5.5) == Verdict.FRESH
    assert freshness.followed(15.5) and not freshness.followed(15.505)
    assert freshness.judge(sent, came / 2) == verdict
    assert freshness.followed(came / 2) == (verdict in (Verdict.FRESH, Verdict.OLD, Verdict.STRANGE))


def test_a_first_command_that_no_second_agrees_with_is_forgotten() -> None:
    freshness = Freshness(2.0)
    for number_, at in ((100, 10.0), (11, 11.0)):
        assert freshness.judge(number_, at) == Verdict.FIRST
    assert freshness.judge(12, 12.0) == Verdict.FRESH


def test_the_quickest_command_is_what_the_others_are_compared_with() -> None:
    """The first two were three half periods late; then one on time makes four more too old."""
    freshness = Freshness(2.0)
    assert freshness.judge(10, 13.0) == Verdict.FIRST and freshness.judge(11, 14.0) == Verdict.FRESH
    assert freshness.judge(12, 19.9) == Verdict.FRESH and freshness.judge(20, 20.0) == Verdict.FRESH
    assert freshness.judge(15, 20.5) == Verdict.OLD and freshness.judge(16, 20.9) == Verdict.FRESH


def test_a_command_acts_no_longer_than_two_and_a_half_periods() -> None:
    made = module()
    for k in range(2):
        say(made, START + k * PERIOD, START + k * PERIOD)
    at = START + PERIOD
    made.expire(at + (OLDEST - 0.01) * PERIOD)
    made.motion.advance(at + (OLDEST - 0.01) * PERIOD)
    assert made.motion.voltage == pytest.approx(8.0, abs=1e-3)
    made.expire(at + (OLDEST + 0.01) * PERIOD)
    assert made.motion.voltage == 0.0


def test_a_single_command_out_of_a_queue_long_after_its_time_moves_nothing() -> None:
    made = module()
    assert say(made, START - 30.0, START + 1.0) == Status.NONE
    made.expire(START + 2.0)
    made.motion.advance(START + 2.0)
    assert made.motion.position == 0.0


def test_a_module_without_set_up_stands() -> None:
    made = module(set_up=False)
    for k in range(5):
        status = say(made, START + k * PERIOD, START + k * PERIOD)
    assert status == Status.NOT_SET_UP and made.motion.voltage == 0.0


def test_nobody_changes_the_period_of_a_host_that_commands() -> None:
    """The watchdog counts in it: a period of an hour would leave the voltage there for ten."""
    made = module()
    for k in range(5):
        at = START + k * PERIOD
        say(made, at, at)
    made.receive(frames.SETUP, frames.encode_setup(1000.0), at)
    made.expire(at + 0.02)
    made.motion.advance(at + 0.02)
    assert made.motion.voltage == 0.0 and made.status == Status.WATCHDOG


def test_clocks_that_drift_apart_stay_friends() -> None:
    """200 ppm, more than two quartzes differ, for ten minutes."""
    fresh = Freshness(PERIOD)
    for k in range(600_000):
        verdict = fresh.judge(1 + int(k * 2.0 * 1.0002 + 0.5) % frames.NUMBERS, START + k * PERIOD)
        assert verdict is Verdict.FRESH or k == 0


@pytest.mark.parametrize("share", [1.0001, -1.0001, 1e8, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("dialect", ["rds", "oacs", "cia402"])
def test_voltages_outside_the_range_are_not_sent(dialect: str, share: float) -> None:
    machine = load_machine("mrmt-oacs" if dialect == "oacs" else "mini-cnc")
    most = machine.converter.range  # V
    bus = {"interface": "virtual", "channel": f"limits-{dialect}"}
    drivers = open_drivers(dialect, machine, ["X"], T, False, bus)
    try:
        with pytest.raises(InputError, match=f"must be from -{most:g} to {most:g}"):
            drivers.write([share * most])
    finally:
        drivers.close()


@pytest.mark.parametrize("mode, value", [("csp", 3e6), ("csv", 3e6), ("csp", math.nan), ("csv", math.inf)])
def test_positions_and_velocities_that_a_drive_cannot_say_are_not_sent(mode: str, value: float) -> None:
    bus = {"interface": "virtual", "channel": "limits-402", "cia402": {"mode": mode}}
    drivers = open_drivers("cia402", load_machine("mini-cnc"), ["X"], T, False, bus)
    try:
        with pytest.raises(InputError, match=r"X \(node 2\) must be from"):
            drivers.write([value])
    finally:
        drivers.close()
