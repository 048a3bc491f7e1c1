"""Analogue and PWM motors behind units: steps by the unit's own position loop, and voltages."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.bus.modules.dcs.build import make_line
from rds.bus.modules.dcs.motors import make_motor
from rds.core.errors import InputError
from rds.machines import load_machine

MACHINE = """
sample_period = 0.01
[axis.{name}]
node = 2
unit = "{unit}"
travel = [-50.0, 50.0]
resolution = 0.01
[axis.{name}.machine]
{machine}
[axis.{name}.module]
motor = "{motor}"
"""
DC = "tau = 0.02\nK = 3.0\nfriction_plus = 0.4\nfriction_minus = -0.4"


def write(folder: Path, motor: str, machine: str = DC, unit: str = "mm", name: str = "X") -> str:
    path = folder / "one.toml"
    path.write_text(MACHINE.format(motor=motor, machine=machine, unit=unit, name=name))
    return str(path)


@pytest.mark.parametrize("motor", ["analogue", "pwm"])
def test_a_servo_motor_follows_steps(tmp_path: Path, motor: str) -> None:
    axis = make_motor(load_machine(write(tmp_path, motor)).axis("X"), 0.0, 10.0)
    for k in range(100):
        axis.steps(5, 0.01 * k, 0.01)
    axis.advance(1.5)
    assert axis.counts(1.5) == pytest.approx(500, abs=2)
    axis.stop(1.5)
    assert axis.advance(2.0) == pytest.approx(5.0, abs=0.03) and not axis.moving


def test_a_pwm_output_has_255_levels(tmp_path: Path) -> None:
    axis = make_motor(load_machine(write(tmp_path, "pwm")).axis("X"), 0.0, 10.0)
    axis.voltage(5.0, 0.0)
    axis.advance(1.0)
    before = axis.advance(2.0)
    speed = axis.advance(3.0) - before
    assert speed == pytest.approx(3.0 * round(5.0 * 255 / 10) * 10 / 255 - 0.4, abs=1e-6)


def test_a_step_of_a_spindle_is_a_share_of_its_voltage() -> None:
    axis = make_motor(load_machine("starmill").axis("spindle"), 0.0, 10.0)
    axis.steps(-127, 0.0, 0.01)
    assert axis.advance(3.0) == pytest.approx(-2030.0, rel=0.02)  # rev/min: 204 a volt, less friction
    axis.steps(0, 3.0, 0.01)
    assert axis.advance(6.0) == 0.0 and not axis.moving


def test_what_no_unit_can_have_is_refused(tmp_path: Path) -> None:
    stepper = "K = 2.0\ntorque = 500.0\ncorner = 5.0\nno_torque = 20.0"
    with pytest.raises(InputError, match="is a spindle; a stepper makes steps"):
        make_line(load_machine(write(tmp_path, "stepper", stepper, "rev/min")))
    with pytest.raises(InputError, match=r"unknown .*tau|the stepper axis"):
        make_line(load_machine(write(tmp_path, "stepper")))
    with pytest.raises(InputError, match=r"drift = 'X' must be ppm by axis, as in X:50,Y:-30"):
        make_line(load_machine("starmill"), drift="X")
    with pytest.raises(InputError, match="baud = 10 must be a whole number from 300 to"):
        make_line(load_machine("starmill"), baud=10)
