"""Units and host in virtual time: the protocol of the thesis, and the gaps that were closed."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rds.bus.modules.dcs import commands, frames
from rds.bus.modules.dcs.frames import Info, Mode, Status
from rds.core.errors import MachineError

from .conftest import Bench

Maker = Callable[..., Bench]


def test_filling_a_buffer_takes_what_the_wire_takes(bench: Maker) -> None:
    b = bench()
    b.host.fill(2, bytes(1500), master=True, checked=False)
    # two bytes, the answer, 1500 bytes, the answer, and the firmware's turn-round twice
    assert b.port.now() == pytest.approx(1504 * 10 / 38_400 + 2 * commands.TURN_ROUND)


def test_three_axes_carry_their_buffers_out_together(bench: Maker) -> None:
    b = bench()
    b.host.fill(2, bytes([2] * 1500), master=True)
    b.host.fill(3, bytes([0x81] * 1500))
    b.host.fill(4, bytes([1] * 700).ljust(1500, b"\0"))
    begun = b.port.now()
    b.host.step_through(2)
    # each step: the host's byte, 10 ms, the master's answer
    assert b.port.now() - begun == pytest.approx(1500 * (0.01 + 2 * 10 / 38_400), rel=0.01)
    assert [b.host.inquire(unit).counts for unit in (2, 3, 4)] == [3000, -1500, 700]
    assert [b.position(unit) for unit in (2, 3, 4)] == pytest.approx([30.0, -15.0, 7.0], abs=1e-2)


def test_a_set_up_without_a_period_means_that_of_the_firmware(bench: Maker) -> None:
    b = bench()
    b.port.write(frames.encode(Info(Mode.SETUP), frames.setup_body(0.0, 1)))
    b.port.write(frames.encode(Info(Mode.INCREMENTS), frames.words([5])))
    b.port.sleep(b.port.now() + 0.1)
    assert b.position(2) == pytest.approx(0.05)


def test_data_for_another_unit_are_no_commands(bench: Maker) -> None:
    b = bench()
    b.host.fill(3, bytes([commands.HOME, 122] * 750))  # the firmware of unit 2 would go home
    b.port.sleep(b.port.now() + 0.1)
    report = b.host.inquire(2)
    assert report.counts == 0 and not report.status & Status.MOVING


def test_home_ends_at_the_switch_and_makes_lost_steps_good(bench: Maker) -> None:
    b = bench()
    b.host.home(4)
    report = b.host.inquire(4)
    assert report.counts == -5000 and report.status & Status.LIMIT
    assert b.position(4) == pytest.approx(-50.0, abs=0.1)


def test_a_jog_ends_with_stop_and_by_itself(bench: Maker) -> None:
    b = bench()
    b.host.jog(2, 5)
    b.port.sleep(b.port.now() + 0.2)
    b.host.stop_all()
    assert b.host.inquire(2).counts == pytest.approx(100, abs=10)
    before = b.host.inquire(3).counts
    b.host.jog(3, 5)
    b.port.sleep(b.port.now() + 10.0)  # nobody says stop: the cable is cut
    assert b.host.inquire(3).counts - before == pytest.approx(commands.MOST_STEPS / 127 * 250, abs=10)


def test_a_lost_answer_is_asked_for_again(bench: Maker) -> None:
    b = bench()
    b.line.cut = True
    b.port.write(b"")
    wake = b.port.now() + 0.05

    def mend(at: float, positions: list[float]) -> None:
        b.line.cut = at < wake

    b.line.watch, b.line.next_look = mend, 0.0
    assert b.host.inquire(2).counts == 0
    assert b.host.counters.retries == 1


def test_a_cut_cable_is_told_with_the_unit(bench: Maker) -> None:
    b = bench()
    b.line.cut = True
    with pytest.raises(MachineError, match=r"no answer from X \(unit 2\) on line serial to an inquiry; check power"):
        b.host.inquire(2)


def test_a_dead_master_ends_the_steps(bench: Maker) -> None:
    b = bench()
    b.host.fill(2, bytes([1] * 1500), master=True)
    b.host.fill(3, bytes([1] * 1500))

    def die(k: int) -> None:
        if k == 100:
            b.line.remove(2, b.port.now())

    with pytest.raises(MachineError, match=r"no answer from X \(unit 2\), the master of the steps"):
        b.host.step_through(2, die)
    assert not b.host.inquire(3).status & (Status.EXECUTING | Status.FILLED)
    assert b.host.inquire(3).counts < 110


def test_a_noisy_line_fills_buffers_whole(bench: Maker) -> None:
    b = bench(noise=2e-4, seed=3)
    for unit in (2, 3, 4):
        b.host.fill(unit, bytes(range(100)) * 15, master=unit == 2)
        found = b.line.unit(unit)
        assert found is not None and found._buffer == bytes(range(100)) * 15
    assert b.host.counters.damaged + b.host.counters.retries > 0
    assert b.line.down.damaged > 0


def test_a_wrong_baud_rate_is_not_understood(bench: Maker) -> None:
    b = bench()
    b.port.write(bytes([0xFF ^ byte for byte in (commands.INQUIRY, 122)]))
    assert b.port.read(0.1) == b""


def test_a_reset_forgets_everything(bench: Maker) -> None:
    b = bench()
    b.host.fill(2, bytes([1] * 1500))
    b.host.reset()
    report = b.host.inquire(2)
    assert report.status == Status.NOT_SET_UP and report.counts == 0
