"""Drives that close loops of their own, led by an experiment or a part program: csp, csv and pp."""

from __future__ import annotations

from math import exp, inf, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds import Controller, Experiment, PartProgram
from rds.core.errors import ContractError, InputError
from rds.models import library_model
from rds.models.position_drive import settle
from rds.modes.loop.commands import Command, limiter

SINE = {"kind": "sinusoid", "amplitude": 2.0, "frequency": 0.5}
PATIENT = [[0x2000, 1, 200], [0x2000, 2, 250]]  # a busy computer ends no run here


def experiment(mode: str, reference: dict[str, Any] = SINE, **more: Any) -> Experiment:
    words: dict[str, Any] = {"machine": "mini-cnc", "axis": "X", "duration": 2.0, "reference": reference}
    bus = {"dialect": "cia402", "cia402": {"mode": mode, "axis": {"X": {"write": PATIENT}}}}
    return Experiment(**(words | {"bus": bus} | more))


@given(st.floats(-5, 5), st.floats(-50, 50), st.floats(1e-4, 0.05), st.floats(1.0, 1000.0), st.floats(1e-4, 0.1))
def test_the_loop_settles_as_its_differential_equation_says(
    e: float, rate: float, T: float, gain: float, tau: float
) -> None:
    """Against the eigenvalues of the companion matrix, and in two steps as in one."""
    roots = np.roots([tau, 1.0, gain]).astype(complex)
    if abs(roots[0] - roots[1]) < 1e-3 * abs(roots[0]):
        return
    second = (rate - roots[0] * e) / (roots[1] - roots[0])
    at = (e - second) * np.exp(roots[0] * T) + second * np.exp(roots[1] * T)
    once = settle(e, rate, T, gain, tau)
    scale = abs(e) + abs(rate) * tau + abs(rate) / gain + 1e-12
    assert once[0] == pytest.approx(at.real, abs=1e-9 * scale * max(1.0, abs(second) / scale))
    twice = settle(*settle(e, rate, T / 2, gain, tau), T / 2, gain, tau)
    assert twice[0] == pytest.approx(once[0], abs=1e-9 * scale)


def test_the_loop_settles_with_equal_poles_too() -> None:
    tau = 0.01
    assert settle(1.0, 0.0, 0.02, 25.0, tau)[0] == pytest.approx(exp(-1.0) * 2.0, rel=1e-12)


@pytest.mark.parametrize("tau", [1e-9, 1e-6, 1e-5])
def test_a_velocity_loop_that_is_as_good_as_perfect_leaves_the_position_loop(tau: float) -> None:
    """ė = -gain e, however long the sample is."""
    e, rate = settle(1.0, -100.0, 0.05, 100.0, tau)
    assert (e, rate) == pytest.approx((exp(-5.0), -100.0 * exp(-5.0)), rel=0.01)


def test_a_drive_led_by_positions_follows_a_ramp_without_error() -> None:
    """The demand's slope is fed forward: what is left is the start."""
    model = library_model("position-drive")
    x, T, v = model.initial_state, 1e-3, 10.0
    for k in range(1, 400):
        x = model.advance(x, v * k * T, T, model.params)
    assert x[0] == pytest.approx(v * 399 * T, abs=1e-12) and x[1] == pytest.approx(v, abs=1e-9)


def test_a_profile_takes_the_time_of_its_trapezoid() -> None:
    """10 mm at 13 mm/s and 200 mm/s²: d/v + v/a; 0.1 mm never reaches 13 mm/s: 2 sqrt(d/a). Its last steps creep."""
    model = library_model("profile-drive", speed=13.0, acceleration=200.0, position_gain=5000.0, tau=2e-5)
    for distance, wanted in ((10.0, 10.0 / 13.0 + 13.0 / 200.0), (0.1, 2.0 * sqrt(0.1 / 200.0))):
        x, k = model.initial_state, 0
        while abs(x[0] - distance) > 1e-4:
            x, k = model.advance(x, distance, 1e-3, model.params), k + 1
        assert k * 1e-3 == pytest.approx(wanted, abs=6e-3)


def test_csp_needs_no_controller_and_says_which_one_gave_way() -> None:
    alone, beside = experiment("csp").run(), experiment("csp", controller={"name": "tracking"}).run()
    assert np.array_equal(alone["X_measured"], beside["X_measured"])
    assert alone.units["X_command"] == alone.units["X_target"] == "mm" and "X_voltage" not in alone
    assert np.array_equal(alone["X_command"], alone["X_reference"])
    (said,) = beside.meta["notes"]
    assert "position loop follows the reference; the controller tracking gives way" in said
    assert "gives way" not in alone.meta["notes"][0]
    assert abs(alone["X_measured"] - alone["X_reference"]).max() < 0.02


def test_csv_gives_the_students_controller_the_drives_velocity_loop() -> None:
    """A position gain of 50 1/s, over a loop of 1/600 s; the axis's top speed limits it."""

    def control(t, r, y, state, params):
        return r.velocity + 50.0 * (r.position - y), state

    result = experiment("csv", controller=control).run()
    assert result.units["X_command"] == result.units["X_target"] == "mm/s"
    # G = (s + k)/(tau s² + s + k) is nearly 1 at pi rad/s: error w² tau/k of the amplitude
    expected = 2.0 * pi**2 / 600.0 / 50.0
    assert abs(result["X_measured"] - result["X_reference"])[1000:].max() == pytest.approx(expected, abs=1.5e-3)
    jump = experiment("csv", {"kind": "constant", "value": 3.0}, controller=control).run()
    assert abs(jump["X_command"]).max() > 100.0
    assert abs(jump["X_target"]).max() == pytest.approx(17.64)  # 10 V through 1.764 (mm/s)/V


