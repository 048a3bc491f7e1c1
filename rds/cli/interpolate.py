"""`rds interpolate`: a part program or a segment through an interpolator, as numbers, table and pictures."""

from __future__ import annotations

import json as json_text
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from rds.cli.common import Json, named_values, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.nc_options import MachineName, ProgramOptions

if TYPE_CHECKING:
    from rds.core.types import Segment
    from rds.interpolators.acceleration import Acceleration
    from rds.interpolators.interpolator import Interpolator
    from rds.interpolators.result import Interpolation
    from rds.nc.interpolator_segments import Programmed

_FOLDER = Path("interpolation")
_METHOD = "constant-velocity"


@writes_files
def interpolate(
    *,
    file: Annotated[
        Path | None, typer.Argument(help="A part program, or a .toml of segments; instead of it, --line or --arc.")
    ] = None,
    line: Annotated[
        str | None, typer.Option(help="Straight moves over points, mm: 0,0:30,40 or 0,0,0:10,0,5:20,0,0.")
    ] = None,
    arc: Annotated[str | None, typer.Option(help="An arc by start, end and centre, mm: 10,0:0,10:0,0.")] = None,
    clockwise: Annotated[bool, typer.Option("--clockwise", help="With --arc: the other way round.")] = False,
    plane: Annotated[str | None, typer.Option(help="With --arc of three axes: XY (default), ZX or YZ.")] = None,
    feed: Annotated[
        str | None, typer.Option(help="Feed rate of --line and --arc: mm/min, or with a unit: 10mm/s, 24in/min.")
    ] = None,
    period: Annotated[float, typer.Option(help="Sample period, s.")] = 0.001,
    method: Annotated[
        str, typer.Option("--method", "-m", help="Interpolator: {interpolator}, or a file with interpolate().")
    ] = _METHOD,
    arc_method: Annotated[str | None, typer.Option(help="Another one for arcs, with its default options.")] = None,
    option: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Of --method: blu=0.001, steps=39, a file's params.")
    ] = None,
    acceleration: Annotated[str | None, typer.Option(help="Filter on top: {acceleration}.")] = None,
    acceleration_time: Annotated[
        float | None, typer.Option(help="How long the velocity rises, s; of exponential its time constant.")
    ] = None,
    multipliers: Annotated[str | None, typer.Option(help="Of s-shape, one for each sample: 1,2,3,2,1.")] = None,
    profile: Annotated[
        str | None,
        typer.Option(
            help="Of a part program, in place of an interpolator: planned, trapezoid, blended or point-to-point."
        ),
    ] = None,
    exact_stop: Annotated[
        bool, typer.Option("--exact-stop", help="With --acceleration: come to rest at the end of each segment.")
    ] = False,
    machine: MachineName = "mini-cnc",
    reading: ProgramOptions,
    plot: Annotated[
        bool, typer.Option("--plot", help="Save pictures too, in --out or the folder interpolation.")
    ] = False,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the table (made if missing).")] = None,
    json: Json = False,
) -> None:
    """Position, velocity and acceleration of each axis along a path, and how far it is from what was programmed."""
    if profile is not None:
        with refusals():
            _check_words(file, {"--line": line, "--arc": arc}, clockwise, plane, feed)
            given = {"--method": method != _METHOD, "--arc-method": arc_method, "--option": option}
            given |= {"--acceleration": acceleration, "--acceleration-time": acceleration_time is not None}
            given |= {"--multipliers": multipliers, "--exact-stop": exact_stop}
            _follow_profile(profile, file, given, machine, period, reading, plot, out, json)
    with refusals(), stdout_kept(json):
        from rds.interpolators.path import interpolate as follow
        from rds.interpolators.segment_rows import read_segments

        _check_words(file, {"--line": line, "--arc": arc}, clockwise, plane, feed)
        notes: list[str] = []
        chosen = _method(method, option, period, notes)
        arcs = None if arc_method is None else _method(arc_method, None, period, notes)
        filter_ = acceleration_of(acceleration, acceleration_time, multipliers, exact_stop)
        rests: dict[int, float] = {}
        if file is not None and file.suffix != ".toml":
            programmed = _program(file, machine, period, reading)
            segments, rests = programmed.segments, programmed.rests
            notes += programmed.notes
        else:
            of_programs = dict(zip(("tools", "parameters", "with", "max-jumps"), reading, strict=True))
            _check_program_words({"machine": machine != "mini-cnc", **of_programs})
            segments = read_segments(file) if file is not None else _segments(line, arc, clockwise, plane, feed or "")
        done = follow(segments, period, chosen, arcs=arcs, acceleration=filter_, exact_stop=exact_stop, rests=rests)
        files = _save(done, out, plot)
    if json:
        print_json({**done.to_json(), "notes": notes, "files": [str(path) for path in files]})
    else:
        _show(done, notes, files)
    worst = done.worst_steps
    if worst is not None and not worst.within:
        typer.echo(
            f"rds: {worst.count} steps of {worst.method} are {max(worst.radial_error, worst.chord_error):.4g} mm from "
            f"the arc, more than one BLU ({worst.blu:g} mm); without --option steps there are as many as needed",
            err=True,
        )
    raise typer.Exit(0 if done.within else 1)


