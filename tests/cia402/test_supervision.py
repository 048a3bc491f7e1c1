"""Nothing leaves a voltage on an axis: a host, a SYNC or a command that stays away, injected faults."""

from __future__ import annotations

import pytest

from rds.bus.modules.cia402.codes import Mode, Nmt, State, error_register_bits, error_text
from rds.machines import Machine

from .conftest import Rig, T

HOST = 127


def push(rig: Rig, torque: int = 700) -> None:
    """Under 7 V in mode cst."""
    rig.ready(Mode.CYCLIC_TORQUE)
    for _ in range(20):
        rig.cycle(torque)
    assert rig.voltage == pytest.approx(torque * 0.01)


def test_a_command_older_than_two_periods_acts_no_more_and_after_ten_is_a_fault(rig: Rig) -> None:
    push(rig)
    last = rig.t
    cut = fault = None
    while rig.t - last < 0.02:
        rig.wait(0.0001, 0.0001)
        cut = cut or (rig.t if rig.voltage == 0.0 else None)
        fault = fault or (rig.t if rig.drive.state is State.FAULT else None)
    assert cut and fault
    assert cut - last == pytest.approx(2.5 * T + 0.0002, abs=0.00011)  # the axis's delay on top
    assert fault - last == pytest.approx(10.5 * T, abs=0.00011)
    assert rig.emergencies() == [0x8700] and rig.voltage == 0.0


def test_however_late_the_drive_wakes_its_voltage_was_cut_in_time(rig: Rig) -> None:
    push(rig)
    before = rig.drive.servo.position
    speed = rig.drive.servo.velocity
    rig.wait(5.0, 5.0)
    assert rig.drive.state is State.FAULT and rig.voltage == 0.0
    assert rig.drive.servo.position - before < speed * 0.02


def test_sync_without_commands_is_a_fault_too(rig: Rig) -> None:
    push(rig)
    for _ in range(15):
        rig.t += T
        rig.send(0x80)
    assert rig.emergencies() == [0x8250] and rig.voltage == 0.0


@pytest.mark.parametrize("phase", [0.05, 0.25, 0.45, 0.55, 0.75, 0.95])
def test_a_command_out_of_a_queue_moves_nothing_at_whatever_time_it_comes(rig: Rig, phase: float) -> None:
    """One command of 7 V comes beside those of zero volts, `phase` periods after a SYNC; theirs come at half of it."""
    push(rig, 0)
    late = rig.t + phase * T
    for _ in range(3):
        due = rig.t + T
        for at, torque in sorted([(due - 0.5 * T, 0), (late, 700)]):
            if at > rig.t:
                rig.t = at
                rig.send(0x200 + rig.node, rig.pack(0x0F, torque))
        rig.t = due
        rig.send(0x80)
        assert rig.voltage == 0.0
    assert rig.drive.state is State.FAULT and rig.emergencies() == [0x8150]


def test_one_lost_sync_between_two_commands_is_borne(rig: Rig) -> None:
    push(rig, 100)
    rig.t += 0.5 * T
    rig.send(0x200 + rig.node, rig.pack(0x0F, 101))
    rig.t += 0.5 * T  # its SYNC is lost
    rig.cycle(102)
    rig.cycle(103)
    assert rig.drive.state is State.OPERATION_ENABLED and not rig.emergencies()


@pytest.mark.parametrize(
    "order",
    ["1.9 S .05 C .1 C .05 S", "1 S .05 C .1 C .05 S", "1 S .05 C 1.05 C .05 S", "1.1 S 1 S .1 C .9 S .1 C .5 C .4 S"],
)
def test_a_host_that_was_late_is_not_taken_for_two(rig: Rig, order: str) -> None:
    """Its SYNC overtakes a command, which the next one follows within the same period: periods, SYNC or command."""
    push(rig, 100)
    torque = 100
    words = order.split()
    for after, frame in zip(words[::2], words[1::2], strict=True):
        rig.t += float(after) * T
        torque += frame == "C"
        rig.send(*((0x80, b"") if frame == "S" else (0x200 + rig.node, rig.pack(0x0F, torque))))
    assert rig.read(0x6071) == torque  # the newest is taken
    rig.cycle(103)
    assert rig.drive.state is State.OPERATION_ENABLED and not rig.emergencies()
    rig.send(0x200 + rig.node, rig.pack(0x0F, 700))  # of another host
    rig.cycle(105)
    assert rig.drive.state is State.FAULT and rig.emergencies() == [0x8150] and rig.voltage == 0.0


def test_one_lost_command_is_borne(rig: Rig) -> None:
    push(rig)
    rig.t += T
    rig.send(0x80)
    rig.cycle(700)
    assert rig.drive.state is State.OPERATION_ENABLED and rig.voltage == pytest.approx(7.0)


@pytest.mark.parametrize("mode", [Mode.CYCLIC_POSITION, Mode.CYCLIC_VELOCITY])
def test_sync_loss_in_the_other_cyclic_modes(rig: Rig, mode: Mode) -> None:
    rig.ready(mode)
    for k in range(100):
        rig.cycle(k * 5 if mode is Mode.CYCLIC_POSITION else 5000)
    rig.wait(0.05)
    assert rig.drive.state is State.FAULT and rig.emergencies() == [0x8700] and rig.voltage == 0.0


def watched(rig: Rig, option: int) -> None:
    """Moving in a mode that needs no SYNC, the host's heartbeat expected within 50 ms."""
    rig.write(0x6007, option, 2)
    rig.write(0x1016, HOST << 16 | 50, 4, 1)
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.write(0x60FF, 8000, 4)
    for _ in range(10):
        rig.send(0x700 + HOST, b"\x05")
        rig.wait(0.04)
    assert rig.drive.state is State.OPERATION_ENABLED and rig.voltage > 1.0


