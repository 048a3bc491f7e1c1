"""`rds grade run`: a folder of submissions, graded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli import cluster_options
from rds.cli.common import Json, ends_as_ctrl_c, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.grade import needs_sandbox
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.grading.batch.outcome import BatchOutcome

_INTERRUPTED = 130  # by the shell's custom


@writes_files
def run(
    assignment: Annotated[Path, typer.Argument(help="The assignment's folder.")],
    submissions: Annotated[Path, typer.Argument(help="Folder of submissions, or a zip as the platform exports it.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for grades and feedback; a new one.")],
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Local processes; default: all.")] = None,
    scheduler: cluster_options.Address = None,
    tls_ca: cluster_options.Ca = None,
    tls_cert: cluster_options.Cert = None,
    tls_key: cluster_options.Key = None,
    insecure_cluster: cluster_options.Insecure = False,
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
                if scheduler is not None:
                    raise InputError("--container grades on this computer alone; leave out --scheduler")
                raise typer.Exit(_in_container(assignment, submissions, out, jobs, class_list, against, resume, json))
        with refusals(), stdout_kept(json), ends_as_ctrl_c():
            needs_sandbox()
            from rds.grading.batch.run import run_batch

            cluster = cluster_options.scheduler_of(scheduler, tls_ca, tls_cert, tls_key, insecure_cluster)
            with progress_bars() as bar:
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
    mounted = [("--class", class_list)] if class_list is not None else []
    return run_in_container(
        assignment, submissions, out, options, mounted + [("--against", path) for path in against or ()]
    )


def _show(found: BatchOutcome) -> None:
    from rds.cli.console import show_table

    rows = [[str(status), str(count)] for status, count in found.counts().items()]
    show_table(f"{len(found.grades)} submissions", ["status", "submissions"], rows)
    if found.graded_now:
        speed = f"{found.submissions_per_second:.1f} a second"
        typer.echo(f"graded {found.graded_now} in {found.seconds:.1f} s, {speed}")
    typer.echo(f"wrote {found.folder}")
