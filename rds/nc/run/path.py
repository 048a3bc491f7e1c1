"""A path as the reference of a run: an interpolator makes its samples inside the loop, or a profile before it.

`[reference] kind = "path"` of an experiment names this module (`rds.modes.experiment.resolve`); `rds nc run
--interpolator` gets a part program's moves through here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.last_made import LastMade
from rds.core.load import StudentFile, from_function
from rds.core.progress import Progress
from rds.core.quantities import AnyValue, Choice, Flag, Items, Quantity, Table, Text
from rds.core.toml_table import TomlTable
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.interpolators import DEFAULT, LIBRARY
from rds.interpolators.acceleration import LIBRARY as FILTERS
from rds.interpolators.acceleration import Acceleration, make_acceleration
from rds.interpolators.interpolator import Interpolator, find_interpolator, from_student
from rds.interpolators.motion.profiles import BLENDED, PROFILES
from rds.interpolators.motion.segments import AXES, BLEND, EXACT_STOP
from rds.interpolators.path import check_chain
from rds.interpolators.segment_rows import SEGMENTS, read_segments, segments_of
from rds.machines import Machine
from rds.modes.loop.interpolated import LEAST_AHEAD
from rds.modes.loop.program import InterpolatedProgram, Program, ProgramEvent
from rds.nc.check import motion
from rds.nc.interpolator_segments import program as moves_of
from rds.nc.path_block import PathBlock
from rds.nc.run.judge import judged
from rds.nc.run.path_method import MOST_SAMPLES, Method, program_of
from rds.nc.run.path_segments import in_room, without_idle
from rds.nc.run.prepare import Prepared, planned, prepare
from rds.nc.setup import Setup
from rds.results import Result

SUFFIX = ".toml"  # of a path file; any other is a part program
_MOST_AHEAD = 100_000
_OF_AN_INTERPOLATOR = ("interpolator", "arc_interpolator", "params", "acceleration", "exact_stop", "look_ahead")

_FORMS = (Choice("of the library", LIBRARY.names), Text("your .py file"))
WORDS = Table(
    "a path of lines and arcs that all axes of the run follow together, by an interpolator or a planned profile",
    {
        "file": Text(f"a path file ({SUFFIX}), or a part program"),
        "start": SEGMENTS.keys["start"],
        "feed": SEGMENTS.keys["feed"],
        "feed_unit": SEGMENTS.keys["feed_unit"],
        "segment": SEGMENTS.keys["segment"],
        "interpolator": AnyValue("what makes the samples", _FORMS, DEFAULT),
        "arc_interpolator": AnyValue("another one for arcs; interpolator then takes the lines", _FORMS),
        "params": Table("options of the interpolator", others=AnyValue("option, or parameter of the file")),
        "acceleration": AnyValue(
            "a filter on top of it: its name, or a table with its options",
            (
                Choice("of the library", FILTERS.names),
                Table(
                    "a filter",
                    {
                        "name": Choice("of the library", FILTERS.names),
                        "time": Quantity("how long the velocity rises or falls", "s", low=0.0),
                        "time_constant": Quantity("of exponential", "s", above=0.0),
                        "multipliers": Items("weights", Quantity("weight", "", 0.0), "a list of numbers, one a sample"),
                    },
                    needed=("name",),
                ),
            ),
        ),
        "setup": Table(
            "what a part program is read with: tools, parameters, options of the dialect",
            others=AnyValue("a file, or an option of the dialect"),
        ),
        "profile": Choice("in place of an interpolator: how the motion is planned before the run", tuple(PROFILES)),
        "exact_stop": Flag("with acceleration: the axes come to rest at the end of each segment", False),
        "look_ahead": Quantity(
            "rows that are made before they are needed",
            *("", LEAST_AHEAD, _MOST_AHEAD),
            default=LEAST_AHEAD,
            whole=True,
        ),
    },
)


def program(
    words: TomlTable, folder: Path, machine: Machine, axes: Sequence[str], T: float, last: LastMade
) -> tuple[InterpolatedProgram | Program, tuple[str, ...]]:
    """The program of a `[reference]` table for the axes of a run, and the paths of the user's interpolators.

    Of a planned motion, what was planned last is in `last`, and is taken where nothing has changed.
    InputError with the place of the words that won't do.
    """
    profile = words.read("profile")
    if profile is not None and (given := [key for key in _OF_AN_INTERPOLATOR if key in words]):
        raise InputError(
            f"profile = {profile!r} plans the motion, and {given[0]} goes with an interpolator, which makes it: "
            "give one of them",
            words.place(given[0]),
        )
    method = method_of(words, folder) if profile is None else None
    own_files = tuple(each.source.path for each in method.interpolators if each.source.path) if method else ()
    file = words.read("file")
    inline = [key for key in ("start", "feed", "segment") if key in words]
    if (file is None) != bool(inline):
        raise InputError(
            "a path needs either file (a path file or a part program), or start, feed and [[reference.segment]]",
            words.place("file" if file is not None else None),
        )
    made: InterpolatedProgram | Program
    is_program = file is not None and not str(file).endswith(SUFFIX)
    if "setup" in words and not is_program:
        raise words.fault("setup", "is of part programs, and this is a path; leave it out")
    if is_program:
        setup = _setup(words, folder)
        words.done()
        if method is not None:
            made = of_part_program(folder / file, machine, setup, T, method)
        else:
            made = _with_origin(prepare(folder / file, machine, setup, T, None, profile, last), profile)
        if set(axes) - {made.spindle} != set(made.axes):
            raise InputError(
                f"a part program moves {', '.join(made.axes)}, and the run has {', '.join(axes)}; "
                f"give axes = {list(made.axes)}",
                words.place("file"),
            )
        if made.spindle is not None and made.spindle not in axes:
            made = _noted(replace(made, spindle=None), f"the spindle stands: {made.spindle} is none of the run's axes")
        return made, own_files
    if file is not None:
        segments, name = read_segments(folder / file), str(file)
    else:
        segments, name = _inline(words), "path"
    words.done()
    if len(segments[0].start) != len(axes):
        raise InputError(
            f"the path has {len(segments[0].start)} positions in each point, and the run {len(axes)} "
            f"({', '.join(axes)}); give as many, in the order of the axes",
            words.place("axes"),
        )
    first: Segment = LineSegment((0.0,) * len(axes), segments[0].start, max(each.feed_rate for each in segments))
    lines: list[int] = list(range(1, len(segments) + 1))
    rests: dict[int, tuple[ProgramEvent, ...]] = {}
    if is_led := any(segments[0].start):
        segments, lines, rests = [first, *segments], [0, *lines], {0: ()}
    if method is not None:
        made = program_of(name, segments, lines, rests, (), method, machine, axes, T)
        made = replace(made, about={**made.about, "counted_in": "segment"})
    else:
        of = (name, segments, lines, rests, profile, machine, axes, T)
        made = last.get(of, lambda: _planned(*of))
    if is_led:
        made = _noted(made, f"the axes begin at 0: a straight line leads to the start of the path, {first.end}")
    return made, own_files


def _planned(
    name: str,
    segments: Sequence[Segment],
    lines: Sequence[int],
    rests: Iterable[int],
    profile: str,
    machine: Machine,
    axes: Sequence[str],
    T: float,
) -> Program:
    """The motion of these segments, planned by `profile`: on the path, but where `blended` rounds its corners.

    At rest at the end of the segments in `rests`.
    """
    check_chain(segments, T)
    path = in_room(segments, lines, machine, axes)
    if profile == BLENDED:
        path["mode"] = BLEND
    path["mode"][list(rests)] = EXACT_STOP
    prepared = planned([PathBlock(path)], machine, T, Path(name), profile, axes)
    assert isinstance(prepared.program, Program)
    return _with_origin(replace(prepared, program=replace(prepared.program, spindle=None)), profile, "segment")


def _with_origin(prepared: Prepared, profile: str, counted_in: str = "line") -> Program:
    """The planned samples, which know what they were planned from."""
    program = prepared.program
    assert isinstance(program, Program)
    return replace(program, origin=replace(prepared, about={"profile": profile, "counted_in": counted_in}))


def _noted(made: InterpolatedProgram | Program, note: str) -> InterpolatedProgram | Program:
    """The same with one more note for the result."""
    if isinstance(made, InterpolatedProgram):
        return replace(made, notes=(*made.notes, note))
    return replace(made, origin=replace(made.origin, notes=(*made.origin.notes, note)))


def _setup(words: TomlTable, folder: Path) -> Setup | None:
    """What the table `setup` says a part program is read with; its files stand beside the experiment."""
    given = words.inner("setup")
    if given is None:
        return None
    table = dict(given.table)
    files = {name: folder / table[name] for name in ("tools", "parameters") if isinstance(table.get(name), str)}
    return Setup.of(table | files)


def of_part_program(
    file: Path,
    machine: Machine,
    setup: Setup | None,
    T: float,
    method: Method,
    progress: Progress | None = None,
) -> InterpolatedProgram:
    """A part program whose moves `method` interpolates, rapids at the speed of the slowest axis.

    Of the rotary axes it has those that the program moves. InputError or ProgramError for a program that the machine
    cannot run, and for one that moves the tool's tip.
    """
    if not file.is_file():
        raise InputError("there is no such part program; check the name and the folder", str(file))
    every = [name for name in AXES if name in machine.axes]
    notes: list[str] = []
    programmed = moves_of(motion(file, machine, setup or Setup(), progress, notes), machine, T, MOST_SAMPLES, every)
    axes, segments = without_idle(every, programmed.segments)
    due: dict[int, tuple[ProgramEvent, ...]] = {}
    for after, event in programmed.events:
        due[after] = (*due.get(after, ()), ProgramEvent(0, event.kind, float(event.value), event.line))
    first = due.pop(-1, ())
    made = program_of(file.name, segments, programmed.lines, due, first, method, machine, axes, T, spindle=True)
    overrides = tuple((after, float(event.value)) for after, event in programmed.events if event.kind == "override")
    return replace(made, notes=(*notes, *made.notes), overrides=overrides)


def method_of(words: TomlTable, folder: Path) -> Method:
    """What the words of a table ask for: its interpolators, the filter on top, and how far it works ahead."""
    params = words.inner("params")
    found = _interpolator(words, "interpolator", folder, dict(params.table) if params else {})
    arcs = _interpolator(words, "arc_interpolator", folder, {}) if "arc_interpolator" in words else None
    filter_ = _filter(words)
    exact_stop = words.read("exact_stop")
    if exact_stop and filter_ is None:
        raise words.fault("exact_stop", "goes with acceleration, which is not given: without it no segment slows down")
    return Method(found, filter_, exact_stop, words.read("look_ahead"), arcs)


def _interpolator(words: TomlTable, key: str, folder: Path, options: Mapping[str, Any]) -> Interpolator:
    """What one of the words names."""
    given = words.any(key, DEFAULT)
    given = str(given) if isinstance(given, Path) else given
    if isinstance(given, Interpolator):
        return given
    if isinstance(given, StudentFile):
        return from_student(given, options)
    if callable(given):
        return from_student(from_function(given, role="interpolate"), options)
    if not isinstance(given, str):
        raise words.fault(key, "must be a name of the library, the path of a .py file, or a function")
    is_file = given not in LIBRARY.modules and given.endswith(".py")
    if is_file and not (folder / given).is_file():
        raise words.fault(key, f"will not do: there is no file {folder / given}")
    return find_interpolator(str(folder / given) if is_file else given, options)


def _filter(words: TomlTable) -> Acceleration | None:
    given = words.any("acceleration")
    if given is None or isinstance(given, Acceleration):
        return given
    if isinstance(given, str):
        return make_acceleration(given)
    if not isinstance(given, Mapping) or "name" not in given:
        raise words.fault("acceleration", f"must be one of {', '.join(FILTERS.names())}, or a table with name and time")
    return make_acceleration(**given)


def _inline(words: TomlTable) -> list[Segment]:
    given = words.any("segment")
    if isinstance(given, Sequence) and given and all(isinstance(each, LineSegment | ArcSegment) for each in given):
        for key in ("start", "feed", "feed_unit"):
            if key in words:
                raise words.fault(key, "goes with rows; segments that are objects have their own: remove it")
        return list(given)
    for key in ("start", "feed", "segment"):
        if key not in words:
            raise InputError(f"{key} of the path is missing; it needs start, feed and segment", words.place())
    rows = [dict(table.table) for table in words.tables("segment")]
    return segments_of(words.read("start"), rows, words.read("feed"), words.read("feed_unit"))


def judged_path(result: Result, made: InterpolatedProgram | Program, T: float) -> Result:
    """The result of a run along a path, with its contour error; see `judge.judged`."""
    return judged(result, as_prepared(made, Path(made.name), T))


def save_path_run(result: Result, made: InterpolatedProgram | Program, folder: Path, title: str) -> dict[str, Path]:
    """Save pictures and reports beside the tables in `folder`, with the path; each file's path by its kind."""
    from rds.nc.run.report import save_run

    return save_run(result, as_prepared(made, Path(made.name), result.meta["sample_period"]), folder, title)


def as_prepared(made: InterpolatedProgram | Program, file: Path, T: float) -> Prepared:
    """The program as what is prepared and judged.

    Which segment a sample of an interpolator belongs to is known when it has run.
    """
    if isinstance(made, Program):
        prepared: Prepared = made.origin
        return replace(prepared, program=made)
    return Prepared(file, made, made.path, np.zeros(0, int), T, made.notes, about=made.about)
