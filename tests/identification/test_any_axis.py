"""Axes that turn, commands that are torques or currents, and logs of a speed: units follow, numbers come back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.fit.design import left_out_of, linear_axis_of
from rds.identification.fit.fit import fit
from rds.identification.fit.friction_curve import SteadyPoint, _fitted, friction_curve
from rds.identification.fit.machine_file import write_machine
from rds.identification.fit.model_file import read_model, write_model
from rds.identification.fit.run_model import run_model
from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import Log
from rds.identification.structures import axis_inertia
from rds.identification.structures.structures import structure
from rds.identification.validate.candidate import as_candidate
from rds.identification.validate.cross_test import cross_test
from rds.identification.validate.validate import validate
from rds.machines import load_machine
from tests.identification.fit_logs import axis_log, mini_cnc

T = 0.001  # s
TURNS = {"J": 2e-3, "B": 0.02, "T_c": 0.15, "offset": 0.01}  # kg·m², Nm·s/rad, Nm, Nm
K_T = 0.4  # Nm/A


def turning(seed: int, output: str = "deg", command: str = "A", gain: float = K_T, seconds: float = 4.0) -> Log:
    """A rotary axis under a motor current, by its own motion in radians."""
    draw = np.random.default_rng(seed)
    t = np.arange(round(seconds / T)) * T
    u = sum(np.sin(2 * np.pi * f * t + draw.uniform(0, 6.28)) for f in (0.4, 0.9, 1.7, 3.1)) * 0.6
    angle, speed, w, phi = np.empty(len(t)), np.empty(len(t)), 0.0, 0.0
    for k in range(len(t)):
        angle[k], speed[k] = phi, w
        for _ in range(20):
            push = gain * u[k] - TURNS["offset"]
            way = np.sign(w) if w else np.sign(push)
            if w == 0.0 and abs(push) <= TURNS["T_c"]:
                continue
            new = w + T / 20 / TURNS["J"] * (push - TURNS["B"] * w - way * TURNS["T_c"])
            w = 0.0 if w * new < 0.0 else new
            phi += T / 20 * w
    y = np.degrees(angle) if output == "deg" else speed * 30.0 / np.pi
    y = np.round((y + 1e-4 * draw.standard_normal(len(t))) / 1e-4) * 1e-4
    units = {"position": output, "command": command, "force": "Nm"}
    return Log(f"turning-{seed}", t, u, y, units=units, resolution=1e-4, force_gain=gain, closed_loop=False)


@pytest.mark.parametrize(("output", "method"), [("deg", "simulation"), ("rev/min", "simulation"), ("rev/min", None)])
def test_inertia_and_friction_of_an_axis_that_turns(output: str, method: str | None) -> None:
    found = fit([turning(1, output)], structure("axis-inertia"), method)
    assert found.method == (method or "inverse-dynamics") and found.command_unit == "A"
    for name, value in TURNS.items():
        assert found.parameters[name].value == pytest.approx(value, rel=0.03, abs=2e-3), name
    units = {name: parameter.unit for name, parameter in found.parameters.items()}
    assert units == {"J": "kg·m²", "B": "Nm·s/rad", "T_c": "Nm", "offset": "Nm", "torque_gain": "Nm/A"}
    assert found.parameters["torque_gain"].value == K_T


def test_a_torque_needs_no_gain_and_a_current_without_one_says_so() -> None:
    current = turning(1)
    torque = replace(
        current, command=K_T * current.command, force_gain=None, units={"position": "deg", "command": "Nm"}
    )
    found = fit([torque], structure("axis-inertia"))
    assert found.parameters["J"].value == pytest.approx(TURNS["J"], rel=0.02)
    with pytest.raises(InputError, match=r"needs the torque that the command makes.*torque_gain = .* \(Nm/A\)"):
        fit([replace(current, force_gain=None)], structure("axis-inertia"))
    with pytest.raises(InputError, match=r"position is in deg, and structure axis-mass takes mm"):
        fit([current], structure("axis-mass"))


def test_the_motor_constant_is_given_or_follows_from_torque_and_current() -> None:
    known = turning(1)
    units = {"position": "deg", "command": "A"}
    current = with_findings(replace(known, force_gain=None, units=units))
    ratios = fit([current], structure("axis"))
    assert any("known as ratios to that constant only" in sentence for sentence in ratios.unidentifiable)
    held = fit([current], structure("axis-inertia"), "simulation", {"fixed": {"torque_gain": K_T}})
    assert held.values()["J"] == pytest.approx(TURNS["J"], rel=0.01) and held.values()["torque_gain"] == K_T
    assert not any("known as ratios" in sentence for sentence in held.unidentifiable)
    with pytest.raises(InputError, match=r"torque_gain is given with the log \(0.4 Nm/A\) and cannot be held"):
        fit([known], structure("axis-inertia"), "simulation", {"fixed": {"torque_gain": 0.5}})
    torque = K_T * current.command + 0.005 * np.random.default_rng(0).standard_normal(len(current)) + 0.01
    both = with_findings(replace(current, findings=(), extra={"force": torque}, units={**units, "force": "Nm"}))
    assert both.force_gain == pytest.approx(K_T, rel=1e-3)
    found = fit([both], structure("axis-inertia"), "simulation")
    assert found.values()["T_c"] == pytest.approx(TURNS["T_c"], rel=0.01) and not found.unidentifiable
    both = replace(both, findings=())
    other = {"force": both.command[::-1].copy()}
    driven = with_findings(
        replace(both, command=torque, extra={"current": both.command}, units=units | {"command": "Nm"})
    )
    wrong = with_findings(replace(both, force_gain=0.5))
    unlike = with_findings(replace(both, force_gain=None, extra=other))
    said = [f.what for log in (driven, wrong, unlike) for f in log.findings if f.kind == "motor-constant"]
    assert "motor constant: 0.4 ± 0.000" in said[0] and "where 0.5 Nm/A is stated" in said[1]
    assert "hardly go together" in said[2] and unlike.force_gain is None


def test_a_gain_in_degrees_per_ampere_and_its_verdict_and_model_file(tmp_path: Path) -> None:
    found = fit([turning(1)], structure("axis", ("offset",)))
    r = TURNS["B"] / TURNS["J"]  # 1/s
    assert found.parameters["K"].unit == "(deg/s)/A" and found.parameters["friction"].unit == "deg/s"
    assert found.parameters["K"].value == pytest.approx(np.degrees(K_T / TURNS["J"] / r), rel=0.01)
    assert found.parameters["tau"].value == pytest.approx(1.0 / r, rel=0.02)
    path = write_model(tmp_path / "a.toml", found)
    assert read_model(path).output_unit == "deg" and read_model(path).command_unit == "A"
    assert validate(path, turning(2)).verdict.ok
    off = replace(as_candidate(path), values={**found.values(), "tau": 1.3 / r})
    assert not validate(off, turning(2)).verdict.ok
    with pytest.raises(InputError, match=r"the command is in A and the model .* takes V"):
        validate(library_candidate(tmp_path), turning(2))
    with pytest.raises(InputError, match=r"its command is in A, and a machine's converter gives V"):
        run_model(read_model(path), unit="deg")


def library_candidate(tmp_path: Path) -> Path:
    estimate = fit([axis_log(mini_cnc("X"), seconds=3.0)], structure("axis"))
    return write_model(tmp_path / "x.toml", estimate)


def test_a_machine_of_an_axis_alone_has_what_the_log_tells(tmp_path: Path) -> None:
    log = turning(1)
    path = write_model(tmp_path / "a.toml", fit([log], structure("axis-inertia")))
    made = write_machine(tmp_path / "rotary.toml", path, None, "A", per_volt=0.5)
    axis = load_machine(str(made.path)).axis("A")
    assert axis.unit == "deg" and axis.resolution == 1e-4
    assert axis.travel == pytest.approx((log.position.min(), log.position.max()))
    assert axis.model["K"] == pytest.approx(0.5 * np.degrees(K_T / TURNS["B"]), rel=0.03)  # (deg/s)/V
    assert "chosen, not of the log" in made.said[0]
    with pytest.raises(InputError, match="a model of an axis that turns, and this axis is measured in mm"):
        write_machine(tmp_path / "no.toml", path, "mini-cnc", "X", per_volt=0.5)


def test_friction_that_differs_by_direction_becomes_a_machine(tmp_path: Path) -> None:
    values = {"M": 2.0, "F_v_plus": 30.0, "F_v_minus": 45.0, "F_c_plus": 4.0, "F_c_minus": 6.0, "force_gain": 5.0}
    made = structure("axis-mass", ("per-direction",))
    t = np.arange(6000) * T
    u = 4.0 * np.sin(2 * np.pi * 0.7 * t) + 2.0 * np.sin(2 * np.pi * 2.3 * t)
    y = np.round(made.respond(t, u, (0.0, 0.0), values) / 1e-3) * 1e-3
    found = fit([Log("m", t, u, y, resolution=1e-3, force_gain=5.0)], made, "simulation")
    path = write_model(tmp_path / "m.toml", found)
    written = write_machine(tmp_path / "machine.toml", path, "mini-cnc", "X")
    axis = load_machine(str(written.path)).axis("X")
    assert axis.machine["viscous_difference"] > 0.0
    assert "of mini-cnc, not of the log: travel (-75 to 75 mm)" in written.said[0]
    model = run_model(read_model(path))
    from rds.models import library_model

    own = {key: value for key, value in axis.model.items() if key != "name"}
    machine = library_model(axis.model["name"], **own)
    x, z = model.initial_state, machine.initial_state
    for k in range(1500):
        x = model.advance(x, u[k], T, model.params)
        z = machine.advance(z, u[k], T, machine.params)
    assert z[0] == pytest.approx(x[0], abs=1e-9)


def test_held_parameters_leave_the_others_to_inverse_dynamics() -> None:
    data = axis_log(mini_cnc("X"))
    free = fit([data], structure("axis"), "inverse-dynamics")
    truth = mini_cnc("X")
    for name in ("tau", "K", "friction_plus"):
        held = fit([data], structure("axis"), "inverse-dynamics", {"fixed": {name: truth[name]}})
        assert held.parameters[name].value == truth[name] and held.parameters[name].std_error == 0.0
        for other in truth.keys() - {name}:
            error = max(free.parameters[other].std_error, 0.01 * abs(truth[other]))
            assert abs(held.parameters[other].value - truth[other]) < 5.0 * error
    both = fit([data], structure("axis"), "inverse-dynamics", {"fixed": {"K": truth["K"], "tau": truth["tau"]}})
    assert both.values()["tau"] == truth["tau"] and both.values()["K"] == pytest.approx(truth["K"])
    with pytest.raises(InputError, match="every parameter is held"):
        fit([data], structure("axis"), "inverse-dynamics", {"fixed": truth})


def test_one_speed_is_said_to_hold_friction() -> None:
    """Every row holds friction forward there: what cannot be told is its share of what the gain takes as well."""
    t = np.arange(8000) * T
    units = {"position": "mm/s", "command": "N"}
    data = Log("steady", t, np.full(len(t), 2.0), np.full(len(t), 10.0), units=units, resolution=1e-3)
    found = fit([data], structure("axis-mass", ("per-direction",)), None, {"fixed": {"M": 1.0}})
    assert sum("no row of the data holds it" in s for s in found.unidentifiable) == 2  # of those backward
    assert any(s.startswith("F_v_plus and F_c_plus come only together") for s in found.unidentifiable)
    assert found.unusable()
    with pytest.raises(InputError, match="gain and friction come only together: the motion is at one speed"):
        fit([data], structure("axis"), "inverse-dynamics", {"fixed": {"tau": 0.01}})


def test_the_cross_test_finds_what_is_off_on_another_log() -> None:
    fitted, other = axis_log(mini_cnc("X"), seed=1), axis_log(mini_cnc("X"), seed=2)
    right = as_candidate(fit([fitted], structure("axis"), "inverse-dynamics"))
    wrong = replace(right, values={**right.values, "K": 1.2 * right.values["K"]})
    (good,), (bad,) = cross_test(right, [other]), cross_test(wrong, [other])
    assert good.times < 1.1 and good.rows > 500
    assert bad.percent > 3.0 * good.percent and bad.fitted_percent == good.fitted_percent


def steady(speeds: list[float], noise: float = 0.0) -> Log:
    """Runs of a second at these speeds (mm/s), each behind a force of Stribeck's kind (N)."""
    draw = np.random.default_rng(0)
    v = np.repeat(speeds, 1000)
    force = np.sign(v) * (8.0 + 4.0 * np.exp(-((v / 3.0) ** 2))) + 0.2 * v
    t = np.arange(len(v)) * T
    units = {"position": "mm/s", "command": "N"}
    return Log("runs", t, force + noise * draw.standard_normal(len(v)), v, units=units)


