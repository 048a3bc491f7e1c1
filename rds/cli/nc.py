"""`rds nc`: part programs, read, checked, drawn and timed."""

from __future__ import annotations

import json as json_text
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli import nc_bundled, nc_cut, nc_job, nc_make, nc_methods, nc_operate, nc_run, nc_step
from rds.cli.canon import print_canon
from rds.cli.common import Json, declared, print_json, progress_bars, refusals, save_picture, writes_files
from rds.cli.nc_options import MachineName, ProfileName, Program, ProgramOptions
from rds.cli.option_groups import grouped_options
from rds.core.shared_quantities import SAMPLE_PERIOD

if TYPE_CHECKING:
    from rds.core.progress import Progress
    from rds.interpolators.motion.limiting import LimitingCauses
    from rds.machines import Machine
    from rds.nc.compensation.proof import Proof
    from rds.nc.cycle_time import CycleTime
    from rds.nc.setup import Setup

app = typer.Typer(no_args_is_help=True, help="Part programs: check, print, draw, time and make them.")
nc_make.app.command()(nc_job.job)
app.add_typer(nc_make.app, name="make")
for _command in (nc_run.run, nc_operate.operate, nc_methods.methods, nc_bundled.bundled, nc_cut.cut, nc_step.step):
    app.command()(_command)


@app.command()
@writes_files
def check(
    file: Program,
    *,
    machine: MachineName = "mini-cnc",
    reading: ProgramOptions,
    proof: Annotated[
        bool, typer.Option("--proof", help="Prove the cutter compensation, with a picture of each stretch beside FILE.")
    ] = False,
    json: Json = False,
) -> None:
    """Say whether a machine can run a program: all faults, by line. A valid one leaves its compiled form (.dat)."""
    with refusals():
        from rds.machines import load_machine
        from rds.nc.check import check_program

        of = load_machine(machine)
        what = reading.setup().on(of, file)
        with progress_bars() as bar:
            result, compiled = check_program(file, of, what, bar("check"))
        proved, pictures = _prove(file, what) if proof else (None, [])
    gouges = len(proved.gouges()) if proved else 0
    if json:
        found: dict[str, Any] = {**result.to_json(), "compiled": str(compiled) if compiled else None}
        if proof:
            found |= {"proof": proved.numbers() if proved else None, "pictures": [str(path) for path in pictures]}
        print_json(found)
    else:
        typer.echo(str(result))
        if compiled:
            typer.echo(f"compiled: {compiled}")
        if proof:
            _show_proof(proved, pictures)
    raise typer.Exit(0 if result.ok and not gouges else 1)


def _prove(file: Path, what: Setup) -> tuple[Proof | None, list[Path]]:
    """The proof of the compensated stretches and its pictures; None for a program that does not come to its end."""
    from rds.nc.compensation.proof import proof
    from rds.nc.language.errors import ProgramError
    from rds.nc.language.parameters import read_parameters

    parameters = read_parameters(what.parameters) if what.parameters else None
    try:
        proved = proof(file, tools=what.tool_list(), parameters=parameters, options=what.options, name=str(file))
    except ProgramError:
        return None, []  # the check has told why
    pictures = []
    for number in range(len(proved.stretches)):
        path = file.with_name(f"{file.stem}-proof{f'-{number + 1}' if number else ''}.png")
        save_picture(proved.plot(number), path)
        pictures.append(path)
    return proved, pictures


def _show_proof(proved: Proof | None, pictures: list[Path]) -> None:
    if proved is None:
        typer.echo("proof: none, because the program does not come to its end")
        return
    if not proved.stretches:
        typer.echo("proof: the program compensates no cutter (G41, G42)")
        return
    typer.echo(
        f"proof: the cutter's edge keeps to {len(proved.stretches)} contour{'s' * (len(proved.stretches) > 1)} within "
        f"{proved.max_deviation:.3g} mm"
    )
    for part in proved.gouges():
        typer.echo(f"proof: line {part.line}: the {part.role} move gouges the contour, {-part.least:.4g} mm deep")
    for path in pictures:
        typer.echo(f"picture: {path}")


@app.command()
@grouped_options
def canon(file: Program, reading: ProgramOptions, json: Json = False) -> None:
    """Print the canonical calls of a program, in the form of LinuxCNC's `rs274 -g`: as they are read.

    The move after G40 may be as short as LinuxCNC lets it be; `rds nc check` calls a move that gouges a fault.
    """
    with refusals():
        from rds.nc.language.canon_text import texts

        items = reading._replace(with_=[*(reading.with_ or ()), "any-exit"]).setup().interpret(file)
        if json:
            calls = (json_text.dumps({"n": n, "call": call}) for n, call in texts(items))
            _print_when_whole(_json_lines(file, calls))
            return
        print_canon(items)


def _json_lines(file: Path, calls: Iterator[str]) -> Iterator[str]:
    """One JSON object, piece by piece."""
    yield f'{{"program": {json_text.dumps(str(file))}, "calls": ['
    for number, call in enumerate(calls):
        yield f", {call}" if number else call
    yield "]}\n"


