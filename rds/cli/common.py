"""What all commands share: refusals with exit codes, the one JSON object, progress.

Exit codes: 0 done; 1 ran, and a verdict or check failed; 2 bad input, explained on stderr.
"""

from __future__ import annotations

import inspect
import json as json_text
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout
from functools import wraps
from inspect import Parameter
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.option_groups import grouped_options, take
from rds.core.private_files import keep_process_private, share
from rds.core.progress import Progress as TellsProgress
from rds.core.quantities import Quantity

_PACKAGE = Path(__file__).resolve().parents[1]


def declared(quantity: Quantity, help: str = "") -> Any:
    """The option of a quantity: its meaning, unit and range, from its declaration. `help` adds to the meaning."""
    meaning = f"{quantity.described[0].upper()}{quantity.described[1:]}"
    low, high = (bound if isfinite(bound) else None for bound in (quantity.low, quantity.high))
    return typer.Option(min=low, max=high, help=f"{meaning}; {help}." if help else f"{meaning}.")


Json = Annotated[bool, typer.Option("--json", help="Print exactly one JSON object on stdout.")]


def results_folder(out: Path | None) -> Path | None:
    """The folder that --out means: one that is named like a file of results means the folder of that name without it.

    Told on stderr, since the user may look for the file.
    """
    if out is None or out.is_dir() or out.suffix.lower() not in RESULT_FILES:
        return out
    folder = out.with_suffix("")
    typer.echo(f"rds: note: results are a folder of files, and go to {folder}; {out.name} is none of them", err=True)
    return folder


PICTURES = ("png", "svg", "pdf")
RESULT_FILES = (".csv", ".mat", ".parquet", ".json", ".html", ".png", ".pdf", ".svg", ".xlsx", ".txt", ".dat")
_Shared = Annotated[bool, typer.Option("--shared", help="Let your group read what is written; else only you can.")]


def writes_files(command: Callable[..., None]) -> Callable[..., None]:
    """The same command with --shared, which every command has that writes files, and `grouped_options`."""
    command = grouped_options(command)

    @wraps(command)
    def with_option(*words: Any, shared: bool = False, **options: Any) -> None:
        if shared:
            share()
            keep_process_private()  # again: for the group's umask
        command(*words, **options)

    option = Parameter("shared", Parameter.KEYWORD_ONLY, default=False, annotation=_Shared)
    take(with_option, [*inspect.signature(command).parameters.values(), option])
    return with_option


@contextmanager
def refusals() -> Iterator[None]:
    """Errors that a user can act on go to stderr as a sentence, with exit code 2."""
    from rds.core.blame import is_students, student_error
    from rds.core.errors import RdsError

    try:
        yield
    except RdsError as error:
        typer.echo(f"rds: {error}", err=True)
        raise typer.Exit(2) from error
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        remedy = "check that the folder can be written and that the disk has room"
        typer.echo(f"rds: {place}{error.strerror or error}; {remedy}", err=True)
        raise typer.Exit(2) from error
    except Exception as error:  # a class of the student's may fail wherever it is looked at
        if not is_students(error):
            raise
        typer.echo(f"rds: {student_error(error)}", err=True)
        raise typer.Exit(2) from error


def say_notices() -> None:
    """Notices of the library as notes on stderr, instead of as warnings with a line of code."""
    from rds.core.errors import Notice

    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, Notice):
            typer.echo(f"rds: note: {message}", err=True)
        elif not (issubclass(category, RuntimeWarning) and Path(where[0]).is_relative_to(_PACKAGE)):
            shown(message, category, *where, **more)  # a line of ours that overflows is told by what comes of it

    warnings.showwarning = show


def say_what_is_replaced(folder: Path | None) -> None:
    """A note on stderr if the results of an earlier run are in `folder`: those of the next one take their place."""
    from rds.modes.experiment.folder import holds_result

    if folder is not None and holds_result(folder):
        typer.echo(f"rds: note: {folder}: replaces the results of an earlier run there once it has its own", err=True)


