"""`rds run --exchange` and `rds nc run --exchange`: the run goes on after modules were exchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rds.modes.experiment import Experiment
    from rds.modes.experiment.run import Run
    from rds.results import Result

Exchange = Annotated[
    Path | None,
    typer.Option(
        help="Where a module is unplugged or exchanged in the run, offer the machine of those that are there (dialect "
        "oacs), write it to this new file when accepted, and run again on it.",
        metavar="MACHINE.toml",
    ),
]
Yes = Annotated[bool, typer.Option("--yes", help="With --exchange: accept what the run can go on with, unasked.")]
Events = Annotated[
    Path | None,
    typer.Option(help="With --exchange: a new CSV file of what happens, for `rds report reconfiguration`."),
]
_WORDS = {"removed": "lost", "added": "found", "ready": "accepted", "moving": "drives", "clash": "number used twice:"}


def only_with_exchange(yes: bool, events: Path | None) -> None:
    """InputError for options that go with --exchange, which is not given."""
    from rds.core.errors import InputError

    for option, given in (("--yes", yes), ("--events", events is not None)):
        if given:
            raise InputError(f"{option} goes with --exchange, which is not given; add --exchange MACHINE.toml")


def run_on(
    path: Path, file: Path, yes: bool, events: Path | None, json: bool, mode: str | None, out: Path | None
) -> list[tuple[Result, dict[str, Path]]]:
    """Run the experiment in the file `path`, again after each exchange; each result, and its files by kind."""
    from rds.cli.common import progress_bars
    from rds.modes.experiment import Experiment
    from rds.modes.experiment.report import folder_of, save_run

    experiment = Experiment.from_toml(path)
    folder = out if out is not None else folder_of(experiment, mode)
    runs: list[tuple[Experiment, Path]] = []

    def go(experiment: Experiment, run: Run) -> Result:
        assert run.folder is not None
        runs.append((experiment, run.folder))
        with progress_bars() as bar:
            return run.wait(bar(run.plan.mode))

    results = through_exchanges(experiment, file, yes, events, json, mode, folder, go)
    title = experiment.title or path.stem
    return [  # pictures take seconds, in which nobody would be offered anything
        (result, save_run(result, of.plan(result.mode).program, place, title))
        for result, (of, place) in zip(results, runs, strict=True)
    ]


def runs_json(made: list[tuple[Result, dict[str, Path]]]) -> dict[str, Any]:
    """What is told of runs besides the last one."""
    return {
        "runs": [
            {
                "machine": result.meta["machine"],
                "ending": result.meta["ending"],
                "ending_reason": result.meta.get("ending_reason"),
                "files": {kind: str(path) for kind, path in files.items()},
            }
            for result, files in made
        ]
    }


def through_exchanges(
    experiment: Experiment,
    file: Path,
    yes: bool,
    events: Path | None,
    json: bool,
    mode: str | None,
    out: Path,
    go: Callable[[Any, Any], Result],
    changes: Iterable[Any] = (),
) -> list[Result]:
    """The result of each run; what happens goes to stderr, and to the file of events."""
    from rds.bus.modules.oacs.events import EventFile
    from rds.core.errors import InputError
    from rds.modes.experiment.exchange import ExchangeCalls, run_through_exchanges

    if json and not yes:
        raise InputError("--json cannot ask; add --yes, which accepts what the run can go on with")
    kept = EventFile(events) if events is not None else None

    def say(text: str) -> None:
        typer.echo(f"rds: {text}", err=True)

    def tell(happened: Any) -> None:
        if kept is not None:
            kept.add(happened)
        if happened.event not in ("present", "offered", "refused"):
            said = _WORDS.get(happened.event, happened.event)
            say(f"{happened.time:.3f} s: {said} {happened.module or file}")

    def accept(offer: Any) -> bool:
        say(str(offer.verdict))
        try:
            return yes or typer.confirm("accept it, and run again on it?", err=True)
        except typer.Abort:
            return False

    try:
        return run_through_exchanges(
            experiment, file, ExchangeCalls(accept, lambda offer, why: say(why), tell), mode, out, go, changes
        )
    finally:
        if kept is not None:
            kept.close()
