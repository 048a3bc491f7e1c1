"""`rds grade review`, `regrade`, `best`, `late-days`: what graders say of a batch, and batches made from batches."""

from __future__ import annotations

import getpass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.grade import needs_sandbox

if TYPE_CHECKING:
    from rds.grading.batch.finished import Finished
    from rds.grading.review.entries import Entry

_Out = Annotated[Path, typer.Argument(metavar="OUT", help="The folder that `rds grade run -o` made.")]
_WORDS = ("--student", "--section", "--criterion", "--comment")
_WITHOUT = {"--excuse": ("--criterion",), "--extend-days": ("--criterion",), "--undo": _WORDS}
_WITHOUT |= {"--marks": (*_WORDS, "--why")}  # the table has its own
_New = Annotated[Path, typer.Option("--out", "-o", help="The new folder.")]


@writes_files
def review(
    out: _Out,
    student: Annotated[str, typer.Option(help="Whom it is about: a student or a group.")] = "",
    section: Annotated[str, typer.Option(help="Whom it is about: a section of the class list.")] = "",
    criterion: Annotated[str, typer.Option(help="The criterion that is meant.")] = "",
    points: Annotated[float | None, typer.Option(min=0.0, help="Points of the criterion, by hand.")] = None,
    comment: Annotated[str, typer.Option(help="A comment that the student reads.")] = "",
    why: Annotated[str, typer.Option(help="A reason that only graders read.")] = "",
    excuse: Annotated[bool, typer.Option("--excuse", help="It counts neither for nor against the student.")] = False,
    extend_days: Annotated[float | None, typer.Option(min=0.0, help="Move the due time by so many days.")] = None,
    undo: Annotated[int | None, typer.Option(min=1, help="Take an entry back, by its number.")] = None,
    marks: Annotated[Path | None, typer.Option(help="A table of points and comments.")] = None,
    write_marks: Annotated[Path | None, typer.Option(help="Write a table for a grader to fill in.")] = None,
    final: Annotated[bool, typer.Option("--final", help="The last word, where graders differ.")] = False,
    by: Annotated[str, typer.Option(help="Your name; by default your account's.")] = "",
    log: Annotated[bool, typer.Option("--log", help="List what graders have said, entry by entry.")] = False,
    json: Json = False,
) -> None:
    """Give points by hand, comments, excuses and extensions; without any: list what waits for a grader.

    Nothing is lost: every word is an entry of review.jsonl with its grader and time, and --undo is one, too. Grades,
    pages and gradebooks follow.
    """
    with refusals():
        from dataclasses import replace

        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.grading.batch.finished import read_finished
        from rds.grading.review.entries import Entry, Kind
        from rds.grading.review.new_entries import marks_table, read_marks, say
        from rds.grading.review.tables import behind

        ways = {"--points": points, "--excuse": excuse or None, "--extend-days": extend_days, "--undo": undo}
        chosen = [way for way, given in (ways | {"--marks": marks}).items() if given is not None]
        if len(chosen) > 1:
            raise InputError(f"{' and '.join(chosen)} are given; say one thing at a time")
        words = {"--student": student, "--section": section, "--criterion": criterion, "--comment": comment}
        for option in _WITHOUT.get("".join(chosen), ()):
            if (words | {"--why": why})[option]:
                raise InputError(f"{option} has no meaning with {chosen[0]}; leave it out")
        who = by or _account()
        plain = Entry(Kind.COMMENT, who, student, section, comment=comment, why=why)
        said: list[Entry] = []
        if points is not None:
            said.append(replace(plain, kind=Kind.POINTS, criterion=criterion, value=points, is_final=final))
        if excuse:
            said.append(replace(plain, kind=Kind.EXCUSE))
        if extend_days is not None:
            said.append(replace(plain, kind=Kind.EXTEND, value=extend_days))
        if undo is not None:
            said.append(Entry(Kind.UNDO, who, value=float(undo), why=why))
        if marks is not None:
            said += read_marks(marks, who, final)
        if not said and (comment or why):
            said.append(replace(plain, criterion=criterion))
        if said and marks is None and undo is None and bool(student) == bool(section):
            raise InputError("say whom it is about: --student NAME, or --section NAME")
        if final and not any(each.kind is Kind.POINTS for each in said):
            raise InputError("--final is about points; give --points or --marks")
        if not said and (student or section or criterion):
            raise InputError("there is nothing to enter; give --points, --comment, --excuse or --extend-days")
        if said:
            entries, finished = say(out, said)
        else:
            entries, finished = [], read_finished(out)
        if write_marks is not None:
            write_whole(write_marks, marks_table(finished))
            typer.echo(f"wrote {write_marks}", err=True)
    if json:
        print_json(_as_json(finished, entries))
        return
    for entry in entries:
        typer.echo(f"entry {entry.number}: {entry.kind} of {entry.about or entry.value}, by {entry.by}")
        for line in behind(finished, entry):
            typer.echo(f"  {line}")
    if log:
        _show_log(finished)
    elif not said and write_marks is None:
        _show_waiting(finished)


