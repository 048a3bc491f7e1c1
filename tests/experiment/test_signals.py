"""What a law knows, recorded: named signals beside the voltage, their columns, and the plant's true velocity."""

from __future__ import annotations

from dataclasses import replace
from math import exp, nan

import numpy as np
import pytest

import rds
from rds.controllers import library_controller
from rds.core.errors import ContractError
from rds.models import library_model
from rds.modes.experiment import Experiment
from rds.modes.experiment.compiled import obstacle
from rds.results import Result, open_result
from rds.results.plots_signals import signals as draw
from rds.results.signals import estimate_error, signals_of

SINE = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.2}
IDEAL = {"saturation": False, "quantization": False}
FILE = """
signals = {"velocity": "mm/s", "integral": "mm·s"}
params = {"P": 20.0, "T": 0.001}
initial_state = [0.0, 0.0]


def control(t, r, y, state, params):
    last, integral = state
    integral += (r.position - y) * params["T"]
    told = {"integral": integral, "velocity": (y - last) / params["T"]}
    return params["P"] * (r.position - y), [y, integral], told
"""


def experiment(controller, **words):
    return Experiment(**{"axis": "X", "duration": 0.2, "reference": SINE, "controller": controller, **words})


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "with_signals.py"
    path.write_text(FILE)
    return path


def test_signals_are_columns_with_units_and_say_what_the_law_said(file):
    result = experiment(str(file), duration=1.0).run("simulation")
    assert signals_of(result, "X") == ["velocity", "integral"]
    assert (result.units["X_velocity"], result.units["X_integral"]) == ("mm/s", "mm·s")
    y, error = result["X_measured"], result["X_reference"] - result["X_measured"]
    assert np.array_equal(result["X_velocity"], np.diff(y, prepend=0.0) / 0.001)
    assert result["X_integral"] == pytest.approx(np.cumsum(error) * 0.001, abs=1e-12)


def test_without_signals_a_result_has_the_columns_that_it_always_had():
    plain = [f"X_{part}" for part in ("reference", "reference_velocity", "reference_acceleration", "measured")]
    assert list(experiment({"name": "p"}).run("simulation").columns) == ["time", *plain, "X_command", "X_voltage"]


def test_the_voltage_does_not_depend_on_whether_signals_are_told(file, tmp_path):
    without = tmp_path / "without.py"
    without.write_text(FILE.split("\n", 2)[2].replace(", [y, integral], told", ", [y, integral]"))
    told, plain = (experiment(str(path)).run("simulation") for path in (file, without))
    assert np.array_equal(told["X_command"], plain["X_command"]) and not signals_of(plain, "X")


def test_the_observer_converges_to_the_true_velocity_by_its_pole():
    """Without friction and quantization, an axis that moves when it begins is seen with the error v₀ F^k."""
    model = replace(library_model("linear-axis", tau=9.943e-3, K=1.764), initial_state=(0.0, 3.0))
    result = experiment({"name": "tracking"}, model=model, interface=IDEAL).run("simulation")
    error = estimate_error(result, "X")
    expected = -3.0 * exp(-320.0 * 0.001) ** np.arange(len(error))
    assert error == pytest.approx(expected, abs=1e-9)
    assert np.abs(error[60:]).max() < 2e-8  # mm/s


def test_friction_leaves_the_estimate_off_by_what_the_observers_pole_lets_through():
    """In steady motion v̂ - v = F_C/τ / 320 in continuous time; the sampled observer is within 15 % of it."""
    result = experiment({"name": "tracking"}, duration=5.0, interface=IDEAL).run("simulation")
    error, true = estimate_error(result, "X"), result["X_plant_velocity"]
    for sign, friction in ((1, 0.539), (-1, -0.222)):
        steady = error[sign * true > 5.0]
        assert steady.mean() == pytest.approx(friction / 9.943e-3 / 320.0, rel=0.15)


def test_the_plant_velocity_is_that_of_the_plants_equation():
    """τ v̇ + v = K u, integrated over a sample: x⁺ - x = K u T - τ (v⁺ - v)."""
    model = library_model("linear-axis", tau=9.943e-3, K=1.764)
    result = experiment({"name": "pid"}, model=model, interface=IDEAL).run("simulation")
    assert result.units["X_plant_velocity"] == "mm/s"
    x, v, u = result["X_measured"], result["X_plant_velocity"], result["X_voltage"][:-1]
    assert np.diff(x) == pytest.approx(1.764 * u * 0.001 - 9.943e-3 * np.diff(v), abs=1e-12)
    assert np.abs(v).max() > 6.0


