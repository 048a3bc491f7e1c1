"""What a validation leaves: JSON, a page with pictures, the command's answer and exit code, a run's own validation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.core.figure import Picture
from rds.identification.fit.estimate import Errors, Estimate, Parameter
from rds.identification.fit.made_estimate import fitted_stretch
from rds.identification.fit.model_file import write_model
from rds.identification.logs.log import Log
from rds.identification.validate.validate import validate
from rds.modes.experiment.report import save_with_report
from rds.modes.experiment.validation import validated
from rds.results import Result
from rds.results.report import report
from tests.validation.validation_logs import STEP, T, X, candidate, log, moved, square

STUDENT = """
params = {"tau": 9.943e-3, "K": 1.764}
initial_state = [0.0, 0.0]


def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]
"""


def result_of(u: np.ndarray, axes: tuple[str, ...] = ("X",)) -> Result:
    columns: dict[str, Any] = {"time": np.arange(len(u)) * T}
    for axis in axes:
        columns |= {f"{axis}_voltage": u, f"{axis}_measured": moved(u)}
    meta = {"axes": list(axes), "sample_period": T, "mode": "system-test", "machine": "mini-cnc", "notes": []}
    return Result(columns, meta=meta)


def saved(folder: Path, name: str, u: np.ndarray, axes: tuple[str, ...] = ("X",)) -> Path:
    return result_of(u, axes).save(folder / f"{name}.csv")


def model_file(path: Path, fitted: Log | None = None, values: Mapping[str, float] = X) -> Path:
    made = candidate(values).structure
    parameters = {
        name: Parameter(
            value, 1e-3 * abs(value), value - 2e-3 * abs(value), value + 2e-3 * abs(value), made.units[name]
        )
        for name, value in values.items()
    }
    errors = {fitted.name: Errors(99.9, STEP / 3, STEP, "mm")} if fitted else {}
    covariance = np.diag([p.std_error**2 for p in parameters.values()])
    logs = (fitted_stretch(fitted),) if fitted else ()
    return write_model(path, Estimate("axis", (), "simulation", parameters, covariance, (), {}, errors, {}, logs))


def rds(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["validate", *map(str, arguments)])


def test_the_command_on_new_data_and_on_the_fit_s_own(tmp_path: Path) -> None:
    own, fresh = saved(tmp_path, "own", square(6.0)), saved(tmp_path, "fresh", square(6.0, 2.5, 0.7))
    from rds.identification.logs.read_log import read_log

    (first,) = read_log(own)
    model = model_file(tmp_path / "m.toml", first)
    good = rds(model, fresh, "--json")
    assert good.exit_code == 0, good.output
    answer = json.loads(good.stdout)
    assert answer["verdict"] in ("valid", "valid for") and answer["model"]["name"] == "m"
    numbers = answer["logs"]["fresh"]
    assert numbers["free_run"]["fit_percent"] > 99.9 and numbers["free_run"]["unit"] == "mm"
    assert set(numbers["ahead"]) == {"1", "10", "100"} == set(numbers["without_model"])
    assert numbers["seen_by_fit"] == {"share": 0.0, "how": "other data than the fit's", "known": True}
    assert numbers["ranges"]["command"]["fitted"] == pytest.approx(list(fitted_stretch(first)["command"]))
    again = rds(model, own, "--json")
    assert again.exit_code == 1
    assert json.loads(again.stdout)["verdict"] == "cannot tell"
    assert "validate on another log" in rds(model, own).stdout


def test_a_copy_of_the_fit_s_data_in_another_format_is_known(tmp_path: Path) -> None:
    from rds.identification.logs.read_log import read_log

    (first,) = read_log(saved(tmp_path, "own", square(6.0)))
    model = model_file(tmp_path / "m.toml", first)
    copy = tmp_path / "copy.csv"
    rows = np.column_stack([first.time, first.command, first.position])
    np.savetxt(copy, rows, delimiter=",", header="time [s],command [V],position [mm]", comments="", fmt="%.7g")
    answer = json.loads(rds(model, copy, "--json").stdout)
    assert answer["verdict"] == "cannot tell"
    (reason,) = [reason["what"] for reason in answer["reasons"] if reason["side"] == "cannot tell"]
    assert "holds the same numbers" in reason


def test_a_student_s_file_and_others_against_it(tmp_path: Path) -> None:
    data = saved(tmp_path, "data", square(2.0))
    (tmp_path / "mine.py").write_text(STUDENT)
    answer = rds(tmp_path / "mine.py", data, "--against", model_file(tmp_path / "m.toml"), "--json")
    assert json.loads(answer.stdout)["verdict"] == "not valid" and answer.exit_code == 1
    assert "its friction is too low" in json.loads(answer.stdout)["sentence"]
    (ranking,) = json.loads(answer.stdout)["comparison"].values()
    assert [row["name"] for row in ranking["ranks"]] == ["m", "mine.py"]
    assert ranking["ranks"][0]["aicc_weight"] > 0.999


def test_the_page_holds_verdict_numbers_and_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    png, drawn = Picture.png, []
    monkeypatch.setattr(Picture, "png", lambda self: drawn.append(self) or png(self))  # type: ignore[func-returns-value]
    bare = candidate(X | {"friction_plus": 0.0, "friction_minus": 0.0}, name="<b>bare</b>")
    found = validate(candidate(name="<i>full</i>", share=1e-3), log(square(4.0), name="a/b"), against=[bare])
    files = found.write(tmp_path / "report")
    names = [path.name for path in files]
    assert names[:2] == ["validation.html", "validation.json"]
    assert "a_b-overlay.png" in names and "a_b-friction-curve.png" in names
    page = files[0].read_text()
    assert "<i>" not in page and "&lt;i&gt;full&lt;/i&gt;" in page
    assert page.count("data:image/png;base64") == 5 == len(drawn)  # the files' and the page's are the same
    for words in ("free run, position", "10 samples ahead", "RMSE without a model", "AICc", "voltage error [%]"):
        assert words in page
    assert json.loads(files[1].read_text())["verdict"] == str(found.verdict.word)
    assert found.verdict.sentence.split()[0] in str(found)
    assert "data:image" not in found._repr_html_()


def test_a_report_of_what_can_not_be_drawn_is_still_written(tmp_path: Path) -> None:
    found = validate(candidate(), log(np.zeros(1000)))
    assert (tmp_path / "validation.html") in found.write(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("missing.toml", "data.csv"), "missing.toml"),
        (("m.toml", "missing.csv"), "missing.csv"),
        (("m.csv", "data.csv"), "a model is a model file"),
        (("m.toml", "data.csv", "--band", "fit=3"), "there is no band 'fit'"),
        (("m.toml", "data.csv", "--band", "fit_percent"), "must be NAME=VALUE"),
        (("m.toml", "data.csv", "--band", "fit_percent=1", "--band", "fit_percent=2"), "is given twice"),
        (("m.toml", "data.csv", "--initial-samples", "2"), "must be at least 10"),
        (("m.toml", "data.csv", "--axis", "Q"), "it holds no axis 'Q'"),
        (("m.toml", "both.csv"), "say which with --axis"),
        (("other.toml", "data.csv"), "friction_plus, which is missing"),
    ],
)
def test_bad_input_is_a_sentence_and_exit_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    data = "both.csv" if "both.csv" in arguments or "--axis" in arguments else "data.csv"
    saved(tmp_path, data.removesuffix(".csv"), square(1.0), ("X", "Y") if data == "both.csv" else ("X",))
    if "--axis" in arguments:
        arguments = tuple("both.csv" if a == "data.csv" else a for a in arguments)
    model_file(Path("m.toml"))
    Path("other.toml").write_text(
        'structure = "axis"\nparameters.tau = {value = 0.01, unit = "s"}\n'
        'parameters.K = {value = 1.0, unit = "(mm/s)/V"}\n'
    )
    found = rds(*arguments)
    assert found.exit_code == 2, found.output
    assert said in found.stderr and "Traceback" not in found.output


def test_the_axis_of_a_log_of_several_is_chosen(tmp_path: Path) -> None:
    both = saved(tmp_path, "both", square(4.0), ("X", "Y"))
    answer = rds(model_file(tmp_path / "m.toml"), both, "--axis", "Y", "--json")
    assert list(json.loads(answer.stdout)["logs"]) == ["both:Y"]


def test_a_run_that_validates_carries_its_verdict_into_report_and_files(tmp_path: Path) -> None:
    import rds as package

    model_file(tmp_path / "m.toml")
    experiment = package.Experiment(
        mode="model-validation",
        duration=4.0,
        signal=package.square(amplitude=3.0, frequency=1.0),
        model={"file": str(tmp_path / "m.toml")},
    )
    result = validated(experiment.plan(), result_of(square(4.0)))
    assert result.validation["X"].candidate.estimated == tuple(X)  # of the file's record, not the values alone
    assert result.meta["validation"]["X"]["logs"]["this run"]["free_run"]["fit_percent"] > 99.9
    result.save(tmp_path / "out")
    files = save_with_report(result, tmp_path / "out", "validation")
    assert "Validation of the model of X" in files["report"].read_text()
    reopened = Result.open(tmp_path / "out")
    assert reopened.meta["validation"]["X"]["verdict"] == result.meta["validation"]["X"]["verdict"]


def test_a_run_too_short_to_validate_says_so() -> None:
    import rds as package

    experiment = package.Experiment(
        mode="model-validation", duration=0.01, signal=package.square(amplitude=3.0, frequency=100.0)
    )
    result = validated(experiment.plan(), result_of(square(0.01)))
    assert "validation" not in result.meta
    assert "the model of X is not validated" in result.meta["notes"][0]


def test_what_is_no_model_is_refused() -> None:
    with pytest.raises(InputError, match="is no model; give the path of a model file"):
        validate(3.0, log(square(1.0)))


def test_a_report_without_sections_is_what_it_was() -> None:
    assert "Validation of" not in report("t", [result_of(square(0.1))])


@pytest.mark.parametrize("samples", [0, 1])
def test_a_run_that_was_killed_at_its_first_sample_keeps_its_result(samples: int) -> None:
    import rds as package

    experiment = package.Experiment(
        mode="model-validation", duration=0.01, signal=package.square(amplitude=3.0, frequency=100.0)
    )
    whole = result_of(square(0.01))
    result = Result({name: values[:samples] for name, values in whole.columns.items()}, whole.units, whole.meta)
    assert validated(experiment.plan(), result) is result and "validation" not in result.meta
    assert f"no model is validated: result: it has {samples} sample" in result.meta["notes"][-1]