def test_a_friction_curve_from_runs_at_constant_speed() -> None:
    speeds = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0]
    found = friction_curve([steady([*speeds, *(-v for v in speeds)], noise=0.05)])
    assert len(found.points) == 20 and found.force_unit == "N"
    truth = {"F_c": 8.0, "F_s": 12.0, "v_s": 3.0, "F_v": 200.0}  # N, N, mm/s, N·s/m
    for numbers in found.directions.values():
        assert {name: told.value for name, told in numbers.items()} == pytest.approx(truth, rel=0.05)
        assert numbers["F_v"].unit == "N·s/m" and all(told.std_error > 0.0 for told in numbers.values())
    assert found.at(np.array([-10.0]), "backward") == pytest.approx([-10.0], rel=0.02)
    assert "inertia" in found.unidentifiable[0] and any(
        "below 0.5 mm/s" in sentence for sentence in found.unidentifiable
    )


def test_the_errors_of_a_friction_curve_count_that_all_four_numbers_are_estimated() -> None:
    draw, v = np.random.default_rng(1), np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0])
    beyond = 0
    for _ in range(60):
        f = 8.0 + 4.0 * np.exp(-((v / 3.0) ** 2)) + 0.2 * v + 0.1 * draw.standard_normal(len(v))
        points = [SteadyPoint("runs", 0.0, 1.0, *map(float, at), 0.1) for at in zip(v, f, strict=True)]
        numbers, _ = _fitted(points, 1.0, "mm/s", "N", "mm/s")
        beyond += abs(numbers["F_c"].value - 8.0) > 2.45 * numbers["F_c"].std_error  # Student's t of 6: 5 %
    assert beyond <= 6


