"""`rds robustness`: a closed loop over all that its axes may be."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.cluster_options import ClusterOptions
from rds.cli.common import Json, print_json, progress_bars, refusals, stdout_kept, writes_files


@writes_files
def robustness(
    experiment: Annotated[Path, typer.Argument(help="The experiment, a TOML file.")],
    *,
    runs: Annotated[int, typer.Option("--runs", "-n", help="How many draws.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of the draws: the same seed gives the same ones.")] = 0,
    model: Annotated[Path | None, typer.Option(help="A model file instead of the experiment's \\[model].")] = None,
    ranges: Annotated[Path | None, typer.Option(help="TOML of \\[AXIS] tables: PARAMETER = \\[low, high].")] = None,
    level: Annotated[float, typer.Option(help="Of the confidence region that is drawn from.")] = 0.95,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", help="Local processes; default: all.")] = None,
    on_cluster: ClusterOptions,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for a page, pictures and draws.csv.")] = None,
    json: Json = False,
) -> None:
    """Run an experiment's simulation with parameters drawn from its model's confidence region: errors and margins.

    The exit code is 1 if a loop is unstable or a run fails.
    """
    with refusals(), stdout_kept(json):
        from rds.identification.robustness.report import write_study
        from rds.identification.robustness.study import study
        from rds.identification.robustness.summary import to_json

        cluster = on_cluster.chosen()
        with progress_bars() as bar:
            found = study(
                experiment,
                runs,
                seed=seed,
                model=model,
                ranges=ranges,
                level=level,
                jobs=jobs,
                scheduler=cluster,
                progress=bar("runs"),
                announce=lambda text: typer.echo(f"rds: {text}", err=True),
            )
        files = write_study(found, out, f"Robustness of {experiment.stem}") if out is not None else {}
    if json:
        print_json(to_json(found) | {"files": {kind: str(path) for kind, path in files.items()}})
    else:
        _show(found, files)
    raise typer.Exit(1 if found.failed else 0)


def _show(found: object, files: dict[str, Path]) -> None:
    from rds.cli.console import cell, show_table
    from rds.identification.robustness.report import (
        COLUMNS,
        FIGURES_NOTE,
        PARAMETER_COLUMNS,
        PARAMETER_NOTE,
        figure_rows,
        parameter_rows,
    )
    from rds.identification.robustness.study import Study
    from rds.identification.robustness.summary import sentences, summaries

    assert isinstance(found, Study)
    for axis in summaries(found):
        rows = [[cell(value) for value in row] for row in figure_rows(axis)]
        show_table(f"Axis {axis.axis}: {len(found.figures)} runs, seed {found.task.seed}", COLUMNS, rows, FIGURES_NOTE)
        rows = [[cell(value) for value in row] for row in parameter_rows(axis)]
        show_table(f"Axis {axis.axis}: parameters", PARAMETER_COLUMNS, rows, PARAMETER_NOTE)
    for sentence in sentences(found):
        typer.echo(f"- {sentence}")
    for note in found.notes:
        typer.echo(f"note: {note}")
    for path in files.values():
        typer.echo(f"wrote {path}")
