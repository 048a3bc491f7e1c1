"""`rds grade self`, `check`, `hand-out`: an assignment before anything is graded."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, print_json, progress_bars, refusals, stdout_kept, writes_files

if TYPE_CHECKING:
    from rds.grading.assignment.check_assignment import AssignmentCheck
    from rds.grading.assignment.self_check import Line, SelfCheck
    from rds.grading.batch.grade_one import Opener

app = typer.Typer(no_args_is_help=True, help="Grading: try a file, check an assignment, grade a folder of submissions.")

Folder = Annotated[Path, typer.Argument(help="The assignment's folder.")]


@app.command("self")
def self_(
    assignment: Folder,
    file: Annotated[Path, typer.Argument(help="The file that you want to hand in.")],
    student: Annotated[str, typer.Option(help="Your identifier: the plants are drawn for it.")] = "self",
    trust_my_file: Annotated[
        bool, typer.Option("--trust-my-file", help="Run it without the sandbox: it can do all that you can.")
    ] = False,
    json: Json = False,
) -> None:
    """Try your own file: pass or fail and the margin of each criterion that you may see."""
    with refusals(), stdout_kept(json):
        from rds.grading.assignment.assignment import read_assignment
        from rds.grading.assignment.self_check import self_check

        with _opener(trust_my_file) as pool:
            found = self_check(read_assignment(assignment), file, student, pool)
    if json:
        print_json(found.to_json())
    else:
        _show_self(found)
    raise typer.Exit(0 if found.ok else 1)


@app.command()
@writes_files
def new(
    folder: Annotated[Path, typer.Argument(help="The new folder of the assignment.")],
    kind: Annotated[str, typer.Option(help="controller, model, interpolator or functions.")] = "controller",
    title: Annotated[str, typer.Option(help="Its title; by default the folder's name.")] = "",
    json: Json = False,
) -> None:
    """Start an assignment that passes its check, to be changed into your own."""
    with refusals():
        from rds.grading.assignment.new import new_assignment

        files = new_assignment(folder, kind, title)
    if json:
        print_json({"files": [str(path) for path in files]})
    else:
        for path in files:
            typer.echo(f"wrote {path}")
        typer.echo(f"change it, then: rds grade check {folder}")


@app.command()
def check(
    assignment: Folder,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Students whose plants the solution is tried on.")] = 20,
    json: Json = False,
) -> None:
    """Check an assignment: its reference solution earns all points for everybody, doing nothing earns none."""
    with refusals(), stdout_kept(json):
        needs_sandbox()
        from rds.grading.assignment.assignment import read_assignment
        from rds.grading.assignment.check_assignment import check_assignment
        from rds.grading.sandbox import Pool

        read = read_assignment(assignment)
        with Pool() as pool, progress_bars() as bar:
            found = check_assignment(
                read, pool, seeds, bar("students"), announce=lambda text: typer.echo(f"rds: {text}", err=True)
            )
    if json:
        print_json(found.to_json())
    else:
        _show_check(read.title, found)
    raise typer.Exit(0 if found.ok else 1)


@app.command("hand-out")
@writes_files
def hand_out_(
    assignment: Folder,
    out: Annotated[Path, typer.Option("--out", "-o", help="The new folder.")],
    json: Json = False,
) -> None:
    """Make the students' copy of an assignment: without hidden cases and criteria, secret and solution."""
    with refusals():
        from rds.grading.assignment.assignment import read_assignment
        from rds.grading.assignment.hand_out import hand_out

        files = hand_out(read_assignment(assignment), out)
    if json:
        print_json({"files": [str(path) for path in files]})
    else:
        for path in files:
            typer.echo(f"wrote {path}")


def _opener(is_trusted: bool) -> AbstractContextManager[Opener]:
    if is_trusted:
        from rds.grading.assignment.trusted import TrustedFiles

        typer.echo(
            "rds: WARNING: --trust-my-file: your file runs WITHOUT the sandbox and can do all that you can; use it for "
            "a file that you wrote yourself, and for nobody else's",
            err=True,
        )
        return nullcontext(TrustedFiles())
    from rds.core.errors import InputError
    from rds.grading.sandbox.requirements import available

    if fault := available():
        raise InputError(f"{fault}\nFor a file that you wrote yourself, --trust-my-file goes without the sandbox")
    from rds.grading.sandbox import Pool

    return Pool()


def needs_sandbox() -> None:
    """InputError, with the remedy, where nothing of the sandbox can be imported: on Windows and macOS."""
    from rds.core.errors import InputError
    from rds.grading.sandbox.requirements import missing

    if fault := missing():
        raise InputError(fault)


def _show_self(found: SelfCheck) -> None:
    from rds.cli.console import show_table

    if found.reason:
        typer.echo(f"{found.status}: {found.reason}")
    rows = [
        [
            line.title,
            line.word,
            _value(line),
            "–" if line.margin is None else f"{line.margin:.0f} %",
            f"{line.points:g}",
        ]
        for line in found.lines
    ]
    note = "Margin: 0 % where points begin, 100 % where they are full. Worth: the points for a pass."
    if found.left_out:
        many = "criterion is" if found.left_out == 1 else "criteria are"
        note += f" {found.left_out} more {many} not tried here, worth {found.left_out_points:g} points."
    show_table("Self-check", ["criterion", "result", "value", "margin", "worth"], rows, note)
    cause = found.reason.partition(": ")[2] if found.reason.startswith("case ") else found.reason
    for line in found.lines:
        is_told = bool(cause) and cause.rstrip(".") in line.sentence  # at the top, and the same for each criterion
        if line.sentence and line.word != "pass" and not is_told:
            typer.echo(f"- {line.title}: {line.sentence}")


def _value(line: Line) -> str:
    from rds.grading.grade import with_unit

    if not line.is_visible:
        return "hidden"
    return "–" if line.value is None else with_unit(line.value, line.unit)


def _show_check(title: str, found: AssignmentCheck) -> None:
    from rds.cli.console import number, show_table

    columns = ["criterion", "points", "unit", "full", "none", "least", "median", "largest", "margin", "idle"]
    rows = [
        [
            row.title,
            f"{row.max_score:g}",
            row.unit,
            *(number(value) for value in (row.full, row.none, row.least, row.median, row.largest)),
            "–" if row.margin is None else f"{row.margin:.0f} %",
            f"{row.idle:g}",
        ]
        for row in found.criteria
    ]
    note = (
        f"{found.max_score:g} points in all. Least, median and largest are the reference solution's values for "
        f"{found.seeds} students; margin is the least of them, 100 % where full points begin; idle is what is earned "
        "by doing nothing."
    )
    show_table(title, columns, rows, note)
    for fault in found.faults:
        typer.echo(f"- {fault}")
    for text in found.notes:
        typer.echo(f"note: {text}")
    typer.echo("the assignment can be given out" if found.ok else "the assignment cannot be given out as it is")