@pytest.mark.parametrize("name", ["pid", "modified-pid"])
def test_the_librarys_integral_is_that_of_the_error(name):
    result = experiment({"name": name}, duration=0.5).run("simulation")
    error = result["X_reference"] - result["X_measured"]
    assert result["X_integral"] == pytest.approx(np.cumsum(error) * 0.001, abs=1e-12)
    assert result.units["X_integral"] == "mm·s"


def test_units_follow_the_axis():
    assert library_controller("pid", {"tau": 0.1, "K": 250.0}, 0.001, 10.0, unit="rev/min").signals == {
        "integral": "(rev/min)·s"
    }
    assert library_controller("tracking", {"tau": 0.01, "K": 2.0}, 0.001, 10.0, unit="deg").signals == {
        "velocity": "deg/s"
    }


def test_a_spindle_and_a_model_with_an_output_of_its_own_have_no_plant_velocity():
    spindle = experiment(
        {"name": "pid"}, axis="spindle", reference={"kind": "square", "amplitude": 100.0, "frequency": 1.0}
    )
    assert "spindle_plant_velocity" not in spindle.run("simulation")
    own = {"derivatives": lambda t, x, u, params: [-x[0], x[0]], "output": lambda t, x, u, params: x[1]}
    assert "X_plant_velocity" not in experiment({"name": "pid"}, model=own).run("simulation")


def test_a_file_with_signals_is_not_compiled(file):
    pytest.importorskip("numba")
    assert "only the library's controllers" in str(obstacle(experiment(str(file)).plan("simulation")))


@pytest.mark.realtime
def test_emulation_repeats_the_signals_of_simulation_exactly(file, tmp_path):
    both = experiment(str(file), axis=("X", "Y"), duration=0.3)
    simulated, emulated = both.run("simulation"), both.run("emulation", out=tmp_path / "run")
    names = [f"{axis}_{name}" for axis in ("X", "Y") for name in ("velocity", "integral", "plant_velocity")]
    for name in names:
        assert np.array_equal(simulated[name], emulated[name]), name
        assert emulated.units[name] == simulated.units[name]
    raw = open_result(tmp_path / "run" / "record.rds")
    assert signals_of(raw, "X") == ["velocity", "integral"] and raw.units["X_integral"] == "mm·s"


@pytest.mark.realtime
def test_implementation_records_signals_and_no_plant_velocity(file, tmp_path):
    result = experiment(str(file), duration=0.3).run("implementation", out=tmp_path / "run")
    assert signals_of(result, "X") == ["velocity", "integral"] and "X_plant_velocity" not in result
    ran = result["time"] > 0.0  # discarded periods leave no rows
    if np.array_equal(np.diff(result["time"][ran]).round(9), np.full(ran.sum() - 1, 0.001)):
        assert np.array_equal(result["X_velocity"], np.diff(result["X_measured"], prepend=0.0) / 0.001)


def test_saved_results_keep_signals_and_units(file, tmp_path):
    result = experiment(str(file)).run("simulation")
    for ending in ("csv", "mat"):
        again = Result.open(result.save(tmp_path / f"result.{ending}"))
        assert np.array_equal(again["X_integral"], result["X_integral"]) and again.units["X_integral"] == "mm·s"


def test_a_coupled_law_tells_one_value_for_each_axis():
    def control(t, r, y, state, params):
        error = r.position - y
        return 20.0 * error, state, {"error_sum": np.full(2, error.sum()), "place": y}

    law = rds.Controller(control, (), coupled=True, signals={"error_sum": "mm", "place": "mm"})
    result = experiment(law, axis=("X", "Y")).run("simulation")
    total = sum(result[f"{axis}_reference"] - result[f"{axis}_measured"] for axis in "XY")
    assert np.array_equal(result["Y_place"], result["Y_measured"])
    assert np.array_equal(result["X_error_sum"], total) and np.array_equal(result["Y_error_sum"], total)


def _law(told, **declared):
    return rds.Controller(
        lambda t, r, y, state, params: (0.0, state, *([] if told is None else [told])), (), **declared
    )


