"""`rds grade run`: a folder of submissions, graded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.cluster_options import ClusterOptions
from rds.cli.common import (
    Json,
    ends_as_ctrl_c,
    print_json,
    progress_bars,
    refusals,
    say_notices,
    stdout_kept,
    writes_files,
)
from rds.cli.grade import needs_sandbox
from rds.core.errors import InputError
from rds.core.private_files import is_shared, keep_process_private

if TYPE_CHECKING:
    from rds.core.parallel.process import WorkerProcess
    from rds.grading.batch.outcome import BatchOutcome

_INTERRUPTED = 130  # by the shell's custom


@writes_files
def run(
    assignment: Annotated[Path, typer.Argument(help="The assignment's folder.")],
    submissions: Annotated[Path, typer.Argument(help="Folder of submissions, or a zip as the platform exports it.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for grades and feedback; a new one.")],
    *,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Local processes; default: all.")] = None,
    on_cluster: ClusterOptions,
    class_list: Annotated[
        Path | None, typer.Option("--class", help="The class list: sections, groups, extensions, late days.")
    ] = None,
    against: Annotated[
        list[Path] | None, typer.Option(help="Earlier batches, or submissions and solutions, to compare with.")
    ] = None,
    container: Annotated[
        bool, typer.Option("--container", help="In a Linux container, by Docker or Podman: on Windows and macOS.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the batch in that folder.")] = False,
    json: Json = False,
) -> None:
    """Grade all submissions, each in a sandbox: one row for each, whatever happens to it.

    The exit code is 1 if a submission could not be graded by the grader's fault, and 130 after Ctrl-C.
    """
    try:
        if container:
            with refusals():
                if given := on_cluster.given():
                    raise InputError(f"--container grades on this computer alone; leave out {' and '.join(given)}")
                raise typer.Exit(_in_container(assignment, submissions, out, jobs, class_list, against, resume, json))
        with refusals(), stdout_kept(json), ends_as_ctrl_c():
            needs_sandbox()
            from rds.grading.batch.run import run_batch

            cluster = on_cluster.chosen()
            with progress_bars() as bar, _worker(cluster is None) as first:
                found = run_batch(
                    assignment,
                    submissions,
                    out,
                    jobs=jobs,
                    scheduler=cluster,
                    resume=resume,
                    class_list=class_list,
                    against=tuple(against or ()),
                    progress=bar("submissions"),
                    announce=lambda text: typer.echo(f"rds: {text}", err=True),
                    first=first,
                )
    except KeyboardInterrupt:
        typer.echo(f"rds: ended; what is graded is kept: go on with --resume -o {out}", err=True)
        raise typer.Exit(_INTERRUPTED) from None
    for note in found.notes:
        typer.echo(f"rds: note: {note}", err=True)
    for student in found.grader_errors:
        typer.echo(f"rds: not graded, by the grader's fault: {student}: {found.grades[student].reason}", err=True)
    if json:
        print_json(found.to_json())
    else:
        _show(found)
    raise typer.Exit(1 if found.grader_errors else 0)


@contextmanager
def _worker(is_local: bool) -> Iterator[WorkerProcess | None]:
    """The first of the workers here, which `rds.__main__` has begun if it could."""
    if not is_local:
        yield None
        return
    from rds.grading.batch.warm_worker import begun

    first = begun()
    Thread(target=import_module, args=("rds.cli.console",), daemon=True).start()  # while the worker is busy
    try:
        yield first
    finally:
        first.end()
        begun.cache_clear()


def _in_container(
    assignment: Path,
    submissions: Path,
    out: Path,
    jobs: int | None,
    class_list: Path | None,
    against: list[Path] | None,
    resume: bool,
    json: bool,
) -> int:
    from rds.grading.container.container import run_in_container

    options = [*([] if jobs is None else ["--jobs", str(jobs)]), *["--resume"] * resume, *["--json"] * json]
    options += ["--shared"] * is_shared()
    mounted = [("--class", class_list)] if class_list is not None else []
    return run_in_container(
        assignment, submissions, out, options, mounted + [("--against", path) for path in against or ()]
    )


def run_alone(words: Sequence[str]) -> int | None:
    """The exit code of the command line `grade run ASSIGNMENT SUBMISSIONS -o OUT`, done here; None for any other.

    The whole reader of command lines takes longer to import than one submission to grade.
    """
    if list(words[:2]) != ["grade", "run"] or len(words) != 6 or words[4] not in ("-o", "--out"):
        return None
    if any(word.startswith("-") for word in (words[2], words[3], words[5])):
        return None
    try:
        keep_process_private()
        say_notices()
        run(Path(words[2]), Path(words[3]), Path(words[5]))
    except InputError as error:
        typer.echo(f"rds: {error}", err=True)
        return 2
    except typer.Exit as end:
        return int(end.exit_code)
    return 0


def _show(found: BatchOutcome) -> None:
    from rds.cli.console import show_table

    rows = [[str(status), str(count)] for status, count in found.counts().items()]
    show_table(f"{len(found.grades)} submissions", ["status", "submissions"], rows)
    if found.graded_now:
        speed = f"{found.submissions_per_second:.1f} a second"
        typer.echo(f"graded {found.graded_now} in {found.seconds:.1f} s, {speed}")
    typer.echo(f"wrote {found.folder}")
