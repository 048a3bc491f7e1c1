"""`rds fit` as a script sees it, and models of the user's own."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.identification.fit.fit import fit
from rds.identification.fit.model_file import read_model
from rds.identification.logs.log import Log
from rds.identification.structures import student_structure
from rds.identification.structures.structures import structure
from tests.identification.fit_logs import axis_log, mini_cnc

X = mini_cnc("X")
FREE = X | {"friction_plus": 0.0, "friction_minus": 0.0}
OWN = """
from math import exp
params = {"tau": 0.02, "K": 1.0, "name": "mine"}
bounds = {"tau": (0.001, 1.0)}
units = {"tau": "s", "K": "(mm/s)/V"}

def advance(x, u, T, params):
    final, decay = params["K"] * u[0], exp(-T / params["tau"])
    position = x[0] + final * T + (x[1] - final) * params["tau"] * (1 - decay)
    return [position, final + (x[1] - final) * decay]
"""


def csv(path: Path, log: Log) -> Path:
    table = np.column_stack([log.time, log.command, log.position])
    np.savetxt(path, table, delimiter=",", header="time [s],voltage [V],position [mm]", comments="", fmt="%.9g")
    return path


def run(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["fit", *map(str, words)])
    return done.exit_code, done.stdout, done.stderr


def test_json_holds_what_is_promised_and_the_model_file_the_same(tmp_path: Path) -> None:
    log = csv(tmp_path / "x.csv", axis_log(X))
    code, out, _ = run(log, "--structure", "axis", "--json", "-o", tmp_path / "x.toml")
    said = json.loads(out)
    assert code == 0
    promised = {"parameters", "fit_percent", "rmse", "relative_error_percent", "warnings", "unidentifiable", "ahead"}
    assert promised <= set(said)
    for name, value in X.items():
        p = said["parameters"][name]
        assert set(p) == {"value", "std_error", "low", "high", "unit"}
        assert abs(p["value"] - value) < 4.0 * p["std_error"]
    read = read_model(tmp_path / "x.toml")
    assert read.values() == pytest.approx({name: p["value"] for name, p in said["parameters"].items()}, rel=1e-9)


def test_split_validates_on_what_was_not_fitted(tmp_path: Path) -> None:
    log = csv(tmp_path / "x.csv", axis_log(X))
    code, out, _ = run(log, "--structure", "axis", "--split", "--json")
    said = json.loads(out)
    assert code == 0
    assert said["logs"][0]["end"] == 6000
    assert next(iter(said["validation"]["logs"].values()))["samples"] == 4000


def test_the_report_is_a_page_with_a_picture_for_each_log(tmp_path: Path) -> None:
    logs = []
    for seed in (1, 2):  # files of one name in two folders
        (tmp_path / str(seed)).mkdir()
        logs.append(csv(tmp_path / str(seed) / "x.csv", axis_log(X, seed=seed, seconds=2.0)))
    code, out, _ = run(*logs, "--structure", "axis", "--report", tmp_path / "page")
    assert code == 0
    assert "friction_minus" in out and "free run" in out and "100 ahead" in out
    page = (tmp_path / "page" / "fit.html").read_text()
    assert page.count("<img") == 2 and "To doubt" in page and "<h2>x (1)</h2>" in page and "<h2>x (2)</h2>" in page
    assert sorted(path.name for path in (tmp_path / "page").glob("*.png")) == ["fit-1.png", "fit-2.png"]


def test_parameters_that_are_not_to_be_used_are_exit_code_1_and_what_uses_them_says_so(tmp_path: Path) -> None:
    good, file = axis_log(X), tmp_path / "x.toml"
    code, _, err = run(csv(tmp_path / "x.csv", replace(good, position=-good.position)), "-s", "axis", "-o", file)
    assert code == 1 and "moves against its command" in err
    words = ["machine", "from", str(file), "--axis", "X", "-o", str(tmp_path / "m.toml")]
    used = CliRunner().invoke(app, words)
    assert used.exit_code == 0 and "do not use these parameters" in used.stderr


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["--structure", "axle"], "there is no structure 'axle'"),
        (["--structure", "axis", "--option", "stribek"], "no option 'stribek'"),
        (["--structure", "axis", "--method", "guess"], "there is no method 'guess'"),
        (["--structure", "axis", "--fix", "tau"], "must be NAME=VALUE"),
        (["--structure", "axis", "--fix", "mass=1"], "no option 'mass'"),
        (["--structure", "axis", "--free", "tau"], "--free is for a model of your own"),
        (["--structure", "axis", "--method", "step", "--fix", "tau=0.01"], "is for --method simulation"),
        (["--structure", "axis", "-o", "x.json"], "ends in .toml"),
        (["--structure", "absent.py"], "there is no such file"),
    ],
)
def test_what_will_not_do_is_refused_in_a_sentence(tmp_path: Path, words: list[str], sentence: str) -> None:
    code, out, err = run(csv(tmp_path / "x.csv", axis_log(X, seconds=1.0)), *words)
    assert (code, out) == (2, "")
    assert sentence in " ".join(err.split())


def test_a_model_of_one_s_own_has_its_params_estimated(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    log = csv(tmp_path / "x.csv", axis_log(FREE, seconds=1.0))
    code, out, _ = run(log, "--structure", tmp_path / "own.py", "--json", "-o", tmp_path / "own.toml")
    said = json.loads(out)
    assert code == 0
    assert list(said["parameters"]) == ["tau", "K"]
    for name in ("tau", "K"):
        assert abs(said["parameters"][name]["value"] - X[name]) < 4.0 * said["parameters"][name]["std_error"]
    assert said["parameters"]["tau"]["unit"] == "s"
    code, out, _ = run(log, "--structure", tmp_path / "own.py", "--free", "K", "--json")
    assert json.loads(out)["parameters"]["tau"] == {
        "value": 0.02,
        "std_error": 0.0,
        "low": 0.02,
        "high": 0.02,
        "unit": "s",
    }


def test_derivatives_are_integrated_as_coarsely_as_the_noise_allows(tmp_path: Path) -> None:
    path = tmp_path / "smooth.py"
    path.write_text(
        'params = {"tau": 0.012, "K": 1.5}\n'
        "def derivatives(t, x, u, params):\n"
        '    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]\n'
    )
    log = replace(axis_log(FREE, seconds=0.6), units={"position": "deg", "command": "A"})
    estimate = fit([log], structure(path))
    assert (estimate.output_unit, estimate.command_unit) == ("deg", "A")  # those of the log, as for any structure
    found = estimate.parameters
    for name in ("tau", "K"):
        assert abs(found[name].value - X[name]) < 4.0 * found[name].std_error


def test_a_model_that_refuses_a_value_is_told_with_it(tmp_path: Path) -> None:
    path = tmp_path / "picky.py"
    path.write_text(
        'params = {"tau": 0.012, "K": 1.0}\n'
        "def derivatives(t, x, u, params):\n"
        '    if params["K"] > 1.2:\n'
        '        raise ValueError("too strong")\n'
        '    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]\n'
    )
    with pytest.raises(
        InputError, match=r"the model fails with tau = .*, K = .*too strong.*; correct it, or give bounds"
    ):
        fit([axis_log(FREE, seconds=0.2)], structure(path))


def test_how_coarsely_is_not_told_by_an_axis_at_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(student_structure, "_TRIED", 100)
    path = tmp_path / "stiff.py"
    path.write_text(
        'params = {"tau": 0.0003, "K": 1.5}\n'
        "def derivatives(t, x, u, params):\n"
        '    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]\n'
    )
    log = axis_log(FREE, seconds=0.3)
    log = replace(log, command=np.where(log.time < 0.15, 0.0, log.command))
    made = structure(path)
    assert made.prepare is not None
    begun = {"tau": 0.0003, "K": 1.5}  # one Runge-Kutta step in a sample is unstable
    assert np.abs(made.prepare([log]).respond(log.time, log.command, (0.0, 0.0), begun)).max() < 10.0  # mm


@pytest.mark.parametrize(
    "text, sentence",
    [
        (OWN.replace('"tau": 0.02, "K": 1.0, ', ""), "params holds no number"),
        (OWN.replace("(0.001, 1.0)", "0.001"), "must be two numbers"),
        (OWN.replace('{"tau": (0.001, 1.0)}', '{"mass": (0, 1)}'), "bounds names 'mass'"),
        (OWN.replace("(0.001, 1.0)", "(0.1, 1.0)"), "lies outside its bounds"),
        (OWN.replace("exp(-T", "expo(-T"), "NameError"),
    ],
)
def test_files_that_cannot_be_fitted_are_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "own.py"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        fit([axis_log(FREE, seconds=0.3)], structure(path))


def test_a_fit_without_a_structure_names_those_that_there_are(tmp_path: Path) -> None:
    found = CliRunner().invoke(app, ["fit", str(csv(tmp_path / "log.csv", axis_log(X)))])
    assert found.exit_code == 2
    assert "give a --structure: axis, axis-mass, axis-inertia, spindle, or a model of your own" in found.stderr
