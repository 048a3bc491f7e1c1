"""Relay autotuning: the ultimate point of plants whose answer is known, a safe run, and gains to go on with."""

from __future__ import annotations

import json
import re
import tomllib
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest
from control_loops import RANGE, T, plant, run, step
from documents import ROOT
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.controllers import library_controller
from rds.core.errors import InputError
from rds.core.linear_law import linear_law
from rds.core.types import Reference
from rds.identification import relay_gains
from rds.machines import load_machine, machine_names
from rds.models import library_model

TAU, K = 0.01, 1.8  # s, (mm/s)/V


def signals(controller, model, reference, delay=0):
    """The last of each signal, from a loop without encoder; positions and voltages before them."""
    motion, state, waiting = model.motion(model, T), controller.initial_state, [0.0] * delay
    measured, voltages, told = [], [], ()
    for k, r in enumerate(zip(*(part.tolist() for part in reference), strict=True)):
        y = motion.read()
        u, following = controller.control(k * T, Reference(*r), y, state, controller.params)
        told, state = controller.observe(y, state, following, controller.params), following
        waiting.append(u)
        motion.write(waiting.pop(0))
        measured.append(y)
        voltages.append(u)
    return dict(zip(controller.signals, told, strict=True)), np.array(measured), np.array(voltages)


def response(w, delay):
    """K/(s(τs + 1)) held and sampled, `delay` samples late, at w rad/s."""
    z, kept = np.exp(1j * w * T), np.exp(-T / TAU)
    speed = K * (1 - kept) / (z - kept)
    return (K * (T - TAU * (1 - kept)) + TAU * (1 - kept) * speed) / (z - 1) * z**-delay


def ultimate(delay):
    """Gain (V/mm) and period (s) at which the sampled loop under P alone just swings."""
    w = np.linspace(20.0, 0.99 * pi / T, 200_000)
    there = response(w, delay)
    k = int(np.argmax(there.imag > 0.0))  # the phase passes -180° from above
    return 1.0 / abs(there[k]), 2.0 * pi / w[k]


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_ultimate_gain_and_period_of_an_axis_without_friction(delay):
    relay = library_controller("relay", {}, T, RANGE, tune_effort=2.0)
    found, _, _ = signals(relay, library_model("linear-axis", tau=TAU, K=K), step(0.0, 6000), delay)
    gain, period = ultimate(delay)
    assert found["ultimate_gain"] == pytest.approx(gain, rel=0.12)
    assert found["ultimate_period"] == pytest.approx(period, rel=0.085)  # longer: it changes over at a sample


@pytest.mark.parametrize("hysteresis", [0.0, 0.01, 0.05])
def test_the_axis_has_the_inverse_of_the_gain_at_the_period_that_was_found(hysteresis):
    """Åström and Hägglund: the axis answers the relay's fundamental with the amplitude, with and without hysteresis."""
    relay = library_controller("relay", {}, T, RANGE, tune_effort=2.0, hysteresis=hysteresis)
    found, _, _ = signals(relay, library_model("linear-axis", tau=TAU, K=K), step(0.0, 8000), 2)
    samples = found["ultimate_period"] / T
    share = np.sqrt(found["amplitude"] ** 2 - hysteresis**2)
    of_relay = 4.0 / (samples * sin(pi / samples)) * 2.0  # 4 d/π, of a sampled relay
    assert found["ultimate_gain"] == pytest.approx(of_relay / share, rel=1e-9)
    assert of_relay == pytest.approx(8.0 / pi, rel=0.01)
    there = response(2.0 * pi / found["ultimate_period"], 2)
    assert abs(there) * of_relay == pytest.approx(found["amplitude"], rel=0.07)


def test_the_ultimate_gain_of_a_sampled_first_order_lag_is_exact():
    """A spindle without delay swings from sample to sample: the pole of its P loop is at -1."""
    tau, gain = 0.08, 1000.0
    relay = library_controller("relay", {}, T, RANGE, unit="rev/min")
    found, measured, _ = signals(relay, library_model("spindle", tau=tau, K=gain), step(3000.0, 2000))
    kept = np.exp(-T / tau)
    assert found["ultimate_gain"] == pytest.approx((1 + kept) / (gain * (1 - kept)), rel=0.01)
    assert found["ultimate_period"] == pytest.approx(2 * T)
    assert measured[-1] == pytest.approx(3000.0, abs=0.1)