def test_the_intervals_of_a_friction_curve_hold_where_points_are_few() -> None:
    """A line through two points leaves nothing: the standard errors of both its numbers were 0."""
    draw = np.random.default_rng(3)
    for v, within in (([10.0, 40.0], True), ([10.0, 20.0, 40.0], True), ([10.0, 20.0, 40.0], False)):
        speeds, held = np.array(v), 0
        for _ in range(100):
            f = 8.0 + 0.2 * speeds + 0.1 * draw.standard_normal(len(v))
            points = [SteadyPoint("a", 0.0, 1.0, *map(float, at), 0.1 * within) for at in zip(v, f, strict=True)]
            numbers, _ = _fitted(points, 1.0, "mm/s", "N", "mm/s")
            held += numbers["F_c"].low < 8.0 < numbers["F_c"].high
            assert numbers["F_v"].std_error > 0.0
        assert held >= 90


def test_what_a_friction_curve_cannot_tell() -> None:
    fast = friction_curve([steady([20.0, 25.0, 30.0, 36.0, 44.0, 53.0, 65.0], noise=0.05)])
    assert set(fast.directions["forward"]) == {"F_c", "F_v"}
    assert (
        any("on a line as well" in s for s in fast.unidentifiable)
        and "friction backward: no run goes that way" in fast.unidentifiable
    )
    one = friction_curve([steady([20.0])])
    assert set(one.directions["forward"]) == {"F_c"} and any(
        "viscous friction: all runs" in s for s in one.unidentifiable
    )
    t = np.arange(4000) * T
    with pytest.raises(InputError, match="no stretch keeps its speed"):
        friction_curve([Log("sine", t, np.sin(6 * t), 10 * np.sin(9 * t), units={"position": "mm/s"})])


