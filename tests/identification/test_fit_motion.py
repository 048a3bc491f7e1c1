"""The axis of a fit: the same motion as the models', and derivatives that differences of it confirm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import OPTIONS, make
from rds.models import library_model
from rds.models.machine_axis import MachineAxis, MachineParameters
from tests.identification.fit_logs import mini_cnc

ALL = {
    "tau": 0.0102,
    "K": 1.72,
    "friction_plus": 0.56,
    "friction_minus": -0.24,
    "viscous": 0.018,
    "stribeck": 0.12,
    "stribeck_velocity": 0.8,
    "delay": 0.0013,
    "backlash": 0.01,
}


def voltage(samples: int, amplitude: float, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(samples) * 0.001
    return t, amplitude * (np.sin(2 * np.pi * frequency * t) + 0.4 * np.sign(np.sin(9.0 * t + 0.2)))


def test_the_plain_axis_moves_as_the_library_s_does() -> None:
    values = mini_cnc("Z")
    t, u = voltage(3000, 2.0, 1.3)
    model, x, expected = library_model("linear-axis", **values), (0.1, 0.5), []
    for k in range(len(t)):
        expected.append(x[0])
        x = model.advance(x, u[k], 0.001, model.params)
    assert np.abs(make().respond(t, u, (0.1, 0.5), values) - expected).max() < 1e-12


@pytest.mark.parametrize("delay", [0.0, 0.0002, 0.0013])
def test_with_every_option_it_moves_as_the_machine_behind_the_bus_does(delay: float) -> None:
    values = ALL | {"delay": delay}
    t, u = voltage(3000, 2.0, 1.3)
    u[: int(delay / 0.001) + 1] = 0.0  # the machine's amplifier puts out 0 V until the first command arrives
    machine, expected = MachineAxis(MachineParameters(**values)), []
    for k in range(len(t)):
        expected.append(machine.advance(t[k]))
        machine.command(u[k], t[k])
    options = ("viscous", "stribeck", "delay", "backlash")
    # the machine cuts its time at other instants where a command arrives between two of the samples
    allowed = 1e-9 if delay == 0.0 else 1e-5
    assert np.abs(make(options).respond(t, u, (0.0, 0.0, 0.0), values) - expected).max() < allowed


@settings(max_examples=20, deadline=None)
@given(
    tau=st.floats(0.004, 0.05),
    plus=st.floats(0.05, 1.5),
    minus=st.floats(-1.5, -0.05),
    amplitude=st.floats(1.0, 5.0),
    frequency=st.floats(0.5, 8.0),
    v0=st.floats(0.05, 4.0) | st.floats(-4.0, -0.05),
    chosen=st.sets(st.sampled_from([option for option in OPTIONS if option != "offset"])),
    data=st.data(),
)
def test_derivatives_are_those_of_the_motion(tau, plus, minus, amplitude, frequency, v0, chosen, data) -> None:
    structure = make(tuple(option for option in OPTIONS if option in chosen))
    draws = {
        "viscous": st.floats(0.0, 0.3),
        "stribeck": st.floats(0.05, 0.5),
        "stribeck_velocity": st.floats(0.3, 2.0),
        "dead_zone": st.floats(0.02, 0.3),
        # where the delay is a whole number of the Stribeck level's substeps, their number jumps
        "delay": st.floats(0.00013, 0.0037).filter(lambda d: abs(d / 0.00025 - round(d / 0.00025)) > 0.01),
        "backlash": st.floats(0.002, 0.05),
    }
    values = {"tau": tau, "K": 1.7, "friction_plus": plus, "friction_minus": minus}
    values |= {name: data.draw(draw) for name, draw in draws.items() if name in structure.parameters}
    x0 = (0.2, v0, 0.3)[: structure.states]
    t, u = voltage(300, amplitude, frequency)
    y, by = structure.sensitivities(t, u, x0, values)
    assert np.array_equal(y, structure.respond(t, u, x0, values))
    for column, name in enumerate([*values, *structure.state_names]):
        step = 1e-6 * max(abs(values.get(name, 1.0)), 1e-3)

        def moved(change: float, name: str = name) -> np.ndarray:
            if name in values:
                return structure.respond(t, u, x0, {**values, name: values[name] + change})
            start = list(x0)
            start[structure.state_names.index(name)] += change
            return structure.respond(t, u, start, values)

        difference = (moved(step) - moved(-step)) / (2 * step)
        size = np.abs(by[:, column]).max()
        # now and then a difference straddles a kink (the axis starts a sample sooner): then it is no derivative
        rounding = 3e-14 / step  # of positions of some mm, in a difference
        off = np.abs(difference - by[:, column])
        assert np.median(off) <= 1e-5 * size + rounding, name
        assert np.quantile(off, 0.8) <= 1e-3 * size + 10 * rounding, name


def test_derivatives_by_offset_and_symmetric_friction() -> None:
    structure = make(("offset", "dead-zone"))
    values = {"tau": 0.01, "K": 1.7, "friction": 0.4, "offset": 0.07, "dead_zone": 0.1}
    t, u = voltage(2000, 2.0, 1.3)
    _, by = structure.sensitivities(t, u, (0.0, 0.0), values)
    for column, name in enumerate(values):
        step = 1e-6 * values[name]
        ends = [structure.respond(t, u, (0.0, 0.0), {**values, name: values[name] + s}) for s in (step, -step)]
        difference = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(difference - by[:, column]).max() < 1e-5 * np.abs(by[:, column]).max(), name


def test_samples_may_come_at_any_time() -> None:
    values = mini_cnc("X")
    t, u = voltage(2000, 2.0, 1.3)
    y = make().respond(t, u, (0.0, 0.0), values)
    chosen = np.sort(np.random.default_rng(0).choice(len(t), 900, replace=False))
    finer = np.unique(np.concatenate([t, t[chosen] + 0.0004]))  # each command held over an instant more
    held = u[np.searchsorted(t, finer + 1e-9, side="right") - 1]
    again = make().respond(finer, held, (0.0, 0.0), values)
    assert np.abs(again[np.isin(finer, t)] - y).max() < 1e-12


def test_the_search_for_stribeck_friction_leaves_a_place_beside_the_best() -> None:
    """It ended at 0.28 ± 0.004, as residuals were small enough, with a sum of squares 46 variances above the best."""
    made, draw, t = make(("stribeck",)), np.random.default_rng(46), np.arange(3000) * 1e-3
    u = np.repeat(draw.uniform(-5.0, 5.0, 30), 100)
    truth = {"tau": 0.01, "K": 1.8, "friction_plus": 0.5, "friction_minus": -0.3}
    y = made.respond(t, u, [0.0, 0.0], truth | {"stribeck": 0.5, "stribeck_velocity": 1.0})
    y = np.round(y + 1e-3 * draw.standard_normal(len(t)), 3)
    found = fit(Log("X", t, u, y, resolution=1e-3), made).parameters["stribeck"]
    assert found.low < 0.5 < found.high