@pytest.mark.parametrize(
    "rule, P, I, D",  # of Ku, Ku/Tu, Ku Tu
    [("pid", 0.6, 1.2, 0.075), ("pi", 0.45, 0.54, 0.0), ("tyreus-luyben", 1 / 2.2, 1 / 4.84, 1 / (2.2 * 6.3))],
)
def test_gains_are_those_of_the_published_rules(rule, P, I, D):  # noqa: E741
    relay = library_controller("relay", {}, T, RANGE, tune_type=rule)
    found, _, _ = signals(relay, plant("X"), step(0.0, 3000), 1)
    Ku, Tu = found["ultimate_gain"], found["ultimate_period"]
    wanted = {"Pgain": P * Ku, "Igain": I * Ku / Tu, "Dgain": D * Ku * Tu}
    assert {name: found[name] for name in wanted} == pytest.approx(wanted, rel=1e-9)


def test_an_offset_of_the_amplifier_does_not_change_what_is_found():
    def found(offset):
        machine = {"tau": TAU, "K": K, "friction_plus": 0.0, "friction_minus": 0.0, "offset": offset}
        relay = library_controller("relay", {}, T, RANGE, tune_effort=2.0)
        return signals(relay, library_model("machine-axis", **machine), step(0.0, 4000), 2)

    even, _, _ = found(0.0)
    uneven, measured, voltages = found(0.8)
    assert uneven["ultimate_gain"] == pytest.approx(even["ultimate_gain"], rel=0.05)
    assert uneven["ultimate_period"] == pytest.approx(even["ultimate_period"], rel=0.05)
    assert abs(measured[-500:]).max() < 1e-4
    assert voltages[-500:] == pytest.approx(-0.8, abs=0.01)  # what holds the axis against the offset


def test_the_voltage_stays_limited_and_the_axis_is_held():
    relay = library_controller("relay", {}, T, RANGE, tune_effort=3.0)
    measured, voltages = run(relay, plant("X"), step(2.0, 6000), T, 1)
    assert abs(voltages).max() <= 3.0 + 0.6  # the relay, and what friction that differs by direction makes of the bias
    assert abs(measured[-1000:] - 2.0).max() < 1e-3
    assert abs(measured).max() < 2.1


def test_emulation_repeats_simulation_and_a_run_says_what_was_found():
    def result(mode):
        return rds.Experiment(
            mode=mode,
            axis="X",
            duration=1.0,
            reference=rds.constant(0.0),
            controller={"name": "relay", "tune_cycles": 30},
        ).run()

    simulated, emulated = result("simulation"), result("emulation")
    for column in ("X_measured", "X_voltage", "X_ultimate_gain", "X_ultimate_period", "X_Dgain"):
        assert np.array_equal(simulated[column], emulated[column])
    (note,) = simulated.meta["notes"]
    found = relay_gains(simulated).found
    assert f"ultimate gain {found.ultimate_gain:.4g} V/mm" in note
    assert f"Pgain = {found.options['Pgain']:g}" in note


AXES = [(machine, axis) for machine in machine_names() for axis in load_machine(machine).axes]


def tuned_late(machine, axis, delay=1):
    """What the relay finds for an axis in a simulation whose voltages act `delay` samples late, and the result."""
    about = load_machine(machine)
    of = about.axis(axis)
    late = {"actuator": {"kind": "constant", "delay": about.sample_period}} if delay else None
    result = rds.Experiment(
        machine=machine,
        axis=axis,
        duration=4.0 if about.sample_period < 0.01 else 6.0,
        reference=rds.constant(0.3 * of.travel[1] if of.is_spindle else 0.0),
        controller="relay",
        network=late,
    ).run()
    return relay_gains(result, delay=delay), result