@contextmanager
def stdout_kept(json: bool) -> Iterator[None]:
    """With `json`, whatever a student's code prints goes to stderr: stdout is for the one JSON object.

    A copy of the process that the student's code made by os.fork() ends here: it has nothing to say.
    """
    process = os.getpid()
    try:
        with _stdout_to_stderr() if json else nullcontext():
            yield
    finally:
        if os.getpid() != process:
            os._exit(0)


@contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    sys.stdout.flush()
    try:
        saved = os.dup(1)
        os.dup2(2, 1)  # what is not printed through Python as well
    except OSError:
        saved = -1
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        if saved >= 0:
            os.dup2(saved, 1)
            os.close(saved)


@contextmanager
def progress_bars() -> Iterator[Callable[[str], TellsProgress]]:
    """Makes a progress function for a named stage: a bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda name: lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:

        def bar(name: str) -> TellsProgress:
            task = bars.add_task(name, total=None)
            return lambda done, of: bars.update(task, completed=done, total=of)

        yield bar


@contextmanager
def until_ctrl_c() -> Iterator[threading.Event]:
    """An event that Ctrl-C, a polite kill and a closed terminal set."""
    from rds.core.interrupt import SignalEvent, set_by_signals

    stop = SignalEvent()
    with set_by_signals(stop):
        yield stop


@contextmanager
def ends_as_ctrl_c() -> Iterator[None]:
    """A polite kill and a closed terminal end what runs here as Ctrl-C does, so that its clean-up is done."""

    def interrupt(number: int, _: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    numbers = [number for name in ("SIGTERM", "SIGHUP") if (number := getattr(signal, name, None)) is not None]
    # what is ignored (nohup) stays so
    before = {number: signal.getsignal(number) for number in numbers}
    before = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


Explain = Annotated[bool, typer.Option("--explain", help="Say what the verdict on the timing rests on.")]


def explain(result: Any, is_shown: bool = False, in_full: bool = False) -> None:
    """Say on stderr why a run that failed or is void is so, and what its verdict rests on if that is asked for.

    `is_shown`: its verdict stands on stdout already.
    """
    if result.meta.get("ending") != "done":
        reason = result.meta.get("ending_reason")
        typer.echo(f"rds: the run ended early ({result.meta['ending']}){f': {reason}' if reason else ''}", err=True)
    # overloaded says no more than that samples were late; of the other early endings, repeating is no remedy
    unexplained = result.meta.get("ending") in ("done", "overloaded")
    if not is_shown and (result.verdict == "missed" or (result.verdict == "void" and unexplained)):
        typer.echo(f"rds: timing {result.verdict}: {result.meta.get('verdict_reason')}", err=True)
    if in_full and (evidence := result.meta.get("verdict_evidence")):
        typer.echo(f"rds: the verdict on the timing rests on this: {evidence}", err=True)
    for note in result.meta.get("notes", ()):
        typer.echo(f"rds: note: {note}", err=True)


def named_values(given: Iterable[str], option: str, example: str, read: Callable[[str], Any] = float) -> dict[str, Any]:
    """The values of an option that is given as NAME=VALUE, once or several times, by name.

    `read` takes a value's text; ValueError where it cannot. InputError for another form, and for a name given twice.
    """
    from rds.core.errors import InputError

    texts: dict[str, str] = {}
    found: dict[str, Any] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if name in found:
            raise InputError(f"{option} {name} is given twice, {texts[name]} and {value}; give it once")
        try:
            if not (name and equals):
                raise ValueError
            texts[name], found[name] = value, read(value)
        except ValueError:
            what = "NAME=VALUE with a number" if read is float else "NAME=VALUE"
            raise InputError(f"{option} {text!r} must be {what}, as in {option} {example}") from None
    return found


def picture_kind(path: Path) -> str:
    """The kind of picture that a file's name says. InputError for one that is not drawn."""
    from rds.core.errors import InputError

    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        raise InputError("what kind of picture is that? end its name with .png, .svg or .pdf", str(path))
    return kind


def save_picture(figure: Any, path: Path) -> None:
    """Whole or not at all."""
    from rds.core.atomic import write_files

    kind = picture_kind(path)
    write_files({path: lambda stream: figure.savefig(stream, format=kind)})


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    typer.echo(json_text.dumps(value, allow_nan=False))