DECLARED = {"signals": {"velocity": "mm/s"}}


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (None, "it must return (voltage, next_state, {'velocity': ...})"),
        ({}, "lack 'velocity'"),
        ({"velocity": nan}, "the signal 'velocity' is nan"),
        ({"velocity": "fast"}, "the signal 'velocity' is 'fast'"),
        ({"velocity": [1.0, 2.0]}, "the signal 'velocity' is [1.0, 2.0]"),
        ({"velocity": True}, "the signal 'velocity' is True"),
        ({"velocity": 0.0, "speed": 0.0}, "have 'speed', which is not declared"),
        (0.0, "the signals are 0.0"),
    ],
)
def test_a_bad_third_part_is_refused_with_its_time(told, said):
    with pytest.raises(ContractError, match=r"at t = 0\.000 s") as error:
        experiment(_law(told, **DECLARED)).run("simulation")
    assert said in str(error.value)


@pytest.mark.parametrize("told", [np.zeros(3), 0.0, np.array([0.0, nan])])
def test_a_coupled_law_with_a_wrong_shape_is_refused(told):
    law = _law({"velocity": told}, coupled=True, **DECLARED)
    law = replace(law, control=lambda t, r, y, state, params: (np.zeros(2), state, {"velocity": told}))
    with pytest.raises(ContractError, match="an array of 2 finite numbers, one for each axis"):
        experiment(law, axis=("X", "Y")).run("simulation")


def test_the_line_of_the_answer_is_named(file):
    file.write_text(FILE.replace('"velocity": (y', '"speed": (y'))
    with pytest.raises(ContractError) as error:
        experiment(str(file)).run("simulation")
    line = FILE.split("\n").index('    return params["P"] * (r.position - y), [y, integral], told') + 1
    assert str(error.value).startswith(f"{file}:{line}: control() returned signals at t = 0.000 s (axis X)")


def test_a_third_part_that_is_not_declared_is_refused_with_the_remedy(file):
    file.write_text(FILE.split("\n", 2)[2])
    with pytest.raises(
        ContractError, match=r"it must return \(voltage, next_state\), unless the file declares"
    ) as error:
        experiment(str(file)).run("simulation")
    assert 'signals = {"velocity": "mm/s"}' in str(error.value)


@pytest.mark.parametrize("names", [["velocity"], "velocity", None])
def test_a_variable_of_that_name_that_declares_nothing_is_left_alone(names):
    def control(t, r, y, state, params):
        return 0.0, state

    assert not signals_of(experiment({"control": control, "signals": names}).run("simulation"), "X")


@pytest.mark.parametrize(
    ("signals", "said"),
    [
        ({"measured": "mm"}, "columns such as X_measured end so"),
        ({"my_command": "V"}, "columns such as X_command end so"),
        ({"two words": "mm"}, "must be a word"),
        ({3: "mm"}, "must be a word"),
        ({"velocity": 3}, "gives 'velocity' the unit 3"),
        ({"velocity": "[mm]"}, "gives 'velocity' the unit"),
        ({f"s{i}": "" for i in range(17)}, "declares 17 signals; a controller may have 16"),
    ],
)
def test_a_declaration_that_cannot_be_columns_is_refused(signals, said, file):
    file.write_text(
        f"import math\n\nsignals = {signals!r}\n\n\ndef control(t, r, y, state, params):\n    return 0.0, state\n"
    )
    with pytest.raises(ContractError) as error:
        experiment(str(file)).run("simulation")
    assert said in str(error.value) and f"{file}:3: " in str(error.value)
    with pytest.raises(ContractError) as error:
        experiment(_law(None, signals=signals)).run("simulation")
    assert said in str(error.value)


def test_compared_results_say_how_far_their_signals_are_apart():
    slow, fast = (
        experiment({"name": "tracking", "observer_pole": pole}, duration=0.5).run("simulation") for pole in (-100, -320)
    )
    compared = slow.compare(fast)
    signal = compared.axes["X"].signals["velocity"]
    difference = fast["X_velocity"] - slow["X_velocity"]
    assert signal.max_difference == np.abs(difference).max() > 0.0 and signal.unit == "mm/s"
    assert "X_velocity" in compared.axes["X"].differing_columns and "signal velocity differs" in str(compared)


def test_the_picture_holds_the_estimate_against_the_true_velocity():
    result = experiment({"name": "tracking"}, axis=("X", "Y"), duration=0.5).run("simulation")
    picture = draw(result)
    over, below = picture.axes[0], picture.axes[2]
    drawn = {line.get_label(): line.get_ydata() for line in over.get_lines()}
    assert np.array_equal(drawn["true"], result["X_plant_velocity"])
    assert np.array_equal(drawn["estimate"], result["X_velocity"])
    assert np.array_equal(below.get_lines()[0].get_ydata(), estimate_error(result, "X"))
    with pytest.raises(rds.InputError, match="no controller of this run has signals"):
        experiment({"name": "p"}).run("simulation").plot_signals()