def _check_words(
    file: Path | None, words: dict[str, str | None], clockwise: bool, plane: str | None, feed: str | None
) -> None:
    from rds.core.errors import InputError

    given = ["FILE"] * (file is not None) + [name for name, value in words.items() if value is not None]
    if len(given) != 1:
        said = f"{' and '.join(given)} were given" if given else "there is nothing to interpolate"
        raise InputError(f"{said}; give one of a part program, --line and --arc")
    if file is not None and feed is not None:
        where = "`feed` of the path's file" if file.suffix == ".toml" else "the program's word F"
        raise InputError(f"--feed is for --line and --arc; {where} says its feed rate")
    if file is None and feed is None:
        raise InputError(f"{given[0]} needs a feed rate, as in --feed 600 (mm/min) or --feed 10mm/s")
    if given != ["--arc"] and (clockwise or plane is not None):
        raise InputError(f"--{'clockwise' if clockwise else 'plane'} is for --arc, and {given[0]} was given")


def _check_program_words(given: dict[str, Any]) -> None:
    from rds.core.errors import InputError

    for name, value in given.items():
        if value:
            raise InputError(f"--{name} is for a part program; segments are taken as they are")


def _method(name: str, options: list[str] | None, T: float, notes: list[str]) -> Interpolator:
    from rds.interpolators import LIBRARY
    from rds.interpolators.interpolator import find_interpolator

    found = find_interpolator(name, options_of(options or ()))
    if name not in LIBRARY.modules:
        notes += _check_student(name, T)
    return found


def _check_student(file: str, T: float) -> list[str]:
    """What `rds check` warns of, in a process of its own; ContractError with every fault that it finds."""
    from rds.checks import check_file
    from rds.core.errors import ContractError

    warnings: list[str] = []
    for report in check_file(file, T).reports:
        if report.interface in ("interpolator", "file") and not report.ok:
            faults = "; ".join(f"{fault.clause}: {fault.message}" for fault in report.faults)
            raise ContractError(f"interpolate() does not keep its interface: {faults}", file)
        if report.interface == "interpolator":
            warnings += [f"{file}: {warning.clause}: {warning.message}" for warning in report.warnings]
    return warnings


def options_of(texts: Iterable[str]) -> dict[str, Any]:
    """The values of --option by name: numbers, lists or texts."""

    def read(value: str) -> Any:
        try:
            return json_text.loads(value)
        except ValueError:
            return value

    return named_values(texts, "--option", "blu=0.001", read)