def test_a_friction_curve_names_the_logs_that_gave_no_point() -> None:
    """The slow runs of a robot's joint were left out without a word, and a faster one was called the slowest."""
    t = np.arange(4000) * T
    slow = Log("slow", t, 10 + np.sin(9 * t), 2.0 + np.sin(9 * t), units={"position": "mm/s", "command": "N"})
    found = friction_curve([steady([20.0, 30.0, 40.0]), slow])
    assert {point.log for point in found.points} == {"runs"}
    assert any(sentence.startswith("slow: no stretch of these logs") for sentence in found.unidentifiable)


def test_a_design_says_what_it_leaves_out_of_one_direction() -> None:
    both = left_out_of({"friction_plus": 0.5, "friction_minus": -0.5, "viscous_plus": 0.1})
    assert left_out_of({"friction_plus": 0.0, "friction_minus": -0.5, "viscous_difference": 0.1}) == both
    assert len(both) == 2


def test_a_torque_against_the_motion_is_a_fault() -> None:
    log = turning(1)
    assert not any(f.kind == "sign" for f in with_findings(log).findings)
    against = with_findings(replace(log, command=-log.command))
    assert any(f.kind == "sign" and "takes more energy" in f.what for f in against.findings)


def test_a_log_of_a_speed_is_fitted_with_friction_of_each_direction_and_refused_where_a_position_is_needed() -> None:
    truth = mini_cnc("X")
    t = np.arange(5000) * T
    u = 4.0 * np.sin(2 * np.pi * 0.9 * t) + 2.0 * np.sin(2 * np.pi * 4.1 * t)
    made = structure("axis", (), "mm/s")
    v = np.round(made.respond(t, u, (0.0,), truth) + 0.01 * np.random.default_rng(0).standard_normal(len(t)), 2)
    log = Log("speed", t, u, v, units={"position": "mm/s"}, resolution=0.01, closed_loop=False)
    found = fit([log], structure("axis"))
    for name, value in truth.items():
        assert found.parameters[name].value == pytest.approx(value, rel=0.01), name
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].std_error
    assert linear_axis_of(found).unit == "mm"  # of the position, whose speed it was
    with pytest.raises(InputError, match="takes positions, and the log has a speed alone"):
        fit([log], structure("axis"), "step")
    with pytest.raises(InputError, match="play shows in a position"):
        fit([log], structure("axis", ("backlash",)))


