"""`rds validate`: a model against logs that it has not seen, and the verdict."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, named_values, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.logs import read_logs

if TYPE_CHECKING:
    from rds.core.types import Model
    from rds.identification.logs.log import Log
    from rds.identification.validate.cross_test import CrossTestResult
    from rds.identification.validate.in_loop import Loop
    from rds.identification.validate.validate import Validation
    from rds.results import Result


@writes_files
def validate(
    model: Annotated[Path, typer.Argument(help="A model file (.toml), or a student's file (.py) with its params.")],
    logs: Annotated[list[Path], typer.Argument(help="Logs, other than the fit's: CSV, MAT, Parquet, results.")],
    against: Annotated[
        list[Path] | None, typer.Option("--against", help="Another model, to be compared on the same logs; repeatable.")
    ] = None,
    map_: Annotated[Path | None, typer.Option("--map", help="What the logs' columns mean, a TOML file.")] = None,
    axis: Annotated[str | None, typer.Option("--axis", help="The axis, where a log holds several.")] = None,
    band: Annotated[
        list[str] | None, typer.Option("--band", metavar="NAME=VALUE", help="A band of the verdict; repeatable.")
    ] = None,
    initial_samples: Annotated[
        int | None, typer.Option("--initial-samples", help="Samples from which the initial state is estimated.")
    ] = None,
    loop: Annotated[
        Path | None, typer.Option("--loop", help="The experiment that was logged: simulated with the model, too.")
    ] = None,
    forces: Annotated[
        bool, typer.Option("--forces", help="The cross-test by inverse dynamics: the model's force error on each log.")
    ] = False,
    report: Annotated[Path | None, typer.Option("--report", help="Folder for the page, its pictures and JSON.")] = None,
    json: Json = False,
) -> None:
    """Validate a model on logs. Exit code 0: valid, or valid for what it says; 1: not valid, or cannot tell."""
    with refusals(), stdout_kept(json):
        from rds.identification.validate.validate import validate as validate_model
        from rds.identification.validate.verdict import Bands

        bands = Bands.read(named_values(band or (), "--band", "fit_percent=80"))
        with progress_bars() as bar:
            found = read_logs(logs, map_, axis, bar)
        made = validate_model(
            model,
            found,
            against=against or (),
            bands=bands,
            initial_samples=initial_samples,
            loop=_loop(loop) if loop else None,
        )
        crossed = _crossed(made, found) if forces else []
        files = made.write(report) if report is not None else []
    if json:
        said = {"cross_test": [each.to_json() for each in crossed]} if forces else {}
        print_json(made.to_json() | said | {"files": [str(path) for path in files]})
    else:
        _show_crossed(crossed)
        _show(made)
        if files:
            typer.echo(f"report: {files[0]}")
    raise typer.Exit(made.exit_code)


def _loop(path: Path) -> Loop:
    """Runs the experiment in simulation, with another model."""
    from rds.core.toml_file import read_toml
    from rds.modes import SIMULATION
    from rds.modes.experiment.experiment import Experiment

    words, _ = read_toml(path)

    def simulate(model: Model) -> Result:
        table = words | {"mode": SIMULATION, "model": model}
        return Experiment.from_table(table, path.resolve().parent).run()

    return simulate


def _crossed(made: Validation, logs: list[Log]) -> list[CrossTestResult]:
    from rds.identification.validate.cross_test import cross_test

    return cross_test(made.candidate, logs)


def _show_crossed(crossed: list[CrossTestResult]) -> None:
    from rds.cli.console import show_table

    if not crossed:
        return
    rows = [
        [
            each.log,
            f"{each.percent:.4f}",
            f"{each.fitted_percent:.4f}",
            "" if each.published_percent is None else f"{each.published_percent:.4f} ({each.published_by})",
        ]
        for each in crossed
    ]
    heads = ["log", "force error %", "of a fit to this log %", "published fit to this log %"]
    note = "Inverse dynamics with the model's parameters, none of them estimated here: 100 |force - model| / |force|."
    show_table("Cross-test", heads, rows, note)


def _weight(value: float) -> str:
    return f"{value:.3f}" if isfinite(value) else "–"


def _show(made: Validation) -> None:
    from rds.cli.console import cell, show_table
    from rds.identification.validate.criterion import known

    for name, a in made.assessments.items():
        errors = {"free run": a.free_run, "free run, velocity": a.velocity}
        errors |= {f"{k} ahead": e for k, e in a.ahead.items()}
        rows = [
            [what, f"{e.fit_percent:.2f}", cell(e.rmse), cell(e.maximum), e.unit] for what, e in errors.items() if e
        ]
        note = (
            f"Initial state estimated from the first {a.first} samples, which no error counts; "
            f"{len(a.log)} samples of {a.log.sample_period:.6g} s. {a.overlap.how[0].upper()}{a.overlap.how[1:]}."
        )
        show_table(f"{made.candidate.name} on {name}", ["prediction", "fit %", "RMSE", "max", "unit"], rows, note)
    for name, ranking in made.rankings.items():
        rows = [
            [
                *(r.name, str(r.counted), cell(known(r.rmse))),
                *(cell(known(r.aicc_difference)), _weight(r.aicc_weight)),
                *(cell(known(r.bic_difference)), _weight(r.bic_weight)),
            ]
            for r in ranking.ranks
        ]
        columns = ["model", "k", "RMSE", "AICc - best", "weight", "BIC - best", "weight"]
        show_table(f"Models compared on {name}", columns, rows, " ".join(ranking.warnings))
    verdict = made.verdict
    typer.echo(f"verdict: {verdict.word}{f' {verdict.purpose}' if verdict.purpose else ''}")
    typer.echo(str(verdict))
