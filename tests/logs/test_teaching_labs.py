"""Logs as microcontrollers and teaching labs write them: what their short headings tell, and what they do not."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rds.core.errors import InputError
from rds.identification.logs.guess import draft
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table

T = 0.01 * np.arange(300)  # s
U, V = np.sin(3.0 * T), 200.0 * np.cos(3.0 * T)


def written(folder: Path, heading: str, columns: Sequence[np.ndarray]) -> Path:
    path = folder / "log.csv"
    rows = (",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    path.write_text(heading + "\n" + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("name", ["rpm", "RPM", "RPM_actual", "rpm measured", "motor_rpm"])
def test_a_heading_of_rpm_is_a_speed_with_its_unit(tmp_path: Path, name: str) -> None:
    (log,) = read_log(written(tmp_path, f"t_s,u_V,rpm_target,{name}", [T, U, V + 5.0, V]))
    assert log.units["position"] == "rev/min" and np.allclose(log.position, V, atol=1e-5)
    assert np.allclose(log.extra["reference"], V + 5.0, atol=1e-5)


@pytest.mark.parametrize("name", ["erpm", "max_rpm", "electrical_rpm", "theta_elec_rad"])
def test_what_is_electrical_or_a_bound_is_not_the_axis_s(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no column tells by its unit that it is the position"):
        read_log(written(tmp_path, f"t_s,u_V,{name}", [T, U, V]))


def test_the_angle_of_a_pendulum_is_not_the_position_of_its_cart(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "t_s,u_V,position_mm,theta_deg", [T, U, V, V + 900.0]))
    assert log.units["position"] == "mm" and np.allclose(log.position, V, atol=1e-5)
    (log,) = read_log(written(tmp_path, "t_s,u_V,theta_deg", [T, U, V]))
    assert log.units["position"] == "deg"


def test_the_speed_of_a_spindle_is_not_that_of_a_linear_axis(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "t_s,u_V,position_mm,spindle_rpm", [T, U, V, V + 900.0]))
    assert log.units["position"] == "mm" and "velocity" not in log.extra


def test_a_duty_cycle_is_drafted_as_the_command_without_a_unit(tmp_path: Path) -> None:
    """0 to 1, 100 or 255: a PWM says nothing of its unit, and a name that ends in pct does."""
    for name, unit in (("pwm", "?"), ("duty", "?"), ("control_pct", "pct")):
        path = written(tmp_path, f"time_ms,{name},rpm", [1e3 * T, U, V])
        (axis,) = tomllib.loads(draft(read_table(path)))["axis"].values()
        assert axis["command"] == {"column": name, "unit": unit}
        assert axis["velocity"] == {"column": "rpm", "unit": "rev/min"}


def test_commanded_places_and_speeds_of_a_control_are_references(tmp_path: Path) -> None:
    names = "X1_CommandPosition,X1_ActualPosition,X1_CommandVelocity,X1_ActualVelocity,X1_OutputVoltage"
    table = read_table(written(tmp_path, names, [V + 1.0, V, V + 2.0, V, U]))
    axis = tomllib.loads(draft(table))["axis"]["X1"]
    chosen = {quantity: about["column"] for quantity, about in axis.items()}
    assert chosen == {
        "command": "X1_OutputVoltage",
        "position": "X1_ActualPosition",
        "velocity": "X1_ActualVelocity",
        "reference": "X1_CommandPosition",
    }


def test_a_date_beside_the_time_since_the_start_leaves_no_doubt(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (
        f"{t:.3f},2025-10-24T15:32:{30 + int(t):02d}.{round(1e3 * t) % 1000:03d},{u:.6f},{v:.6f}"
        for t, u, v in zip(T + 7.0, U, V, strict=True)
    )
    path.write_text("time_s,iso_time,u_V,rpm\n" + "\n".join(rows).replace("T15:32:3", "T15:32:2") + "\n")
    (log,) = read_log(path)
    assert log.sample_period == pytest.approx(0.01) and np.allclose(log.position, V, atol=1e-5)
    with pytest.raises(InputError, match="t1_s, t2_s could each be the time"):
        read_log(written(tmp_path, "t1_s,t2_s,u_V,rpm", [T, 1.001 * T, U, V]))


def test_recordings_one_after_another_are_told(tmp_path: Path) -> None:
    path = written(tmp_path, "t_s,u_V,rpm", [np.tile(T, 4), np.tile(U, 4), np.tile(V, 4)])
    with pytest.raises(InputError, match="where 4 recordings stand one after another, put each into a file of its own"):
        read_log(path)


def test_a_reference_in_place_of_the_command_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "t_s,goal,speed", [T, V + 1.0, V])
    (tmp_path / "log.csv.map.toml").write_text(
        '[time]\ncolumn = "t_s"\n[axis.A]\ncommand = { column = "goal", unit = "deg/s" }\n'
        'velocity = { column = "speed", unit = "deg/s" }\n'
    )
    with pytest.raises(InputError, match="where a drive is told to go is its reference"):
        read_log(path)


def test_a_refusal_tells_what_of_a_mat_file_was_left_out(tmp_path: Path) -> None:
    cells = np.empty(2, dtype=object)
    cells[:] = [U, V]
    savemat(tmp_path / "log.mat", {"t": T, "runs": cells})
    with pytest.raises(InputError, match=r"left out.*runs"):
        read_log(tmp_path / "log.mat")


def test_a_voltage_beside_a_commanded_torque_may_be_the_supply_s(tmp_path: Path) -> None:
    """As a drive reports it: 36 V at its terminals, whatever it makes of them."""
    columns = [T, U, V, 0.0 * T + 36.0]
    with pytest.raises(InputError, match=r"torque cmd \[Nm\], voltage \[V\] could each be the command"):
        read_log(written(tmp_path, "time [s],torque cmd [Nm],position [deg],voltage [V]", columns))
    (axis,) = tomllib.loads(draft(read_table(tmp_path / "log.csv")))["axis"].values()
    assert axis["command"]["column"] == "torque cmd"
    (log,) = read_log(written(tmp_path, "time [s],torque cmd [Nm],position [deg],motor voltage [V]", columns))
    assert log.units["command"] == "V"


def test_a_position_that_may_be_in_metres_leaves_another_in_doubt(tmp_path: Path) -> None:
    """Of a cart with a pendulum: `_m` may be metres or `measured`, and the angle is not where the cart is."""
    with pytest.raises(InputError, match=r"pendulum_angle_rad \[rad\], cart_position_m could each be the position"):
        read_log(written(tmp_path, "time_s,cart_position_m,pendulum_angle_rad,motor_voltage_V", [T, V, U, U]))


def test_names_of_robots_joints_tell_what_is_desired_and_what_drives(tmp_path: Path) -> None:
    (log,) = read_log(written(tmp_path, "t [s],q_des [rad],q [rad],dq [rad/s],tau [Nm]", [T, U + 1.0, U, V, V]))
    assert np.allclose(log.position, np.degrees(U), atol=1e-3) and log.units["command"] == "Nm"
    (log,) = read_log(written(tmp_path, "time_s,position_rad,control_torque_nm", [T, U, V]))
    assert log.units["command"] == "Nm" and np.allclose(log.command, V, atol=1e-5)


def test_hertz_of_a_speed_are_told_what_they_may_be(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="revolutions in a second are 'rev/s', where they are the axis's and no elect"):
        read_log(written(tmp_path, "time [s],voltage [V],velocity [Hz]", [T, U, V]))
