"""`rds learn`: an experiment again and again, each trial with the error of the one before corrected."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, stdout_kept, writes_files


@writes_files
def learn(
    experiment: Annotated[Path, typer.Argument(help="The experiment, a TOML file.")],
    trials: Annotated[int, typer.Option("--trials", "-n", help="How often it runs, the first time uncorrected.")] = 10,
    mode: Annotated[str | None, typer.Option("--mode", "-m", help="Instead of the experiment's own.")] = None,
    gain: Annotated[float, typer.Option(help="Part of the error that a trial adds to the correction.")] = 0.5,
    lead: Annotated[
        float | None, typer.Option(help="Time by which the error is taken earlier, s; by default two samples.")
    ] = None,
    cutoff: Annotated[float, typer.Option(help="Frequency at which half is still learnt, Hz.")] = 10.0,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the last trial and a picture.")] = None,
    json: Json = False,
) -> None:
    """Iterative learning control: the RMS error of each trial. The exit code is 1 if the errors grow."""
    with refusals(), stdout_kept(json):
        from rds.modes.experiment import Experiment
        from rds.modes.experiment.folder import require_writable
        from rds.modes.experiment.learning import learn as learn_trials

        def tell(number: int, result: object) -> None:
            typer.echo(f"rds: trial {number} of {trials} is over", err=True)

        made = Experiment.from_toml(experiment)
        if out is not None:
            require_writable(out)
        learned = learn_trials(made, trials, mode=mode, gain=gain, lead=lead, cutoff=cutoff, trial=tell)
        rms, last = learned.rms, learned.results[-1]
        files: dict[str, Path] = {}
        if out is not None:
            from rds.results.files import save_all

            files = save_all(last, out) | {"trials": _draw(rms, last.units, out / "trials.png")}
    if json:
        told = {"rms": rms, "converged": learned.converged, "notes": learned.notes}
        print_json(told | {"files": {k: str(v) for k, v in files.items()}})
    else:
        from rds.cli.console import show_table

        rows = [
            [str(number + 1), *(f"{errors[number]:.4g}" for errors in rms.values())]
            for number in range(len(learned.results))
        ]
        titles = ["trial", *(f"{axis} RMS error [{last.units[f'{axis}_measured']}]" for axis in rms)]
        show_table(f"Learning, {last.meta['mode']}: errors of whole trials, the first period too", titles, rows)
        for note in learned.notes:
            typer.echo(note)
        for kind in ("trials", "csv"):
            if kind in files:
                typer.echo(f"{kind}: {files[kind]}")
    raise typer.Exit(0 if learned.converged else 1)


def _draw(rms: dict[str, list[float]], units: dict[str, str], path: Path) -> Path:
    """The errors over the trials."""
    from matplotlib.figure import Figure

    from rds.core.atomic import write_files

    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for axis, errors in rms.items():
        axes.semilogy(range(1, len(errors) + 1), errors, marker="o", label=f"{axis} [{units[f'{axis}_measured']}]")
    axes.set_xlabel("trial")
    axes.set_ylabel("RMS error")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    write_files({path: lambda stream: figure.savefig(stream, format="png")})
    return path