def test_a_target_that_is_no_number_is_refused_with_its_unit() -> None:
    assert limiter(Command.VELOCITY, 5.0, "mm/s")(np.float64(7.0)) == 5.0
    for bad in (float("nan"), inf, "fast", None):
        with pytest.raises(ContractError, match=r"as the velocity; it must be one finite number in mm/s"):
            limiter(Command.VELOCITY, 5.0, "mm/s")(bad)


@pytest.mark.parametrize(
    ("coupled", "answer", "said"),
    [
        (False, ("fast", None), r"the velocity 'fast' .*\(axis X\).*the velocity one finite number in mm/s"),
        (False, None, r"it must return \(velocity, next_state\) with a finite velocity in mm/s"),
        (True, ([1.0], None), r"the velocity 2 finite numbers in mm/s, one for each axis"),
    ],
)
def test_a_controller_in_csv_is_told_of_velocities(coupled: bool, answer: object, said: str) -> None:
    def control(t, r, y, state, params):
        return answer

    law = Controller(control, coupled=coupled)
    with pytest.raises(ContractError, match=said):
        experiment("csv", axis=["X", "Y"] if coupled else "X", controller=law).run()


@pytest.mark.parametrize(
    "mode, more, said",
    [
        ("csp", {"reference": {"kind": "square", "amplitude": 2.0, "frequency": 1.0}}, r"jumps by 4 mm at t = 0.5 s"),
        ("pp", {}, r'profile to positions that stand .* use mode = "csp"'),
        ("csv", {}, "controller of axis X is missing"),
        (
            "csp",
            {"reference": None, "signal": {"kind": "constant", "value": 1.0}, "mode": "system-test"},
            r'the drive of axis X takes a position: use mode = "cst"',
        ),
        ("csp", {"axis": "spindle"}, r'spindle is a spindle: give it \[bus\.cia402\.axis\.spindle\] with mode = "csv"'),
    ],
)
def test_what_a_drive_cannot_follow_is_refused(mode: str, more: dict[str, Any], said: str) -> None:
    words = {"reference": SINE, "bus": {"dialect": "cia402", "cia402": {"mode": mode}}} | more
    given = {"machine": "mini-cnc", "axis": "X", "duration": 1.0} | words
    with pytest.raises(InputError, match=said):
        Experiment(**{key: value for key, value in given.items() if value is not None}).run()


def part(folder: Path, drive: str) -> PartProgram:
    (folder / "part.ngc").write_text("G21 G90 F600\nS1000 M3\nG1 X3\nG2 X0 Y0 I-1.5 J0\nM5\nM2\n")
    patient = "\n".join(
        f"[bus.cia402.axis.{axis}]\nwrite = {PATIENT}\n" + ('mode = "csv"' if axis == "spindle" else "")
        for axis in ("X", "Y", "Z", "spindle")
    )
    words = f'sample_period = 0.004\n[bus]\ndialect = "cia402"\n[bus.cia402]\nmode = "{drive}"\n{patient}\n'
    (folder / "drives.toml").write_text(words)
    return PartProgram(folder / "part.ngc", experiment=folder / "drives.toml")


def test_a_part_program_is_followed_by_drives(tmp_path: Path) -> None:
    result = part(tmp_path, "csp").run()
    assert result.meta["program"]["contour_error"]["rms"] < 0.01
    assert result.units["X_target"] == "mm" and result.units["spindle_target"] == "rev/min"
    with pytest.raises(InputError, match=r'drives\.toml, line \d+: mode = "pp" moves axis X by a profile of its own'):
        part(tmp_path, "pp").run()


@pytest.mark.realtime
@pytest.mark.parametrize("mode", ["csp", "csv", "pp"])
def test_drives_follow_in_all_modes(mode: str) -> None:
    """Emulation is the simulation bit for bit; the drive on the bus does what its model says."""
    square = {"kind": "square", "amplitude": 1.0, "frequency": 0.5}
    reference, controller = (square, None) if mode == "pp" else (SINE, {"name": "tracking"})
    words: dict[str, Any] = {"sample_period": 0.004, "duration": 1.2} | (
        {"controller": controller} if controller else {}
    )
    runs = experiment(mode, reference, **words)
    simulated, emulated = runs.run("simulation"), runs.run("emulation")
    for column in ("X_reference", "X_measured", "X_command", "X_target"):
        assert np.array_equal(simulated[column], emulated[column]), column
    real = runs.run("implementation")
    assert real.meta["ending"] == "done" and real.units["X_modelled"] == "mm"
    apart = abs(real["X_measured"] - real["X_modelled"])
    assert np.median(apart) < 0.05 and abs(real["X_measured"]).max() > 0.9
    assert ("gives way" in " ".join(real.meta["notes"])) == (mode == "csp")


@pytest.mark.realtime
def test_a_part_program_moves_drives_on_the_bus(tmp_path: Path) -> None:
    result = part(tmp_path, "csp").run("implementation")
    assert result.meta["ending"] == "done"
    assert result.meta["program"]["contour_error"]["rms"] < 0.05 and result["X_measured"].max() > 2.9
