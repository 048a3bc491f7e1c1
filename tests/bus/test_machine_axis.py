"""The machine's own axis: closed form where there is one, a fine-stepped reference elsewhere."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.models.machine_axis import MachineAxis, MachineParameters

COULOMB = MachineParameters(tau=0.01, K=1.764, friction_plus=0.539, friction_minus=-0.222)
MACHINE = load_machine("mini-cnc")
REAL = {name: MachineParameters.from_table(axis.machine) for name, axis in MACHINE.axes.items()}


def test_start_and_stop_in_closed_form() -> None:
    p, axis = COULOMB, MachineAxis(COULOMB)
    axis.command(5.0, at=0.0)
    final = p.K * 5.0 - p.friction_plus
    for t in (0.0003, 0.01, 0.4):
        assert axis.advance(t) == pytest.approx(final * (t - p.tau * (1 - exp(-t / p.tau))), rel=1e-12)
    speed = axis.velocity
    assert speed == pytest.approx(final * (1 - exp(-0.4 / p.tau)))
    axis.command(0.0, at=0.4)
    before = axis.output()
    stop = p.tau * log(1 + speed / p.friction_plus)
    axis.advance(0.4 + stop * 0.999)
    assert axis.velocity > 0
    axis.advance(100.0)
    assert axis.velocity == 0.0
    assert axis.output() - before == pytest.approx(p.tau * speed - p.friction_plus * stop, rel=1e-9)


def test_reversal_passes_zero_at_the_exact_instant() -> None:
    p, axis = COULOMB, MachineAxis(COULOMB)
    axis.velocity = v0 = 4.0
    axis.command(-5.0, at=0.0)
    down, up = p.K * -5.0 - p.friction_plus, p.K * -5.0 - p.friction_minus
    crossing = p.tau * log((v0 - down) / -down)
    t = 0.03
    axis.advance(t)
    assert axis.velocity == pytest.approx(up * (1 - exp(-(t - crossing) / p.tau)), rel=1e-12)


@pytest.mark.parametrize("name", REAL)
def test_sticks_until_breakaway(name: str) -> None:
    p = REAL[name]
    for friction in (p.friction_plus, p.friction_minus):
        edge = friction * (1 + p.stribeck) / p.K
        axis = MachineAxis(p)
        axis.command(edge * 0.999 - p.offset, at=0.0)
        assert axis.advance(1e6) == 0.0 and axis.velocity == 0.0
        axis.command(edge * 1.001 - p.offset, at=1e6)
        axis.advance(1e6 + 0.1)
        assert axis.velocity * friction > 0


def reference(p: MachineParameters, commands: list[tuple[float, float]], end: float) -> tuple[float, float]:
    """Velocity and carriage by steps of 2 µs of the equation itself, each cut where the velocity crosses zero."""
    h, v, x, carriage, voltage = 2e-6, 0.0, 0.0, 0.0, 0.0
    waiting = list(commands)

    def slope(v: float, friction: float) -> float:
        level = friction * (1 + p.stribeck * exp(-((v / p.stribeck_velocity) ** 2)))
        return (p.K * voltage - level - (1 + p.viscous) * v) / p.tau

    for n in range(round(end / h)):
        if waiting and waiting[0][0] + p.delay <= (n + 0.5) * h:
            voltage = waiting.pop(0)[1] + p.offset  # of the amplifier, once it has a command
        left, pull = h, p.K * voltage
        while left > 0:
            if v == 0.0 and p.friction_minus * (1 + p.stribeck) <= pull <= p.friction_plus * (1 + p.stribeck):
                break
            friction = p.friction_plus if v > 0 or (v == 0 and pull > 0) else p.friction_minus
            after = v + slope(v + slope(v, friction) * left / 2, friction) * left
            part = left * v / (v - after) if after * v < 0 else left
            after = 0.0 if after * v < 0 else after
            x += 0.5 * (v + after) * part
            carriage = min(max(carriage, x - p.backlash / 2), x + p.backlash / 2)
            v = after
            left -= part
    return v, carriage


@pytest.mark.parametrize("name", REAL)
def test_against_fine_steps(name: str) -> None:
    p = REAL[name]
    commands = [(0.0, 6.0), (0.02, -4.0), (0.045, 0.0), (0.06, 1.0), (0.07, -0.5), (0.08, 10.0), (0.1, -10.0)]
    axis = MachineAxis(p, speed_output=name == "spindle")
    for at, voltage in commands:
        axis.command(voltage, at)
    for k in range(121):
        output = axis.advance(k * 0.001)
    v, carriage = reference(p, commands, 0.12)
    if name == "spindle":
        assert output == pytest.approx(v, abs=1e-3)  # rev/min, a thousandth of a count
    else:
        assert output == pytest.approx(carriage, abs=1e-6)  # mm, a thousandth of a count
        assert axis.velocity == pytest.approx(v, abs=1e-4)


@settings(max_examples=60, deadline=None)
@given(
    voltages=st.lists(st.floats(-10, 10), min_size=1, max_size=5),
    cuts=st.lists(st.floats(0.0, 0.05), max_size=8),
)
def test_without_stribeck_the_path_in_time_does_not_matter(voltages: list[float], cuts: list[float]) -> None:
    p = replace(REAL["X"], stribeck=0.0)
    direct, stepwise = MachineAxis(p), MachineAxis(p)
    for k, voltage in enumerate(voltages):
        for axis in (direct, stepwise):
            axis.command(voltage, k * 0.01)
    for cut in sorted(cuts):
        stepwise.advance(cut)
    assert stepwise.advance(0.06) == pytest.approx(direct.advance(0.06), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(voltage=st.floats(-10, 10), name=st.sampled_from(["X", "Y", "Z"]))
def test_never_leaves_the_play_nor_the_possible_speed(voltage: float, name: str) -> None:
    p, axis = REAL[name], MachineAxis(REAL[name])
    axis.command(voltage, 0.0)
    axis.command(-voltage, 0.013)
    for k in range(40):
        axis.advance(k * 0.0007)
        assert abs(axis.velocity) <= p.K * (abs(voltage) + abs(p.offset))
        assert abs(axis.output() - axis.position) <= p.backlash / 2 + 1e-15


def test_backlash_is_lost_at_a_reversal() -> None:
    p = MachineParameters(tau=0.01, K=2.0, backlash=0.02)
    axis = MachineAxis(p)
    axis.command(1.0, 0.0)
    assert axis.advance(1.0) == pytest.approx(axis.position - 0.01)
    axis.command(-1.0, 1.0)
    highest = max(axis.advance(1.0 + k * 1e-4) for k in range(100))
    axis.advance(2.0)
    assert axis.output() == pytest.approx(axis.position + 0.01)
    assert axis.output() < highest


def test_a_command_does_not_act_before_its_delay_is_over() -> None:
    axis = MachineAxis(MachineParameters(tau=0.01, K=2.0, delay=0.5))
    axis.command(5.0, at=0.0)
    assert (axis.advance(0.25), axis.now, axis.voltage) == (0.0, 0.25, 0.0)
    assert (axis.advance(0.5), axis.now, axis.voltage) == (0.0, 0.5, 5.0)
    assert axis.advance(0.51) > 0.0


def test_a_command_acts_its_delay_later_and_a_cut_at_once() -> None:
    p = MachineParameters(tau=0.01, K=2.0, delay=0.003)
    axis = MachineAxis(p)
    axis.command(1.0, 0.001)
    assert axis.advance(0.004) == 0.0
    assert axis.advance(0.0041) > 0.0 and axis.voltage == 1.0
    axis.command(5.0, 0.005)
    axis.cut(0.006)
    assert axis.voltage == 0.0
    axis.advance(0.02)
    assert axis.voltage == 0.0


def test_time_does_not_go_back() -> None:
    axis = MachineAxis(COULOMB)
    axis.command(5.0, 0.0)
    there = axis.advance(0.1)
    assert axis.advance(0.05) == there and axis.now == 0.1


@pytest.mark.parametrize(
    "table, words",
    [
        ({"tau": 0.01}, "K is missing"),
        ({"tau": 0.01, "K": 1.0, "stribek": 1.0}, "has no option .stribek.; it has tau.*did you mean .stribeck."),
        ({"tau": 0.0, "K": 1.0}, "tau = 0.0 must be more than 0"),
        ({"tau": 0.01, "K": float("nan")}, "must be a (finite )?number"),
        ({"tau": 0.01, "K": 1.0, "friction_minus": 0.2}, "must be at most 0 mm/s"),
        ({"tau": 0.01, "K": 1.0, "backlash": -1.0}, "must be at least 0 mm"),
        ({"tau": 0.01, "K": "fast"}, "must be a (finite )?number"),
    ],
)
def test_bad_parameters_are_named(table: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        MachineParameters.from_table(table, "[axis.X.machine]")
