"""`rds fit`: a model's parameters from logs, how far to trust them, and a model file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.common import Json, named_values, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.logs import read_logs
from rds.core.errors import InputError
from rds.identification.structures import INVERSE_DYNAMICS, SIMULATION_ERROR

if TYPE_CHECKING:
    from rds.identification.fit.estimate import Estimate
    from rds.identification.logs.log import Log
    from rds.identification.structures.structure import Structure
    from rds.identification.validate.validate import Validation

FITTED_SHARE = 0.6  # of each log, with --split; the rest validates


@writes_files
def fit(
    logs: Annotated[list[Path], typer.Argument(help="Logs, fitted together: CSV, MAT, Parquet, bus logs, results.")],
    structure: Annotated[
        str | None,
        typer.Option("--structure", "-s", help="Needed: {structure}, or a model of your own: FILE.py."),
    ] = None,
    method: Annotated[str | None, typer.Option("--method", "-m", help="{method}.")] = None,
    option: Annotated[
        list[str] | None, typer.Option("--option", help="Of the structure: viscous, stribeck, offset, delay, ...")
    ] = None,
    fix: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Hold a parameter at a value; repeatable.")
    ] = None,
    free: Annotated[
        str | None, typer.Option(metavar="A,B", help="Of FILE.py: estimate these only, and hold the others.")
    ] = None,
    start: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Where the search begins; else found in the data.")
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Of the method: cutoff=50; repeatable.")
    ] = None,
    split: Annotated[
        bool, typer.Option("--split", help="Fit the first 60 % of each log and validate on the rest.")
    ] = False,
    map_: Annotated[Path | None, typer.Option("--map", help="What the logs' columns mean, a TOML file.")] = None,
    axis: Annotated[str | None, typer.Option("--axis", help="The axis, where a log holds several.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the model file here (.toml).")] = None,
    report: Annotated[
        Path | None, typer.Option("--report", "--plot", help="Folder for a page with pictures, and the numbers.")
    ] = None,
    json: Json = False,
) -> None:
    """Estimate a model's parameters from logs, and say how far to trust them.

    The exit code is 1 where the parameters are not to be used, and says so; with --split, also where the validation
    fails.
    """
    with refusals(), stdout_kept(json):
        from rds.identification.fit.fit import fit as fit_model
        from rds.identification.fit.missing_options import with_hint
        from rds.identification.fit.model_file import check_place
        from rds.identification.structures.structures import LIBRARY, for_logs
        from rds.identification.structures.structures import structure as structure_of

        if out is not None:  # before the fit, which may take a while
            check_place(out)
        if structure is None:
            raise InputError(f"give a --structure: {', '.join(LIBRARY.names())}, or a model of your own, FILE.py")
        made = structure_of(structure, option or ())
        options = _options(made, method, fix or [], free, start or [], set_ or [])
        with progress_bars() as bar:
            found = read_logs(logs, map_, axis, bar)
            fitted, rest = _split(found) if split else (found, [])
            made = for_logs(made, fitted)
            if (method or made.default_method) == SIMULATION_ERROR:
                options["progress"] = bar("fitting")
                _say_if_slow(made)
            estimate = with_hint(fit_model(fitted, made, method, options), fitted)
        validation = _validated(estimate, rest) if split else None
        files = _write(out, report, estimate, fitted, made, validation)
    for sentence in estimate.unusable():
        typer.echo(f"warning: {sentence}", err=True)
    if json:
        said = estimate.to_json() | {"files": [str(path) for path in files]}
        print_json(said | ({"validation": validation.to_json()} if validation else {}))
    else:
        _show(estimate, validation)
        for path in files[:1] if report is None else [*files[: 1 if out else 0], report / "fit.html"]:
            typer.echo(f"{'model file' if path == out else 'report'}: {path}")
    raise typer.Exit(1 if estimate.unusable() else validation.exit_code if validation else 0)


def _say_if_slow(made: Structure) -> None:
    """A note on stderr where the kernels of a structure of the package are not compiled."""
    from rds.core.compiling import COMPILED

    if not COMPILED and not made.name.endswith(".py"):
        from rds.core.extras import remedy

        note = f"numba is missing, so this fit may take minutes; install it with: {remedy('fast')}"
        typer.echo(f"rds: note: {note}", err=True)


def _options(
    made: Structure, method: str | None, fix: list[str], free: str | None, start: list[str], set_: list[str]
) -> dict[str, Any]:
    """The method's options. InputError for what it does not take."""

    fixed = named_values(fix, "--fix", "tau=0.01")
    if free is not None:
        fixed |= _others(made, free, fixed)
    options: dict[str, Any] = named_values(set_, "--set", "cutoff=50")
    begun = named_values(start, "--start", "tau=0.01")
    chosen = method or made.default_method
    if chosen != SIMULATION_ERROR:
        for word, given, of in (("--fix or --free", fixed, (INVERSE_DYNAMICS,)), ("--start", begun, ())):
            if given and chosen not in of:
                those = " and ".join((SIMULATION_ERROR, *of))
                raise InputError(f"{word} is for --method {those}; the others estimate every parameter at once")
        return options | ({"fixed": fixed} if fixed else {})
    return options | ({"fixed": fixed} if fixed else {}) | ({"start": begun} if begun else {})


