"""Simulations end to end: what a student hands in and gets back."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

import rds
from rds.controllers.tracking import is_stable_on_a_bus
from rds.core.types import Reference
from rds.modes.experiment.outcome import outcome
from rds.modes.loop.stopwatch import TIMING_COLUMNS
from rds.modes.process.host import run_plan

GOOD: dict[str, Any] = {"duration": 0.5, "reference": rds.sinusoid(2.0, 2.0), "controller": "p"}


def law(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
    return 20.0 * (r.position - y), state


def test_columns_in_order_with_units_and_what_is_known() -> None:
    result = rds.Experiment(**GOOD, title="First").run()
    assert list(result.columns) == [
        *("time", "X_reference", "X_reference_velocity", "X_reference_acceleration"),
        *("X_measured", "X_command", "X_voltage"),
    ]
    assert [result.units[name] for name in result.columns] == ["s", "mm", "mm/s", "mm/s²", "mm", "V", "V"]
    assert (result["time"] == np.arange(500) * 0.001).all()
    assert result.meta["versions"]["numpy"] == np.__version__
    assert result.meta["model"]["X"]["params"]["tau"] == pytest.approx(9.943e-3)
    assert result.meta["period"] == {"X": 0.5}
    assert result.verdict is None
    assert "timing" not in result.meta


def test_the_controller_in_every_way_gives_the_same(alone: Path) -> None:
    (alone / "my.py").write_text(
        "params = {'gain': 20.0}\n"
        "def control(t, r, y, state, params):\n    return params['gain'] * (r.position - y), state\n"
    )
    ways: list[Any] = [
        law,
        {"control": law},
        rds.Controller(law),
        "my.py",
        {"file": "my.py"},
        {"file": str(alone / "my.py"), "params": {"gain": 20}},
        control.ss([], [], [], [[20.0]], dt=True),
        {"name": "p", "Pgain": 20.0},
    ]
    results = [rds.Experiment(**(GOOD | {"controller": way})).run() for way in ways]
    for result in results[:-1]:
        assert np.abs(result["X_measured"] - results[0]["X_measured"]).max() < 1e-9
    assert results[3].meta["controller"]["X"]["name"] == "my.py"
    assert len(results[3].meta["controller"]["X"]["sha256"]) == 64
    assert results[0].meta["controller"]["X"]["source"].startswith("def law")


def test_runs_do_not_share_their_state() -> None:
    start = [0]

    def counts(t: float, r: Any, y: float, state: list[int], params: dict[str, Any]) -> Any:
        return float(state[0] % 3), [state[0] + 1]

    experiment = rds.Experiment(**(GOOD | {"controller": rds.Controller(counts, start)}))
    first, second = experiment.run(), experiment.run()
    assert (first["X_command"] == second["X_command"]).all()
    assert start == [0]


def test_a_spindle_follows_its_speed() -> None:
    reference = {"kind": "constant", "value": 3000.0}
    speed = rds.Experiment(axis="spindle", duration=2.0, reference=reference, controller="pid").run()
    assert speed.units["spindle_measured"] == "rev/min"
    assert speed["spindle_measured"][-1] == pytest.approx(3000.0, abs=2.0)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("derivatives", r"the model's position became (nan|inf).*must stay finite"),
        ("advance", r"test_simulation.py, line \d+, in advance: ZeroDivisionError: division by zero: `return 1 / 0`"),
        ("size", r"returned .*it must return dx/dt, 2 numbers"),
    ],
)
@pytest.mark.parametrize("quantization", [True, False])
def test_faults_of_a_model_are_not_the_controller_s(what: str, said: str, quantization: bool) -> None:
    def derivatives(t: float, x: Any, u: Any, params: Any) -> Any:
        return [x[1] * 1e200, 1e200 * (1.0 + abs(x[1]))]

    def advance(x: Any, u: Any, T: float, params: Any) -> Any:
        return 1 / 0

    def size(t: float, x: Any, u: Any, params: Any) -> Any:
        return [1.0, 2.0] if not x.any() and t == 0 else [1.0, 2.0, 3.0]

    models = {"derivatives": derivatives, "advance": advance, "size": {"derivatives": size}}
    own = rds.Experiment(**GOOD, model=models[what], interface={"quantization": quantization})
    with np.errstate(all="ignore"), pytest.raises(rds.ContractError, match=said) as refusal:
        own.run()
    assert "(at t = 0.00" in str(refusal.value)


def test_the_student_s_file_and_line_are_named(alone: Path) -> None:
    (alone / "helper.py").write_text("def divide(a, b):\n    return a / b\n")
    (alone / "my.py").write_text(
        "from helper import divide\n\ndef control(t, r, y, state, params):\n    return divide(1.0, 0.1 - t), state\n"
    )
    own = rds.Experiment(**(GOOD | {"controller": "my.py"}))
    with pytest.raises(rds.ContractError, match=r"helper.py, line 2, in divide: ZeroDivision.*\(at t = 0.100 s\)"):
        own.run()
    (alone / "my.py").write_text("def control(t, r, y, state, params):\n    return None\n")
    with pytest.raises(rds.ContractError, match=r"my.py: control\(\) returned None at t = 0.000 s \(axis X\)"):
        rds.Experiment(**(GOOD | {"controller": "my.py"})).run()


def test_progress_is_told_and_ctrl_c_is_the_user_s() -> None:
    told: list[tuple[int, int]] = []
    rds.Experiment(**(GOOD | {"duration": 12.0})).run(progress=lambda done, of: told.append((done, of)))
    assert told == [(5000, 12000), (10000, 12000), (12000, 12000)]

    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rds.Experiment(**(GOOD | {"controller": rds.Controller(interrupted)})).run()


def test_results_are_saved_only_where_asked(alone: Path) -> None:
    rds.Experiment(**GOOD).run()
    assert list(alone.iterdir()) == []
    result = rds.Experiment(**GOOD).run(out=alone / "a" / "b")
    assert (rds.open_result(alone / "a" / "b")["X_measured"] == result["X_measured"]).all()
    result = rds.Experiment(**GOOD).run(out=alone / "kp-1.5")  # the run was made, and then its folder refused
    assert len(rds.open_result(alone / "kp-1.5")["time"]) == len(result["time"])
    assert result.save(alone / "kp-2.0mm").is_dir() and result.save(alone / "kp-1.5") == alone / "kp-1.5"
    with pytest.raises(rds.InputError, match=r"unknown suffix '\.xlsx'"):
        result.save(alone / "result.xlsx")
    (alone / "file").write_text("")
    with pytest.raises(rds.InputError, match="file"):
        rds.Experiment(**GOOD).run(out=alone / "file")
    assert (alone / "file").read_text() == ""


def test_every_public_name_is_there() -> None:
    assert all(getattr(rds, name) is not None for name in rds.__all__)
    assert set(rds.__all__) <= set(dir(rds))
    with pytest.raises(AttributeError, match="has no attribute 'Experment'"):
        rds.Experment  # noqa: B018


def test_parameters_that_no_file_can_hold_are_kept_as_texts(tmp_path):
    (tmp_path / "law.py").write_text(
        "params = {'nan': float('nan'), 'long': 10**5000, 'big': 10**50, 'half': '\\ud800', 'P': 20.0}\n"
        "def control(t, r, y, state, params):\n    return params['P'] * (r.position - y), state\n"
    )
    (tmp_path / "e.toml").write_text(
        "axis = 'X'\nduration = 0.1\n[reference]\nkind = 'sinusoid'\namplitude = 1.0\nfrequency = 5.0\n"
        "[controller]\nfile = 'law.py'\n"
    )
    from rds.modes.experiment.report import run_and_save

    _, files = run_and_save(tmp_path / "e.toml", None, tmp_path / "out", None)
    for kind in ("csv", "mat", "parquet"):
        kept = rds.open_result(files[kind]).meta["controller"]["X"]["params"]
        assert {key: kept[key] for key in ("long", "big", "P")} == {"long": "a int", "big": 10**50, "P": 20.0}
    assert "\\ud800" in files["report"].read_text()


def test_a_file_that_changes_the_folder_changes_nobody_else_s(alone: Path) -> None:
    (alone / "elsewhere").mkdir()
    change = "os.chdir(os.path.join(os.path.dirname(__file__), 'elsewhere'))"
    (alone / "law.py").write_text(
        f"import os\n{change}\ndef control(t, r, y, state, params):\n    {change}\n    return r.position - y, state\n"
    )
    (alone / "e.toml").write_text(
        "axis = 'X'\nduration = 0.1\n[reference]\nkind = 'sinusoid'\namplitude = 1.0\nfrequency = 5.0\n"
        "[controller]\nfile = 'law.py'\n"
    )
    from rds.modes.experiment.report import run_and_save

    for out in (Path("out"), None):
        _, files = run_and_save(Path("e.toml"), None, out, None)
        assert files["report"].exists() and Path.cwd() == alone.resolve()
    assert not list((alone / "elsewhere").iterdir())


def test_a_run_s_tables_are_written_once(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rds.modes.experiment.report import run_and_save
    from rds.results import save_all

    written: list[Any] = []
    monkeypatch.setattr(
        "rds.modes.experiment.experiment.save_all",
        lambda result, folder: written.append(folder) or save_all(result, folder),
    )
    (alone / "e.toml").write_text(
        "axis = 'X'\nduration = 0.1\nmode = 'simulation'\n[reference]\nkind = 'sinusoid'\n"
        "amplitude = 1.0\nfrequency = 5.0\n[controller]\nname = 'p'\n"
    )
    _, files = run_and_save(Path("e.toml"), None, Path("out"), None)
    assert written == [Path("out")]
    assert all(path.is_file() for path in files.values())
    assert set(files) == {"csv", "json", "mat", "parquet", "plot_X", "report"}


def test_what_a_machine_did_is_kept_where_the_run_cannot_be_simulated() -> None:
    """The law of a model with the wrong sign gives up; beside the machine it did not."""

    def control(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        assert abs(y) < 3.0, "beyond the work"
        return 30.0 * (r.position - y), state

    words = GOOD | {"controller": control}
    rows = run_plan(rds.Experiment(**words).plan(), None)
    wrong = rds.Experiment(**words, model={"name": "linear-axis", "tau": 0.01, "K": -1.0}).plan()
    report = {"drivers": {}, "environment": {}}
    timed = np.insert(rows.values, [1] * len(TIMING_COLUMNS), 0.0, axis=1)
    columns = [rows.columns[0], *TIMING_COLUMNS, *rows.columns[1:]]
    of_machine = replace(rows, columns=columns, values=timed, report=report)
    result = outcome(replace(wrong, mode="implementation"), of_machine, {"period": {"X": 0.5}})
    assert (result["X_measured"] == rows.values[:, rows.columns.index("X_measured")]).all()
    assert "X_simulated" not in result
    (note,) = (note for note in result.meta["notes"] if "has no response to compare with" in note)
    assert "AssertionError: beyond the work" in note


def test_another_model_takes_the_place_of_the_axis_s_own() -> None:
    own = {"controller": "p", "model": {"name": "linear-axis", "tau": 0.02, "K": 1.0}}
    experiment = rds.Experiment(axis="X", duration=0.5, reference=rds.sinusoid(2.0, 2.0), overrides={"X": own})
    other = experiment.with_model({"name": "linear-axis", "tau": 0.01, "K": 3.0})
    assert [each.plan().axes[0].model.params["K"] for each in (experiment, other)] == [1.0, 3.0]
    with pytest.raises(rds.InputError, match="it has several axes"):
        rds.Experiment(**GOOD, axis=("X", "Y")).with_model("linear-axis")


@pytest.mark.parametrize(("coupled", "owner"), [(False, "X"), (True, "X, Y")])
def test_a_state_that_became_nan_behind_a_finite_voltage_is_told(coupled: bool, owner: str) -> None:
    def lost(t: float, r: Any, y: Any, state: Any, params: Any) -> Any:
        return (np.zeros(2) if coupled else 0.0), [state[0] + (np.nan if t > 0.1 else 1.0)]

    def notes(first: float) -> list[str]:
        controller = rds.Controller(lost, [first], coupled=coupled)
        axis = {"axis": ("X", "Y")} if coupled else {}
        return rds.Experiment(**(GOOD | {"controller": controller} | axis)).run().meta["notes"]

    (note,) = notes(0.0)
    assert note.startswith(f"the state of the controller of {owner} holds NaN at the end of the run")
    assert notes(np.nan) == []  # it is meant so


@pytest.mark.parametrize("kind", ["holds itself", "names the two before", "fails to show its values"])
def test_looking_for_nan_in_a_state_takes_no_time_and_does_not_fail(kind: str) -> None:
    class Failing(dict[str, Any]):
        def values(self) -> Any:
            raise RuntimeError("no")

    def law(t: float, r: Any, y: Any, state: Any, params: Any) -> Any:
        if kind == "holds itself":
            following: Any = [1.0]
            following += [following, following]
        elif kind == "names the two before":
            following = {"last": state, "before": state and state["last"]}
        else:
            following = Failing(last=1.0)
        return 0.0, following

    begun = time.monotonic()
    assert rds.Experiment(**(GOOD | {"controller": rds.Controller(law)})).run().meta["notes"] == []
    assert time.monotonic() - begun < 10.0  # by way of each path to a value it takes years


@pytest.mark.parametrize("law", ["tracking", "feedforward", "zero-phase"])
def test_a_loop_that_a_bus_makes_unstable_is_refused_before_the_run(law: str, alone: Path) -> None:
    slow = GOOD | {"controller": law, "sample_period": 0.05}
    assert abs(rds.Experiment(**slow).run()["X_measured"]).max() < 4.0  # one sample less of delay
    with pytest.raises(rds.InputError, match=r"acts one sample of 0\.05 s later than in a simulation"):
        rds.Experiment(**slow, mode="implementation").run()


def test_a_law_that_gives_way_to_a_drive_is_not_refused_for_the_delay_of_a_bus() -> None:
    bus = {"dialect": "cia402", "cia402": {"mode": "csp"}}
    words = {"controller": "tracking", "sample_period": 0.05, "reference": {"kind": "constant", "value": 0.0}}
    (axis,) = rds.Experiment(**GOOD | words, bus=bus).plan("implementation").axes
    assert axis.controller is not None and axis.controller.source.name == "the drive's position loop"


def test_the_delay_of_a_bus_as_the_loop_of_the_law_has_it() -> None:
    """The network between model and law delays by one sample, as a bus does: stable at 0.03 s, not at 0.04 s."""
    for T in (0.03, 0.04):
        law = rds.library_controller("tracking", {"tau": 0.009943, "K": 1.764}, T, 1e9)
        x = v = 0.0
        held, state, largest = 0.0, law.initial_state, []
        a22 = np.exp(-T / 0.009943)
        for k in range(400):
            u, state = law.control(k * T, Reference(1.0, 0.0, 0.0), x, state, law.params)
            a12 = 0.009943 * (1.0 - a22)
            x, v = x + a12 * v + 1.764 * (T - a12) * held, a22 * v + 1.764 * (1.0 - a22) * held
            held = u
            largest.append(abs(x - 1.0))
        is_stable = bool(max(largest[-20:]) < 0.01)
        assert is_stable_on_a_bus(law.params["coefficients"], T) is is_stable is (T < 0.035)