@pytest.mark.parametrize("delay, least", [(0, 35.0), (1, 28.0)])
@pytest.mark.parametrize("machine, axis", AXES)
def test_every_axis_that_comes_with_rds_gets_a_stable_loop(machine, axis, delay, least):
    found, result = tuned_late(machine, axis, delay)
    assert found.phase_margin > least
    assert found.gain_margin > 4.0
    error = abs(result[f"{axis}_measured"] - result[f"{axis}_reference"])[-50:].max()
    assert error <= 1.01 * load_machine(machine).axis(axis).resolution


def test_the_document_has_the_numbers_that_come_out():
    text = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| `([\w-]+)` (\w+)[^|]* \| ([\d.]+) V/\S+ \| ([\d.]+) ms \| [^|]+ \| ([\d.]+), ([\d.]+), ([\d.]+) "
        r"\| (\d+)° \| ([\d.]+) dB \|$",
        text,
        re.MULTILINE,
    )
    assert len(rows) == 9
    for machine, axis, *numbers in rows:
        found = tuned_late(machine, axis)[0]
        law = found.controller()
        gains = [law["Pgain"], law["Igain"], law["Dgain"]]
        there = [found.found.ultimate_gain, 1e3 * found.found.ultimate_period, *gains]
        assert there == pytest.approx([float(each) for each in numbers[:5]], rel=0.01), (machine, axis)
        assert [found.phase_margin, found.gain_margin] == pytest.approx([float(each) for each in numbers[5:]], abs=0.6)


def test_gains_of_a_simulation_have_half_the_phase_margin_on_a_bus():
    result = rds.Experiment(axis="X", duration=2.0, reference=rds.constant(0.0), controller="relay").run()
    assert relay_gains(result).phase_margin == pytest.approx(39.0, abs=1.0)
    assert relay_gains(result, delay=1).phase_margin == pytest.approx(21.0, abs=1.0)


def test_an_axis_that_friction_holds_is_refused_with_the_remedy():
    result = rds.Experiment(
        axis="X", duration=2.0, reference=rds.constant(0.0), controller={"name": "relay", "tune_effort": 0.3}
    ).run()
    said = r"X: no sustained oscillation came of 0\.3 V .*more tune_effort .*less hysteresis"
    assert any("no sustained oscillation" in note for note in result.meta["notes"])
    assert abs(result["X_voltage"][-500:]).max() == 0.0
    with pytest.raises(InputError, match=said):
        relay_gains(result)


def test_a_hysteresis_that_is_never_reached_takes_the_voltage_off():
    relay = library_controller("relay", {}, T, RANGE, hysteresis=50.0)
    _, voltages = run(relay, plant("X"), step(0.0, 2000))
    assert abs(voltages[1100:]).max() == 0.0


def test_a_reference_that_moves_is_refused():
    result = rds.Experiment(axis="X", duration=2.0, reference=rds.sinusoid(1.0, 1.0), controller="relay").run()
    with pytest.raises(InputError, match=r"the reference moved; let it stand still"):
        relay_gains(result)


def test_a_run_that_is_too_short_says_how_far_it_came():
    result = rds.Experiment(axis="X", duration=0.3, reference=rds.constant(0.0), controller="relay").run()
    with pytest.raises(InputError, match=r"ended after \d+ of 50 half cycles; give the run more time"):
        relay_gains(result)


def test_a_relay_has_no_linear_part():
    with pytest.raises(InputError, match="does not answer in proportion about rest"):
        linear_law(library_controller("relay", load_machine("mini-cnc").axes["X"].model, T, RANGE))


def test_a_run_of_another_law_has_no_relay_gains():
    result = rds.Experiment(axis="X", duration=0.1, reference=rds.constant(0.0), controller="pid").run()
    with pytest.raises(InputError, match=r'no axis of this run.*name = "relay"'):
        relay_gains(result)