@pytest.mark.parametrize(
    "option, state",
    [
        (0, State.OPERATION_ENABLED),
        (1, State.FAULT),
        (2, State.SWITCH_ON_DISABLED),
        (3, State.SWITCH_ON_DISABLED),
    ],
)
def test_a_host_that_dies_is_treated_by_the_option_code(rig: Rig, option: int, state: State) -> None:
    watched(rig, option)
    rig.wait(0.3)
    assert rig.drive.state is state
    assert rig.emergencies() == [0x8130] and rig.read(0x1001) & 0x11 == 0x11
    assert (rig.voltage == 0.0) == (option != 0)
    assert rig.drive.nmt is Nmt.PRE_OPERATIONAL  # error behaviour 0x1029


def test_a_drive_that_lost_its_host_is_not_enabled_until_it_is_heard_again(rig: Rig) -> None:
    watched(rig, 2)
    rig.wait(0.3)
    for heard in (False, True):
        if heard:
            rig.send(0x700 + HOST, b"\x05")
        for word in (6, 7, 15):
            rig.write(0x6040, word, 2)
        assert (rig.drive.state is State.OPERATION_ENABLED) == heard


def test_a_new_host_that_is_to_be_watched_enables_it(rig: Rig) -> None:
    watched(rig, 2)
    rig.wait(0.3)
    rig.write(0x1016, HOST << 16 | 50, 4, 1)
    for word in (6, 7, 15):
        rig.write(0x6040, word, 2)
    assert rig.drive.state is State.OPERATION_ENABLED


def test_a_heartbeat_that_comes_back_clears_the_error(rig: Rig) -> None:
    watched(rig, 2)
    rig.wait(0.3)
    rig.send(0x700 + HOST, b"\x05")
    assert rig.emergencies() == [0x8130, 0]


def test_nobody_is_missed_before_the_first_heartbeat(rig: Rig) -> None:
    rig.write(0x1016, HOST << 16 | 50, 4, 1)
    rig.wait(1.0)
    assert not rig.emergencies()


def test_the_drives_own_heartbeat(rig: Rig) -> None:
    rig.write(0x1017, 20, 2)
    rig.nmt(1)
    rig.frames.clear()
    rig.wait(1.0)
    beats = [data for _, identifier, data in rig.frames if identifier == 0x700 + rig.node]
    assert len(beats) == 50 and set(beats) == {b"\x05"}


def test_stopping_the_node_takes_the_power_away(rig: Rig) -> None:
    push(rig)
    rig.nmt(2)
    assert rig.drive.state is State.FAULT and rig.voltage == 0.0


def test_resetting_the_node_takes_the_power_away(rig: Rig) -> None:
    push(rig)
    rig.nmt(129)
    assert rig.drive.state is State.SWITCH_ON_DISABLED and rig.voltage == 0.0
    assert rig.drive.nmt is Nmt.PRE_OPERATIONAL


@pytest.mark.parametrize("code", [0x2310, 0x3210, 0x4310, 0x7305, 0xFF00])
def test_an_injected_fault(rig: Rig, code: int) -> None:
    push(rig)
    rig.keep(rig.drive.fault(code, rig.t))
    assert rig.drive.state is State.FAULT and rig.voltage == 0.0
    assert rig.emergencies() == [code] and rig.read(0x603F) == code
    assert rig.read(0x1001) == error_register_bits(code)
    rig.cycle(700)
    assert rig.drive.state is State.FAULT


@pytest.mark.parametrize("reaction", [1, 2])
def test_a_fault_may_brake_before_the_power_goes(rig: Rig, reaction: int) -> None:
    rig.write(0x605E, reaction, 2)
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.write(0x60FF, 8000, 4)
    rig.wait(0.4)
    rig.keep(rig.drive.fault(0x4310, rig.t))
    assert rig.drive.state is State.FAULT_REACTION_ACTIVE
    rig.wait(0.2)
    assert rig.drive.state is State.FAULT and rig.voltage == 0.0 and rig.drive.servo.axis.velocity == 0.0


def test_a_reset_that_waits_for_the_emergency_button_resets_nothing(rig: Rig) -> None:
    rig.keep(rig.drive.set_emergency_input(True, rig.t))
    rig.write(0x6040, 0x00, 2)
    rig.write(0x6040, 0x80, 2)
    rig.keep(rig.drive.set_emergency_input(False, rig.t))
    rig.write(0x6040, 0x80, 2)
    assert rig.drive.state is State.FAULT
    rig.write(0x6040, 0x00, 2)
    rig.write(0x6040, 0x80, 2)
    assert rig.drive.state is State.SWITCH_ON_DISABLED


def test_the_history_keeps_the_last_eight(rig: Rig) -> None:
    for number in range(10):
        rig.keep(rig.drive.fault(0x2300 + number, rig.t))
    assert rig.read(0x1003, 0) == 8
    assert [rig.read(0x1003, place) for place in (1, 8)] == [0x2309, 0x2302]


def test_error_texts() -> None:
    assert error_text(0x8611) == "0x8611 following error"
    assert error_text(0x2311) == "0x2311 continuous over-current"
    assert error_text(0x23FF) == "0x23FF current, device output side"
    assert "unknown" in error_text(0xE123)


def test_a_drive_that_stands_without_power_needs_no_waking(rig: Rig, machine: Machine) -> None:
    assert rig.drive.expires is None
    assert rig.drive.receive(0x80, b"", rig.t + 3600.0) == []
