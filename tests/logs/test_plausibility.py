"""A good log of any axis has no fault; the same log with a sign reversed has that one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import Gravity, Log
from rds.identification.structures.axis_structure import make
from rds.machines import load_machine

KINDS = {
    "sine": np.sin,
    "square": lambda phase: np.sign(np.sin(phase)),
    "triangle": lambda phase: np.arcsin(np.sin(phase)) * 2.0 / np.pi,
    "staircase": lambda phase: np.round(np.arcsin(np.sin(phase)) * 4.0 / np.pi) / 2.0,
    "two tones": lambda phase: 0.6 * np.sin(phase) + 0.4 * np.sin(3.7 * phase + 1.0),
    "forward": lambda phase: 0.7 + 0.3 * np.sin(phase),
}


def made(
    kind: str, tau: float, K: float, friction: tuple[float, float], frequency: float, period: float, phase: float
) -> Log:
    """Ten seconds or 500 samples of an axis that 5 V drive; `friction` as shares of that voltage."""
    t = np.arange(max(round(10.0 / period), 500)) * period
    u = 5.0 * KINDS[kind](2.0 * np.pi * frequency * t + phase)
    values = {"tau": tau, "K": K, "friction_plus": 5.0 * K * friction[0], "friction_minus": -5.0 * K * friction[1]}
    y = make().respond(t, u, (0.0, 0.0), values)
    noise = 1e-4 * np.ptp(y) * np.random.default_rng(0).standard_normal(len(t))
    step = 1e-4 * float(np.ptp(y)) or 1e-3
    return Log(kind, t, u, np.round((y + noise) / step) * step, resolution=step)


def faults(log: Log) -> list[str]:
    return [finding.what for finding in with_findings(log).findings if finding.gravity is Gravity.FAULT]


shares = st.floats(0.02, 0.6)


@given(
    kind=st.sampled_from(sorted(KINDS)),
    tau=st.floats(0.002, 0.2),
    K=st.floats(0.1, 100.0),
    friction=st.tuples(shares, shares),
    frequency=st.floats(0.1, 5.0),
    period=st.sampled_from([0.0002, 0.001, 0.005, 0.02]),
    phase=st.floats(0.0, 6.28),
)
@example("forward", 0.01, 1.764, (0.06, 0.03), 20.0 / (2.0 * np.pi), 0.001, 0.0)
@example("forward", 0.1875, 1.0, (0.125, 0.5), 5.0, 0.0002, 0.0)  # the first peak 0.49, the one against it 0.60
def test_a_good_log_has_no_fault_and_one_with_a_sign_reversed_has(
    kind: str, tau: float, K: float, friction: tuple[float, float], frequency: float, period: float, phase: float
) -> None:
    assume(frequency * period < 0.05)  # sampled often enough to be followed
    log = made(kind, tau, K, friction, frequency, period, phase)
    assert not faults(log)
    (fault,) = faults(replace(log, position=-log.position))
    assert "moves against its command" in fault


@pytest.mark.parametrize("volts", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("axis", "XYZ")
def test_an_axis_that_a_small_voltage_hardly_moves_has_no_wrong_unit(axis: str, volts: float) -> None:
    machine = load_machine("mini-cnc").axes[axis]
    values = {name: float(machine.model[name]) for name in ("tau", "K", "friction_plus", "friction_minus")}
    t = np.arange(10000) * 0.001
    u = volts * np.sin(2.0 * np.pi * t)
    y = np.round(make().respond(t, u, (0.0, 0.0), values), 3)
    log = Log(axis, t, u, y, units={"command": "V", "position": "mm"}, resolution=0.001)
    assert not [f for f in with_findings(log, machine).findings if f.kind == "units"]
    if volts == 5.0:
        metres = with_findings(replace(log, position=log.position / 1000.0), machine)
        assert any(f.kind == "units" and f.gravity is Gravity.FAULT for f in metres.findings)