@writes_files
def regrade(
    out: _Out,
    assignment: Annotated[Path, typer.Argument(help="The assignment's folder, as it is now.")],
    new: _New,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Local processes; default: all.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the batch in the new folder.")] = False,
    json: Json = False,
) -> None:
    """Grade a batch again by a mended assignment, and list who changes and why (changes.csv, changes.html)."""
    with refusals(), stdout_kept(json):
        needs_sandbox()
        from rds.grading.batch.run import BatchOptions
        from rds.grading.review.regrade import regrade as again

        with progress_bars() as bar:
            how = BatchOptions(jobs, resume=resume, progress=bar("submissions"), announce=_announce)
            done, changes = again(out, assignment, new, how)
    if json:
        print_json(
            {
                "students": len(done.grades),
                "changes": [vars(each) | {"why": list(each.why)} for each in changes],
            }
        )
    else:
        from rds.cli.console import show_table

        rows = [[each.student, f"{each.before:g}", f"{each.now:g}", "; ".join(each.why)] for each in changes]
        if rows:
            show_table(f"{len(rows)} students change", ["student", "before", "now", "why"], rows)
        else:
            typer.echo("nobody's points change")
        typer.echo(f"wrote {new}")
    raise typer.Exit(1 if done.grader_errors else 0)


@writes_files
def best(
    batches: Annotated[list[Path], typer.Argument(metavar="OUT...", help="Folders of the attempts, in order.")],
    new: _New,
    json: Json = False,
) -> None:
    """Best of several attempts: of batches of one assignment, each student's best grade, as a batch of its own."""
    with refusals():
        from rds.grading.review.best import best as best_of

        finished = best_of(batches, new)
    if json:
        print_json({"students": {grade.student: grade.score for grade in finished.grades}})
    else:
        typer.echo(f"{len(finished.grades)} students, the best of {len(batches)} attempts: {new}")


@writes_files
def late_days(
    out: _Out,
    file: Annotated[Path, typer.Option("--out", "-o", help="The class list to write, for the next assignment.")],
    json: Json = False,
) -> None:
    """Write the class list with the late days that are left after a batch."""
    with refusals():
        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.grading.batch.finished import read_finished
        from rds.grading.course.groups import without_groups_of_export
        from rds.grading.review.applied import of_review

        finished = read_finished(out)
        if not finished.listed.members:
            raise InputError("has no class list; grade with --class FILE", str(out))
        if all(member.late_days is None for member in finished.listed.members):
            why = "has no late_days in its class list; what attempts spent is in the batch of each, not in their best"
            raise InputError(why, str(out))
        spent: dict[str, int] = {}
        for grade in finished.grades:
            source = grade.details.get("source")
            member = finished.listed.find(grade.student, source if isinstance(source, dict) else None)
            if member is not None:
                spent[member.student] = int(of_review(grade).get("late_days_spent", 0))
        sources = {name: grade.details.get("source") or {} for name, grade in finished.measured.items()}
        after = without_groups_of_export(finished.listed.with_late_days(spent), sources)
        write_whole(file, after.to_csv())
    if json:
        print_json({"spent": spent, "file": str(file)})
    else:
        typer.echo(f"{sum(spent.values())} late days are spent: wrote {file}")


def _account() -> str:
    """The name of the user's account; empty where the system knows none, as in a container: then --by has to say it."""
    try:
        return getpass.getuser()
    except (ImportError, KeyError, OSError):
        return ""


def _announce(text: str) -> None:
    typer.echo(f"rds: {text}", err=True)


def _as_json(finished: Finished, entries: list[Entry]) -> dict[str, object]:
    from dataclasses import asdict

    from rds.grading.review.applied import of_review

    return {
        "entries": [asdict(each) for each in entries],
        "log": [asdict(each) for each in finished.review.entries],
        "students": {grade.student: grade.score for grade in finished.grades},
        "to_look_at": {g.student: [score.name for score in g.for_review] for g in finished.grades if g.for_review},
        "differ": {g.student: of_review(g)["differ"] for g in finished.grades if of_review(g).get("differ")},
    }


def _show_log(finished: Finished) -> None:
    from rds.cli.console import show_table
    from rds.grading.review.tables import LOG, log

    show_table("Review", LOG, log(finished))


def _show_waiting(finished: Finished) -> None:
    from rds.cli.console import show_table
    from rds.grading.review.tables import WAITING, waiting

    if rows := waiting(finished):
        show_table("To look at", WAITING, rows)
    else:
        typer.echo("nothing waits for a grader")
