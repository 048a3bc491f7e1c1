"""Excitation design: what is predicted is what simulated fits then show, and no signal leaves the axis's limits."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.identification.fit.excitation import Design, Prediction, Task, design, make_task, predict
from rds.identification.fit.excitation_plot import excitation_picture
from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.structures import structure
from rds.machines import load_machine
from rds.references import make_signal, sample_voltage

NOISE = 0.002  # mm


@pytest.fixture(scope="module")
def task() -> Task:
    machine = load_machine("mini-cnc")
    values = {key: value for key, value in machine.axis("X").model.items() if key != "name"}
    return make_task(machine, "X", structure("axis"), values, 4.0, NOISE)


@pytest.fixture(scope="module")
def found(task: Task) -> Design:
    return design(task)


def realised(task: Task, prediction: Prediction, fits: int = 30) -> dict[str, float]:
    """Standard deviations over fits of as many simulated logs, in per cent."""
    u = sample_voltage(prediction.signal, 1e-3, task.samples)
    t = np.arange(task.samples) * 1e-3
    clean = task.structure.respond(t, u, [0.0, 0.0], task.values)
    values = []
    for seed in range(fits):
        draw = np.random.default_rng(seed)
        y = np.floor((clean + NOISE * draw.standard_normal(len(t))) / 1e-3 + draw.random()) * 1e-3
        log = Log("X", t, u, y, resolution=1e-3)
        values.append(fit([log], task.structure, "simulation", {"start": dict(task.values)}).values())
    return {
        name: 100.0 * float(np.std([v[name] for v in values], ddof=1)) / task.scale(name) for name in task.parameters
    }


@pytest.mark.parametrize("kind", ["staircase", "sinusoid", "multisine"])
def test_what_is_predicted_is_what_simulated_fits_show(task: Task, found: Design, kind: str) -> None:
    """Within 30 %; the standard deviation of 30 fits is itself known to 13 %."""
    prediction = next(p for p in found.ranked if p.signal.kind == kind)
    shown = realised(task, prediction)
    for name, percent in prediction.percent.items():
        assert shown[name] == pytest.approx(percent, rel=0.3), name


def test_the_best_signal_is_better_than_a_student_s_first_choice(task: Task, found: Design) -> None:
    """A square voltage of one size hardly tells gain from friction: two speeds, three unknowns."""
    usual = predict(task, make_signal("square", amplitude=2.0, frequency=1.0))
    assert usual.fits
    assert found.best.worst_percent < 0.02 * usual.worst_percent
    assert found.best.signal.kind != "square"


def test_all_ranked_signals_keep_to_travel_and_voltage(task: Task, found: Design) -> None:
    low, high = task.axis.travel
    for prediction in found.ranked:
        assert low < prediction.travel[0] <= prediction.travel[1] < high
        assert prediction.peak_voltage <= 9.0 + 1e-6
    worst = [prediction.worst_percent for prediction in found.ranked]
    assert worst == sorted(worst)
    assert {p.signal.kind for p in found.best_of_kinds()} == {"square", "sinusoid", "staircase", "multisine", "chirp"}


def test_twice_the_noise_is_twice_the_error(task: Task) -> None:
    signal = make_signal("sinusoid", amplitude=4.0, frequency=0.5)
    quiet, loud = (
        predict(make_task(task.machine, "X", task.structure, task.values, 4.0, n), signal) for n in (0.01, 0.02)
    )
    for name in task.parameters:
        assert loud.std_errors[name] / quiet.std_errors[name] == pytest.approx(2.0, rel=1e-2)


def test_a_signal_that_does_not_move_the_axis_tells_nothing(task: Task) -> None:
    assert predict(task, make_signal("sinusoid", amplitude=0.05, frequency=1.0)).worst_percent == np.inf


def test_what_cannot_be_is_refused_with_a_remedy(task: Task) -> None:
    with pytest.raises(InputError, match=r"duration = 1e\+308 s makes 1000000000000000000 samples"):
        make_task(task.machine, "X", task.structure, task.values, 1e308)
    with pytest.raises(InputError, match=r"duration = 0\.05 s makes 50 samples"):
        make_task(task.machine, "X", task.structure, task.values, 0.05)
    with pytest.raises(InputError, match="no axis 'Q'"):
        make_task(task.machine, "Q", task.structure, task.values)
    with pytest.raises(InputError, match="signal kind 'sawtooth' is not known"):
        design(task, ["sawtooth"])
    fast = make_task(task.machine, "X", task.structure, {**task.values, "K": 1e6}, 4.0)
    with pytest.raises(InputError, match=r"none of .* within 90% of its travel"):
        design(fast, ["square"])


def test_the_command_writes_an_experiment_that_runs(tmp_path: Path) -> None:
    out, plot = tmp_path / "x.toml", tmp_path / "x.png"
    kinds = ["--kind", "sinusoid", "--kind", "staircase"]
    given = [
        "excite",
        "mini-cnc",
        "--axis",
        "Y",
        "--duration",
        "2",
        *kinds,
        "-o",
        str(out),
        "--plot",
        str(plot),
        "--json",
    ]
    answer = CliRunner().invoke(app, given)
    assert answer.exit_code == 0, answer.output
    said = json.loads(answer.stdout)
    assert {"best", "candidates", "assumed", "tried"} <= set(said)
    written = tomllib.loads(out.read_text())
    assert written["mode"] == "system-test"
    assert written["signal"] == said["best"]["signal"]
    assert plot.read_bytes().startswith(b"\x89PNG")
    run = CliRunner().invoke(app, ["run", str(out), "--mode", "simulation", "--out", str(tmp_path / "run"), "--json"])
    assert run.exit_code == 0, run.output


@pytest.mark.parametrize(
    "words, message",
    [
        (["excite", "mini-cnc", "-o", "x.csv"], ".toml"),
        (["excite", "mini-cnc", "--plot", "x.pdf"], ".png"),
        (["excite", "nowhere"], "known machines"),
        (["excite", "mini-cnc", "--axis", "Q"], "no axis 'Q'"),
        (["excite", "mini-cnc", "--model", "none.toml"], "none.toml"),
        (["excite", "mini-cnc", "--noise", "-1"], "at least 0"),
    ],
)
def test_the_command_refuses_on_stderr(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 2
    assert message in answer.stderr
    assert not list(tmp_path.iterdir())


def test_the_picture_names_its_units(found: Design) -> None:
    labels = [axes.get_ylabel() for axes in excitation_picture(found).axes]
    assert labels == ["command [V]", "X position [mm]", "predicted standard error [%]"]


def test_an_axis_that_turns_is_designed_for_in_degrees() -> None:
    answer = CliRunner().invoke(app, ["excite", "mrm-lathe", "--axis", "C", "--duration", "4", "--kind", "sinusoid"])
    assert answer.exit_code == 0, answer.output
    text = " ".join(answer.output.split())
    assert "(deg/s)/V" in text and "mm/s" not in text
    turns = structure("axis", (), "deg")
    with pytest.raises(InputError, match="the model is of an axis in deg, and axis X of the machine is in mm"):
        make_task(load_machine("mini-cnc"), "X", turns, {"tau": 0.01, "K": 1.0}, 4.0)
