"""The structures spindle and axis-mass: responses against the library's, derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis.strategies import floats, integers

from rds.core.errors import InputError
from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.structure import Structure
from rds.identification.structures.structures import structure
from rds.models import linear_axis, spindle


def excited(seed: int, samples: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """Irregular times (s) and a voltage (V) that turns the axis often."""
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.uniform(0.5e-3, 1.5e-3, samples))
    return t, 4.0 * np.sin(7.0 * t) + 3.0 * np.sign(np.sin(23.0 * t))


def by_differences(made: Structure, values: dict[str, float], x0: tuple[float, ...], seed: int) -> float:
    """The largest error of the derivatives, relative to the largest of each column."""
    t, u = excited(seed)
    _, slopes = made.sensitivities(t, u, x0, values)  # type: ignore[misc]
    worst = 0.0
    for i, (name, value) in enumerate(values.items()):
        step = 1e-6 * max(abs(value), 1e-3)
        above, below = (made.respond(t, u, x0, {**values, name: value + s}) for s in (step, -step))
        worst = max(worst, _off((above - below) / (2.0 * step), slopes[:, i]))
    for i in range(made.states):
        above, below = (made.respond(t, u, [x + s * (j == i) for j, x in enumerate(x0)], values) for s in (1e-6, -1e-6))
        worst = max(worst, _off((above - below) / 2e-6, slopes[:, len(values) + i]))
    return worst


def _off(difference: np.ndarray, slope: np.ndarray) -> float:
    return float(np.abs(difference - slope).max() / max(float(np.abs(slope).max()), 1e-3))


@settings(max_examples=20)
@given(
    M=floats(1.0, 200.0), F_v=floats(0.0, 500.0), F_c=floats(5.0, 50.0), offset=floats(-4.0, 4.0), seed=integers(0, 99)
)
def test_derivatives_in_mass_form_are_exact(M: float, F_v: float, F_c: float, offset: float, seed: int) -> None:
    values = {"M": M, "F_v": F_v + 1.0, "F_c": F_c, "offset": offset, "force_gain": 35.0}
    assert by_differences(structure("axis-mass"), values, (0.1, 20.0), seed) < 1e-3  # what differences can say


@settings(max_examples=20)
@given(F_plus=floats(1.0, 300.0), F_minus=floats(1.0, 300.0), seed=integers(0, 99))
def test_derivatives_by_direction_are_exact(F_plus: float, F_minus: float, seed: int) -> None:
    values = {
        "M": 95.0,
        "F_v_plus": F_plus,
        "F_v_minus": F_minus,
        "F_c_plus": 20.0,
        "F_c_minus": 15.0,
        "force_gain": 35.0,
    }
    assert by_differences(structure("axis-mass", ("per-direction",)), values, (0.1, 20.0), seed) < 1e-4


@settings(max_examples=20)
@given(tau=floats(2e-3, 1.0), delay=floats(0.0, 0.02), seed=integers(0, 99))
def test_derivatives_of_the_spindle_are_exact(tau: float, delay: float, seed: int) -> None:
    values = {"tau": tau, "K": 1000.0, "offset": -0.1, "delay": delay + 1e-4}
    t, _ = excited(seed)
    late = t + values["delay"]
    nearest = t[np.clip(np.searchsorted(t, late), 1, len(t) - 1)[:, None] - [0, 1]]
    assume(np.abs(nearest - late[:, None]).min() > 1e-7)  # s: there the response by the delay has a kink
    assert by_differences(structure("spindle", ("offset", "delay")), values, (10.0,), seed) < 1e-4


def test_the_mass_form_is_the_linear_axis_of_the_library() -> None:
    made = structure("axis-mass")
    values = {"M": 2.0, "F_v": 150.0, "F_c": 20.0, "offset": -3.0, "force_gain": 35.0}
    t, u = excited(0)
    model = made.as_model(values)  # type: ignore[misc]
    assert model.pop("name") == "linear-axis"
    x, expected = (0.3, 2.5), []
    for k, time in enumerate(t):
        expected.append(x[0])
        if k + 1 < len(t):
            x = linear_axis.advance(x, u[k], t[k + 1] - time, model)
    assert np.abs(made.respond(t, u, (0.3, 2.5), values) - expected).max() < 1e-11


def test_the_spindle_is_that_of_the_library() -> None:
    values = {"tau": 0.08, "K": 1000.0}
    t, u = excited(0)
    x, expected = (10.0,), []
    for k, time in enumerate(t):
        expected.append(x[0])
        if k + 1 < len(t):
            x = spindle.advance(x, u[k], t[k + 1] - time, spindle.make(**values).params)
    assert np.abs(structure("spindle").respond(t, u, (10.0,), values) - expected).max() < 1e-9


def test_a_spindle_s_steady_speed_is_no_fault_beside_steps() -> None:
    values = {"tau": 0.08, "K": 1000.0}
    t, u = np.arange(600) * 1e-3, np.where(np.arange(600) < 100, 1.0, 2.0)
    steps = Log("steps", t, u, structure("spindle").respond(t, u, (1000.0,), values), units={"position": "rev/min"})
    steady = replace(steps, name="steady", command=np.full(600, 1.5), position=np.full(600, 1500.0))
    start = structure("spindle").start
    assert start is not None
    assert next(iter(start([steady, steps])))[0] == pytest.approx(values, rel=1e-3)
    with pytest.raises(InputError, match="the speed never changes"):
        start([steady, steady])


def test_without_viscous_friction_the_mass_accelerates_evenly() -> None:
    values = {"M": 2.0, "F_v": 0.0, "F_c": 4.0, "offset": 0.0, "force_gain": 10.0}
    t = np.linspace(0.0, 2.0, 101)
    y = structure("axis-mass").respond(t, np.ones(101), (0.0, 0.0), values)
    assert y == pytest.approx(0.5 * 3.0 * 1000.0 * t**2, rel=1e-12)  # (10 - 4) N over 2 kg is 3 m/s²


def test_a_mass_that_moves_by_itself_is_no_library_axis() -> None:
    with pytest.raises(InputError, match="no linear axis"):
        structure("axis-mass").as_model(  # type: ignore[misc]
            {"M": 2.0, "F_v": 1.0, "F_c": 4.0, "offset": 5.0, "force_gain": 10.0}
        )


def test_logs_that_begin_with_their_step_tell_a_spindle() -> None:
    """The speed changes under a command that is the same throughout; such logs were refused as if nothing changed."""
    t = np.arange(800) * 1e-3
    units = {"position": "rev/min", "command": "V"}
    logs = [
        Log(f"{level:g} V", t, np.full(len(t), level), np.round(960.0 * level * -np.expm1(-t / 0.08)), units=units)
        for level in (2.0, 4.0)
    ]
    found = fit(logs, structure("spindle"))
    assert found.values() == pytest.approx({"tau": 0.08, "K": 960.0}, rel=1e-3) and not found.unusable()
    with pytest.raises(InputError, match="the command is 0 throughout"):
        fit(Log("coast", t, 0.0 * t, 2000.0 * np.exp(-t / 0.08), units=units), structure("spindle"))