@pytest.mark.parametrize("output", ["deg", "rev/min"])
def test_the_right_inertia_is_valid_on_another_log(output: str) -> None:
    """The library's axis is in deg/s, a log of a speed in rev/min: the gain of a right model was 500 % too high."""
    found = fit(turning(1, output), structure("axis-inertia"), "simulation")
    validation = validate(found, turning(2, output))
    assert validation.verdict.ok
    gain = next(reason.what for reason in validation.verdict.reasons if "its gain" in reason.what)
    assert float(gain.split("its gain is ")[1].split()[0]) < 3.0


def test_gaps_that_are_kept_leave_the_inertia_to_simulation() -> None:
    """A recorder on a computer pauses for 8 ms now and then; derivatives do not know the motion there."""
    log = turning(1, "rev/min")
    keep = np.flatnonzero(np.arange(len(log)) % 400 < 392)
    broken = replace(log, time=log.time[keep], command=log.command[keep], position=log.position[keep])
    with pytest.raises(InputError, match="no filter bridges; `--method simulation` simulates across it"):
        fit(broken, structure("axis-inertia"), "inverse-dynamics")
    found = fit(broken, structure("axis-inertia"), "simulation").parameters
    for name in ("J", "B", "T_c"):
        assert found[name].value == pytest.approx(TURNS[name], rel=0.03), name


def test_inverse_dynamics_of_a_held_torque_is_not_biased() -> None:
    """A torque is held from its sample to the next: taken as it is at its sample, parameters are five errors off."""
    found = fit(turning(1, "rev/min"), structure("axis-inertia"), "inverse-dynamics").parameters
    for name, value in TURNS.items():
        error = abs(found[name].value - value)
        assert error < max(4.0 * found[name].std_error, 1e-3 * value), (name, found[name])


def test_the_inertia_of_a_small_motor_is_no_bound() -> None:
    """2 g·cm² and less, as motors of a few watts have, are far below a millionth of a kg·m²."""
    truth = {"J": 2e-8, "B": 4e-8, "T_c": 4e-7, "offset": 0.0, "torque_gain": 1.0}
    t = np.arange(800) * 0.004
    u = 3e-6 * np.sign(np.sin(6.0 * t)) * (1.0 + 0.4 * np.sin(2.3 * t))
    small = axis_inertia.make((), "rev/min", "Nm")
    y = small.respond(t, u, (0.0,), truth) + 0.2 * np.random.default_rng(0).standard_normal(len(t))
    found = fit([Log("motor", t, u, y, units={"command": "Nm", "position": "rev/min"})], small, "simulation")
    assert all(found.parameters[name].value == pytest.approx(truth[name], rel=0.02) for name in ("J", "B", "T_c"))
    assert not any("bound" in warning for warning in found.warnings)
