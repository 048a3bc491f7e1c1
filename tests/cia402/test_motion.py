"""Modes on the axis: tracking, profiles, stops, limits and the following error."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from rds.bus.modules.cia402.codes import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    INTERNAL_LIMIT,
    MODE_12,
    MODE_13,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    TARGET_REACHED,
    Mode,
    State,
)
from rds.bus.modules.rds.module import machine_parameters
from rds.machines import Machine
from rds.models.machine_axis import MachineAxis

from .conftest import Rig, T

SINE = 2 * pi * 0.5  # 1/s
AMPLITUDE = 3000  # counts


def test_csp_follows_a_sine_within_a_few_counts(rig: Rig) -> None:
    rig.ready(Mode.CYCLIC_POSITION)
    targets, positions = [], []
    for k in range(3000):
        targets.append(round(AMPLITUDE * sin(SINE * k * T)))
        positions.append(rig.cycle(targets[-1])[1])
    # the drive is at a target one period after the SYNC that made it act
    errors = [abs(position - target) for position, target in zip(positions[101:], targets[100:], strict=False)]
    assert max(errors) <= 8
    assert not rig.emergencies()


def test_csv_follows_a_velocity(rig: Rig) -> None:
    rig.ready(Mode.CYCLIC_VELOCITY)
    position = [rig.cycle(round(AMPLITUDE * SINE * cos(SINE * k * T)))[1] for k in range(2001)]
    assert max(position) == pytest.approx(AMPLITUDE, rel=0.03)
    assert position[2000] == pytest.approx(position[0], abs=0.03 * AMPLITUDE)


def test_cst_is_the_axis_at_the_same_voltages(rig: Rig, machine: Machine) -> None:
    """Sample for sample the axis of our own modules, so that one controller file drives both."""
    rig.ready(Mode.CYCLIC_TORQUE)
    axis = MachineAxis(machine_parameters(machine.axis("X")), rig.t)
    for k in range(1000):
        torque = round(400 * sin(2 * pi * 2.0 * k * T))
        _, position = rig.cycle(torque)
        assert abs(position - axis.advance(rig.t) / 0.001) <= 1.0
        axis.command(torque * 0.01, rig.t)
    assert rig.read(0x6077, signed=True) == pytest.approx(round(axis.voltage * 100), abs=1)


def test_pp_reaches_its_target_and_keeps_its_limits(rig: Rig) -> None:
    rig.nmt(1)
    rig.enable(Mode.PROFILE_POSITION)
    rig.write(0x607A, 4000, 4)
    rig.write(0x6040, ENABLE_OPERATION | 0x10, 2)
    assert rig.read(0x6041) & MODE_12  # set-point acknowledged
    fastest = 0
    for _ in range(1500):
        rig.wait(0.001)
        fastest = max(fastest, rig.read(0x606B, signed=True))
    assert rig.read(0x6064, signed=True) == pytest.approx(4000, abs=10)
    assert rig.read(0x6041) & TARGET_REACHED
    assert 4900 <= fastest <= 5000
    rig.write(0x6040, ENABLE_OPERATION, 2)
    assert not rig.read(0x6041) & MODE_12


def test_pp_takes_a_second_target_after_the_first_or_at_once(rig: Rig) -> None:
    rig.nmt(1)
    rig.enable(Mode.PROFILE_POSITION)
    for target in (2000, 1000):
        rig.write(0x607A, target, 4)
        rig.write(0x6040, ENABLE_OPERATION | 0x10, 2)
        rig.write(0x6040, ENABLE_OPERATION, 2)
    assert rig.read(0x6041) & MODE_12  # the second waits
    highest = 0
    for _ in range(150):
        rig.wait(0.01)
        highest = max(highest, rig.read(0x6064, signed=True))
    assert highest >= 1990 and rig.read(0x6064, signed=True) == pytest.approx(1000, abs=10)
    rig.write(0x607A, -500, 4)
    rig.write(0x6040, ENABLE_OPERATION | 0x70, 2)  # at once, relative
    rig.wait(1.0)
    assert rig.read(0x6064, signed=True) == pytest.approx(500, abs=10)


def test_pv_reaches_its_speed_and_halts(rig: Rig) -> None:
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.wait(0.02)
    assert rig.read(0x6041) & MODE_12  # speed is zero
    rig.write(0x60FF, -6000, 4)
    rig.wait(0.5)
    assert rig.read(0x6041) & (TARGET_REACHED | MODE_12) == TARGET_REACHED
    assert rig.read(0x606C, signed=True) == pytest.approx(-6000, abs=200)
    rig.write(0x6040, ENABLE_OPERATION | 0x100, 2)
    rig.wait(0.5)
    assert abs(rig.read(0x606C, signed=True)) <= 50


def test_a_following_error_is_a_fault_after_its_time_and_is_reset(rig: Rig) -> None:
    rig.write(0x6065, 300, 4)
    rig.write(0x6066, 20, 2)
    rig.ready(Mode.CYCLIC_POSITION)
    rig.cycle(0)
    started = rig.t
    outside = False
    while rig.drive.state is State.OPERATION_ENABLED:
        status, _ = rig.cycle(5000)  # a jump that no axis can make
        outside = outside or bool(status & MODE_13)
        assert rig.t - started < 0.1
    assert 0.02 <= rig.t - started <= 0.025
    assert rig.emergencies() == [0x8611] and rig.read(0x603F) == 0x8611
    assert rig.read(0x1003, 0) == 1 and rig.read(0x1003, 1) == 0x8611
    assert rig.read(0x1001) & 0x21 == 0x21
    rig.wait(0.01)
    assert rig.voltage == 0.0
    rig.write(0x6040, 0x00, 2)
    rig.write(0x6040, 0x80, 2)
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert rig.emergencies() == [0x8611, 0x0000] and rig.read(0x603F) == 0 and rig.read(0x1001) == 0
    assert rig.read(0x1003, 0) == 1  # the history stays until 0 is written
    rig.write(0x1003, 0, 1)
    assert rig.read(0x1003, 0) == 0 and outside


def test_a_following_error_within_its_time_is_none(rig: Rig) -> None:
    rig.write(0x6065, 100, 4)
    rig.write(0x6066, 200, 2)
    rig.ready(Mode.CYCLIC_POSITION)
    for _ in range(500):
        rig.cycle(800)
    assert rig.drive.state is State.OPERATION_ENABLED


def test_targets_stay_within_the_software_limits(rig: Rig) -> None:
    rig.write(0x607D, -500, 4, 1)
    rig.write(0x607D, 500, 4, 2)
    rig.write(0x6065, 0xFFFFFFFF, 4)
    rig.ready(Mode.CYCLIC_POSITION)
    for k in range(800):
        status, position = rig.cycle(min(k * 3, 1500))
    assert position == pytest.approx(500, abs=10) and status & INTERNAL_LIMIT


def test_torque_past_a_software_limit_is_a_fault(rig: Rig) -> None:
    rig.write(0x607D, 300, 4, 2)
    rig.ready(Mode.CYCLIC_TORQUE)
    while rig.drive.state is State.OPERATION_ENABLED:
        rig.cycle(500)
    rig.wait(0.001)
    assert rig.emergencies() == [0x8612] and rig.voltage == 0.0


def test_a_limit_switch_is_a_fault_and_the_way_back_is_free(rig: Rig) -> None:
    rig.ready(Mode.CYCLIC_TORQUE)
    rig.drive.servo.axis.position = rig.drive.servo.axis._carriage = 74.9  # mm; the switch is at 75
    while rig.drive.state is State.OPERATION_ENABLED:
        rig.cycle(500)
    assert rig.emergencies() == [0xFF02] and rig.read(0x60FD) & 2
    rig.wait(0.2)
    rig.cycle(0, 0x00)
    rig.cycle(0, 0x80)
    for word in (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION):
        rig.cycle(0, word)
    for _ in range(50):
        rig.cycle(500)  # further in: not allowed
    assert rig.voltage == 0.0 and rig.drive.state is State.OPERATION_ENABLED
    for _ in range(500):
        rig.cycle(-500)
    assert not rig.read(0x60FD) & 2 and rig.drive.state is State.OPERATION_ENABLED


@pytest.mark.parametrize(
    "option, ends_in, longest",
    [(0, State.SWITCH_ON_DISABLED, 0.0), (2, State.SWITCH_ON_DISABLED, 0.1), (6, State.QUICK_STOP_ACTIVE, 0.1)],
)
def test_quick_stop_by_its_option_code(rig: Rig, option: int, ends_in: State, longest: float) -> None:
    rig.write(0x605A, option, 2)
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.write(0x60FF, 8000, 4)
    rig.wait(0.4)
    rig.write(0x6040, QUICK_STOP, 2)
    assert rig.drive.state is (State.QUICK_STOP_ACTIVE if option else State.SWITCH_ON_DISABLED)
    rig.wait(longest)
    assert rig.state() is ends_in
    rig.wait(0.2)
    assert abs(rig.read(0x606C, signed=True)) <= 5
    if option == 6:
        rig.write(0x6040, ENABLE_OPERATION, 2)
        assert rig.state() is State.OPERATION_ENABLED
    else:
        assert rig.voltage == 0.0


def test_disabling_operation_brakes_first(rig: Rig) -> None:
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.write(0x60FF, 8000, 4)
    rig.wait(0.4)
    rig.write(0x6040, SWITCH_ON, 2)
    assert rig.state() is State.OPERATION_ENABLED
    rig.write(0x6040, SWITCH_ON, 2)  # a host sends it every cycle
    assert rig.state() is State.OPERATION_ENABLED
    rig.wait(0.3)
    assert rig.state() is State.SWITCHED_ON and rig.voltage == 0.0


@pytest.mark.parametrize("fault, state", [(False, State.SWITCH_ON_DISABLED), (True, State.FAULT)])
def test_a_stop_while_operation_is_disabled_is_not_taken_back(rig: Rig, fault: bool, state: State) -> None:
    rig.write(0x605E, 2, 2)
    rig.nmt(1)
    rig.enable(Mode.PROFILE_VELOCITY)
    rig.write(0x60FF, 8000, 4)
    rig.wait(0.4)
    rig.write(0x6040, SWITCH_ON, 2)
    if fault:
        rig.keep(rig.drive.fault(0x4310, rig.t))
    else:
        rig.write(0x6040, QUICK_STOP, 2)
    rig.write(0x6040, ENABLE_OPERATION, 2)
    rig.wait(0.3)
    assert rig.drive.state is state and rig.voltage == 0.0


@pytest.mark.parametrize("word, state", [(DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED), (SHUTDOWN, State.READY)])
def test_without_power_there_is_no_voltage(rig: Rig, word: int, state: State) -> None:
    rig.ready(Mode.CYCLIC_TORQUE)
    for _ in range(20):
        rig.cycle(700)
    assert rig.voltage == pytest.approx(7.0)
    rig.cycle(700, word)
    assert rig.drive.state is state and rig.voltage == 0.0
    for _ in range(20):
        rig.cycle(700, word)
    assert rig.voltage == 0.0


def test_max_torque_limits_the_voltage(rig: Rig) -> None:
    rig.write(0x6072, 250, 2)
    rig.ready(Mode.CYCLIC_TORQUE)
    for _ in range(5):
        status, _ = rig.cycle(700)
    assert rig.voltage == pytest.approx(2.5) and status & INTERNAL_LIMIT


def test_a_change_of_mode_under_power_stands_still(rig: Rig) -> None:
    rig.ready(Mode.CYCLIC_POSITION)
    for _ in range(50):
        rig.cycle(0)
    rig.write(0x6060, Mode.CYCLIC_VELOCITY, 1)
    assert rig.read(0x6061) == Mode.CYCLIC_VELOCITY
    assert rig.drive.state is State.OPERATION_ENABLED


def test_the_current_limit_bounds_the_voltage_above_the_back_emf(rig: Rig) -> None:
    """What accelerates the axis is K times it over τ: from rest at most limit · K/τ."""
    rig.write(0x60FF, 0, 4)
    servo = rig.drive.servo
    servo.current_limit = 0.8
    rig.ready(Mode.CYCLIC_VELOCITY)
    for _ in range(60):
        rig.cycle(5000)
        emf = servo.axis.velocity * servo._emf
        assert abs(servo.axis.voltage - emf) <= 0.8 + 0.1  # the speed changes between two instants of the loop
    assert servo.velocity > 0.0