def test_effort_is_raised_while_it_runs_until_the_axis_moves():
    relay = library_controller("relay", {}, T, RANGE, tune_effort=0.2)
    values = {name: float(relay.params[name]) for name in relay.tunable}
    model = plant("X")
    motion, state, params, u = model.motion(model, T), relay.initial_state, relay.params, 0.0
    told = {}
    for k in range(4000):
        if k == 1500:
            assert u == 0.0  # it had given up
            params = relay.retune(values | {"tune_effort": 4.0})
        following = relay.control(k * T, Reference(0.0, 0.0, 0.0), motion.read(), state, params)
        u, state = following
        told = dict(zip(relay.signals, relay.observe(0.0, state, state, params), strict=True))
        motion.write(u)
    at_once, _, _ = signals(library_controller("relay", {}, T, RANGE, tune_effort=4.0), plant("X"), step(0.0, 4000))
    assert told["effort"] == 4.0
    assert told["ultimate_gain"] == pytest.approx(at_once["ultimate_gain"], rel=0.05)


def test_tune_start_begins_anew_and_zero_ends_the_swing():
    relay = library_controller("relay", {}, T, RANGE, tune_start=0)
    values = {name: float(relay.params[name]) for name in relay.tunable}
    model = plant("X")
    motion, state, voltages = model.motion(model, T), relay.initial_state, []
    for k in range(3000):
        on = 200 <= k < 400 or k >= 1000
        params = relay.retune(values | {"tune_start": float(on)})
        u, state = relay.control(k * T, Reference(0.0, 0.0, 0.0), motion.read(), state, params)
        motion.write(u)
        voltages.append(u)
    assert not np.any(voltages[:200]) and not np.any(voltages[400:1000])
    assert min(np.abs(voltages[200:400])) > 2.0
    assert state.Ku > 0.0 and state.passed > 50


def test_fewer_half_cycles_while_it_runs_leave_the_averages_right():
    relay = library_controller("relay", {}, T, RANGE, tune_cycles=1000)
    values = {name: float(relay.params[name]) for name in relay.tunable}
    model = plant("X")
    motion, state, params = model.motion(model, T), relay.initial_state, relay.params
    for k in range(2000):
        if k == 1500:
            params = relay.retune(values | {"tune_cycles": 20.0})
        u, state = relay.control(k * T, Reference(0.0, 0.0, 0.0), motion.read(), state, params)
        motion.write(u)
    usual, _, _ = signals(library_controller("relay", {}, T, RANGE), plant("X"), step(0.0, 2000))
    assert state.Ku == pytest.approx(usual["ultimate_gain"], rel=0.05)
    assert state.Tu == pytest.approx(usual["ultimate_period"], rel=0.05)


def test_more_than_the_converter_gives_is_refused():
    with pytest.raises(InputError, match=r"tune_effort = 8 V and bias = 3 V .* range of 10 V"):
        library_controller("relay", {}, T, RANGE, tune_effort=8.0, bias=3.0)


def test_the_saved_run_gives_the_table_of_the_next_experiment(tmp_path: Path):
    result = rds.Experiment(axis="Y", duration=2.0, reference=rds.constant(0.0), controller="relay").run()
    result.save(tmp_path / "run")
    out = tmp_path / "law.toml"
    done = CliRunner().invoke(app, ["design", "relay", str(tmp_path / "run"), "--delay", "1", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "phase margin" in done.output
    table = tomllib.loads(out.read_text(encoding="utf-8"))["controller"]
    assert table == relay_gains(result).controller()
    for options, said in (("--axis X", "axis 'X' of this run was not driven by"), ("-o law.py", "ends in .toml")):
        refused = CliRunner().invoke(app, ["design", "relay", str(tmp_path / "run"), *options.split()])
        assert refused.exit_code == 2 and said in refused.output
    as_json = CliRunner().invoke(app, ["design", "relay", str(tmp_path / "run"), "--json"])
    assert json.loads(as_json.stdout)["controller"] == table
    held = rds.Experiment(axis="Y", duration=1.0, reference=rds.sinusoid(2.0, 0.5), controller=table).run()
    assert abs(held["Y_reference"] - held["Y_measured"]).max() < 0.05