def acceleration_of(
    name: str | None, time: float | None, multipliers: str | None, exact_stop: bool
) -> Acceleration | None:
    """The filter that a command's options name; InputError for those that go with one which is not given."""
    from rds.core.errors import InputError
    from rds.interpolators.acceleration import make_acceleration

    if name is None:
        given = {"--acceleration-time": time is not None, "--multipliers": multipliers is not None}
        given["--exact-stop"] = exact_stop
        for option, used in given.items():
            if used:
                raise InputError(f"{option} goes with --acceleration, which is not given; add --acceleration s-shape")
        return None
    options = {} if time is None else {"time_constant" if name == "exponential" else "time": time}
    try:
        values = [float(cell) for cell in multipliers.split(",")] if multipliers is not None else []
    except ValueError as error:
        raise InputError(f"--multipliers {multipliers!r}: {error}; write them as numbers, as in 1,2,3,2,1") from error
    if values and options:
        raise InputError("--multipliers and --acceleration-time both say how long the filter is; give one of them")
    return make_acceleration(name, multipliers=values, **options)


def _segments(line: str | None, arc: str | None, clockwise: bool, plane: str | None, feed: str) -> list[Segment]:
    from rds.cli import interpolate_path as words

    rate = words.feed_rate(feed)
    if line is not None:
        return words.line(line, rate)
    return words.arc(arc or "", rate, clockwise, plane or "XY")


def _follow_profile(
    profile: str,
    file: Path | None,
    given: dict[str, Any],
    machine: str,
    T: float,
    reading: ProgramOptions,
    plot: bool,
    out: Path | None,
    json: bool,
) -> NoReturn:
    """`--profile`: a part program by a profile of rds.interpolators.motion."""
    from rds.cli.interpolate_profile import follow
    from rds.core.errors import InputError

    if file is None:
        raise InputError("--profile is for a part program; --line and --arc go through interpolators (--method)")
    if file.suffix == ".toml":
        raise InputError(
            f"--profile is for a part program, {file} is a path; `profile` in [reference] of an experiment plans one"
        )
    for name, used in given.items():
        if used:
            raise InputError(f"{name} is of interpolators, and --profile takes their place; leave one of them")
    _check_program_file(file, T)
    follow(profile, file, machine, T, reading.setup(), folder=out or (_FOLDER if plot else None), plot=plot, json=json)


def _check_program_file(file: Path, T: float) -> None:
    from rds.core.errors import InputError
    from rds.core.shared_quantities import SAMPLE_PERIOD

    SAMPLE_PERIOD.check(T, "--period", "rds interpolate")
    if not file.is_file():
        raise InputError("there is no such part program; check the name and the folder", str(file))


def _program(file: Path, machine: str, T: float, reading: ProgramOptions) -> Programmed:
    from rds.machines import load_machine
    from rds.nc.check import motion
    from rds.nc.interpolator_segments import MOST, program

    _check_program_file(file, T)
    loaded = load_machine(machine)
    with progress_bars() as bar:
        notes: list[str] = []
        found = program(motion(file, loaded, reading.setup(), bar("read"), notes), loaded, T, MOST)
        return found._replace(notes=[*notes, *found.notes])


def _save(done: Interpolation, out: Path | None, plot: bool) -> list[Path]:
    if out is None and not plot:
        return []
    folder = out or _FOLDER
    files = [done.save(folder / "interpolation.csv")]
    if plot:
        from rds.core.atomic import write_files
        from rds.interpolators.plots import pictures

        drawn = {folder / f"{name}.png": picture.png() for name, picture in pictures(done).items()}
        write_files(drawn)
        files += drawn
    return files


def _show(done: Interpolation, notes: list[str], files: list[Path]) -> None:
    from rds.cli.console import show_table
    from rds.interpolators.summary import summary

    top, rows = summary(done)
    show_table(top, ("quantity", "value", "unit"), rows)
    for note in notes:
        typer.echo(f"note: {note}")
    for path in files:
        typer.echo(f"wrote {path}")