def _print_when_whole(pieces: Iterator[str]) -> None:
    """On stdout only when nothing has failed; what is long waits on disk."""
    with tempfile.SpooledTemporaryFile(max_size=1 << 24, mode="w+", encoding="utf-8") as waiting:
        waiting.writelines(pieces)
        waiting.seek(0)
        shutil.copyfileobj(waiting, sys.stdout)


@app.command()
@writes_files
def plot(
    file: Program,
    *,
    machine: MachineName = "mini-cnc",
    reading: ProgramOptions,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The picture: png, svg or pdf; by default FILE's name -path.png.")
    ] = None,
    json: Json = False,
) -> None:
    """Draw a program's path in machine coordinates: from three sides and in space.

    On a machine with less than two linear axes: each axis along the program.
    """
    with refusals():
        from rds.machines import load_machine
        from rds.nc.axis_plot import has_no_side, plot_axes
        from rds.nc.check import followed, validator_of, watched
        from rds.nc.plots import plot as draw
        from rds.nc.tool_centre import shown
        from rds.nc.trace import Trace

        path = out or file.parent / f"{file.stem}-path.png"
        of = load_machine(machine)
        what = reading.setup().on(of, file)
        validator = validator_of(file, of, what)
        of = validator.machine
        trace, flat = Trace(), has_no_side(of)
        segments = []
        with progress_bars() as bar:
            items = followed(what.interpret(file, validator.warn), file, bar("read"))
            for block in watched(items, validator, what, validator.report):
                validator.look(block)
                if flat:
                    segments.append(block.segments)
                else:
                    trace.add(shown(block.segments, of))
        save_picture(plot_axes(segments, of, file.name) if flat else draw(trace, of, file.name), path)
        result = validator.result()
    if not result.ok:
        count = len(result.faults) + result.more
        typer.echo(
            f"rds: note: {of.name} can't run it; `rds nc check` tells why ({count} fault{'s' * (count > 1)})", err=True
        )
    if json:
        print_json({**result.to_json(), "picture": str(path)})
    else:
        typer.echo(f"picture: {path}")


@app.command()
@writes_files
def time(
    file: Program,
    *,
    machine: MachineName = "mini-cnc",
    reading: ProgramOptions,
    sample_period: Annotated[float | None, declared(SAMPLE_PERIOD, "by default the machine's")] = None,
    profile: ProfileName = "planned",
    why: Annotated[
        bool,
        typer.Option(
            "--why",
            help="Also what holds the planned motion back; the certificate as a picture, FILE's -certificate.png.",
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Predict a program's cycle time, with the planner that runs it: at feed, in rapids, in dwells, for each tool.

    `rds nc run` takes the same --profile.
    """
    with refusals():
        from rds.machines import load_machine
        from rds.nc.check import motion
        from rds.nc.cycle_time import cycle_time

        of, what = load_machine(machine), reading.setup()
        notes: list[str] = []
        with progress_bars() as bar:
            found = cycle_time(motion(file, of, what, bar("plan"), notes), of, sample_period, profile)
            held, picture = _why(file, of, what, found, profile, bar) if why else (None, None)
    if json:
        print_json(
            {"program": str(file), "machine": of.name, "profile": profile, **found.to_json(), "notes": notes}
            | ({"held_back_by": held.rows, "picture": str(picture)} if held else {})
        )
        raise typer.Exit(0 if found.certificate.ok else 1)
    from rds.cli.console import show_table

    shares = [(str(tool) if tool else "none", share) for tool, share in found.by_tool.items()]
    if len(shares) != 1:
        shares.append(("all", found.whole))
    rows = [[tool, *(f"{value:.3f}" for value in share.seconds)] for tool, share in shares]
    how = "" if profile == "planned" else f", profile {profile}"
    title = f"{file}: {_clock(found.total)} on {of.name}{how}, {found.samples} samples of {found.T:g} s"
    show_table(title, ["tool", "cutting [s]", "rapid [s]", "dwell [s]", "total [s]"], rows)
    typer.echo(found.certificate.sentence())
    for line in held.sentences() if held else ():
        typer.echo(line)
    if picture is not None:
        typer.echo(f"picture: {picture}")
    for note in notes:
        typer.echo(f"note: {note}")
    raise typer.Exit(0 if found.certificate.ok else 1)


def _why(
    file: Path, of: Machine, what: Setup, found: CycleTime, profile: str, bar: Callable[[str], Progress]
) -> tuple[LimitingCauses, Path]:
    """What holds the planned motion back, and the picture of its certificate."""
    from rds.core.errors import InputError
    from rds.interpolators.motion.limiting import explained
    from rds.interpolators.motion.limits import Limits
    from rds.nc.check import motion

    if profile != "planned":
        raise InputError(f"--why tells of the planned motion, and not of --profile {profile}; leave that away")
    held = explained(list(motion(file, of, what)), Limits.of(of), found.T, progress=bar("what holds it back"))
    path = file.with_name(f"{file.stem}-certificate.png")
    save_picture(found.certificate.plot(explained=held), path)
    return held, path


def _clock(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60.0)
    hours, minutes = divmod(int(minutes), 60)
    parts = [f"{hours} h"] * (hours > 0) + [f"{minutes} min"] * (hours + minutes > 0)
    return " ".join([*parts, f"{rest:.3f} s"])