def _others(made: Structure, free: str, fixed: dict[str, float]) -> dict[str, float]:
    """The parameters of the user's own file that are held, at the file's values."""
    from rds.core.load import load_student

    if not made.name.endswith(".py"):
        raise InputError(
            "--free is for a model of your own (FILE.py), which has values to hold the others at; use --fix"
        )
    names = [name.strip() for name in free.split(",") if name.strip()]
    for name in names:
        if name not in made.parameters:
            raise InputError(f"--free: {made.name} has no parameter {name!r}; it has {', '.join(made.parameters)}")
        if name in fixed:
            raise InputError(f"{name} is given to --free and to --fix; give it to one of them")
    if not names:
        raise InputError("--free names no parameter; give names with commas between them")
    params = load_student(made.name).params
    return {name: float(params[name]) for name in made.parameters if name not in names and name not in fixed}


def _split(logs: list[Log]) -> tuple[list[Log], list[Log]]:
    first = [log.part(0, round(FITTED_SHARE * len(log))) for log in logs]
    return first, [log.part(len(part), len(log)) for log, part in zip(logs, first, strict=True)]


def _validated(estimate: Estimate, rest: list[Log]) -> Validation:
    from rds.identification.validate.validate import validate

    return validate(estimate, rest)


def _write(
    out: Path | None,
    report: Path | None,
    estimate: Estimate,
    logs: list[Log],
    made: Structure,
    validation: Validation | None,
) -> list[Path]:
    from rds.identification.fit.fit_report import write_fit
    from rds.identification.fit.model_file import write_model

    files = [write_model(out, estimate)] if out is not None else []
    if report is not None:
        files += write_fit(report, estimate, logs, made)
        files += validation.write(report) if validation else []
    return files


def _show(estimate: Estimate, validation: Validation | None) -> None:
    from rds.cli.console import show_table
    from rds.identification.fit.estimate_json import correlation_rows, described, error_rows, note, parameter_rows

    logs = ", ".join(str(log["name"]) for log in estimate.logs)
    show_table(f"{described(estimate)} by {estimate.method}, from {logs}", *parameter_rows(estimate))
    show_table("On the data that were fitted", *error_rows(estimate), note(estimate))
    show_table("Correlation of the estimates", *correlation_rows(estimate))
    for sentence in (*estimate.warnings, *estimate.unidentifiable):
        typer.echo(f"- {sentence}")
    if validation is not None:
        share = round(100 * (1 - FITTED_SHARE))
        typer.echo(f"Validation on the last {share} % of each log, which the fit has not seen:\n{validation}")
