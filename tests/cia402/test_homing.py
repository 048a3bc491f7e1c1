"""Homing by every method that the drive has."""

from __future__ import annotations

import pytest

from rds.bus.modules.cia402.codes import ENABLE_OPERATION, HALT, MODE_12, MODE_13, TARGET_REACHED, Mode, State
from rds.bus.modules.cia402.homing import METHODS
from rds.machines import Machine

from .conftest import Rig

DONE = TARGET_REACHED | MODE_12
START = ENABLE_OPERATION | 0x10


def near(rig: Rig, millimetres: float) -> None:
    """Put the axis there."""
    rig.drive.servo.axis.position = rig.drive.servo.axis._carriage = millimetres
    rig.wait(0.001)


def home(rig: Rig, method: int, offset: int = 0) -> float:
    """Returns where on the axis the home position is, mm."""
    rig.write(0x6098, method, 1)
    rig.write(0x607C, offset, 4)
    rig.nmt(1)
    rig.enable(Mode.HOMING)
    assert rig.read(0x6041) & (DONE | MODE_13) == TARGET_REACHED  # not started
    rig.write(0x6040, START, 2)
    for _ in range(4000):
        rig.wait(0.002)
        if rig.read(0x6041) & DONE == DONE:
            break
    assert rig.read(0x6041) & (DONE | MODE_13) == DONE
    assert rig.drive.state is State.OPERATION_ENABLED
    assert abs(rig.drive.servo.axis.velocity) < 1e-6, "it has ended at rest"
    return (rig.drive.servo.zero - offset) * 0.001


@pytest.mark.parametrize(
    "method, start, expected, tolerance",
    [
        (17, -74.5, -75.0, 0.02),
        (18, 74.5, 75.0, 0.02),
        (1, -74.5, -74.0, 0.001),  # the first pulse after the switch was left
        (2, 74.5, 75.0, 1.001),
        (33, 0.4, 0.0, 0.002),
        (34, 0.4, 1.0, 0.002),
        (35, 12.3, 12.3, 0.002),
        (37, 12.3, 12.3, 0.002),
    ],
)
def test_a_method_finds_its_home(rig: Rig, method: int, start: float, expected: float, tolerance: float) -> None:
    near(rig, start)
    assert home(rig, method) == pytest.approx(expected, abs=tolerance)


def test_every_method_of_the_eds_is_known(rig: Rig) -> None:
    assert {rig.read(0x60E3, place, True) for place in range(1, rig.read(0x60E3) + 1)} == set(METHODS)


def test_zero_is_home_plus_home_offset(rig: Rig) -> None:
    near(rig, 3.0)
    home(rig, 37, offset=1000)
    assert rig.read(0x6064, signed=True) == pytest.approx(-1000, abs=2)


def test_homing_without_a_method_is_an_error(rig: Rig) -> None:
    rig.write(0x6098, 0, 1)
    rig.nmt(1)
    rig.enable(Mode.HOMING)
    rig.write(0x6040, START, 2)
    assert rig.read(0x6041) & MODE_13


def test_halt_interrupts(rig: Rig) -> None:
    rig.write(0x6098, 34, 1)
    rig.nmt(1)
    rig.enable(Mode.HOMING)
    rig.write(0x6040, START, 2)
    rig.wait(0.1)
    assert rig.read(0x6041) & (DONE | MODE_13) == 0  # under way
    rig.write(0x6040, START | HALT, 2)
    rig.wait(0.5)
    assert rig.read(0x6041) & (DONE | MODE_13) == TARGET_REACHED  # interrupted
    assert rig.read(0x606C, signed=True) == 0


@pytest.mark.parametrize("axis", ["Y", "Z"])
def test_other_axes_find_their_switches(machine: Machine, axis: str) -> None:
    rig = Rig(machine, axis)
    low = machine.axis(axis).travel[0]
    near(rig, low + 0.5)
    assert home(rig, 17) == pytest.approx(low, abs=0.02)
