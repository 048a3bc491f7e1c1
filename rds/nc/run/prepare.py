"""From a part program's file to what the loop runs: checked, planned, with its path for the measurement."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from weakref import finalize

import numpy as np

from rds.core.errors import InputError
from rds.core.last_made import LastMade
from rds.core.progress import Progress
from rds.core.types import SPINDLE_UNIT
from rds.interpolators.motion.certificate import Certificate
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import PASSING
from rds.interpolators.motion.profiles import motion_of
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import AXES, JOINTS, SEGMENT
from rds.machines import Machine
from rds.machines.kinematics.tip import Tip
from rds.modes.loop.program import InterpolatedProgram, Program, ProgramEvent
from rds.nc.check import check_program, compiled_if_current
from rds.nc.compiled_file import Compiled, beside, open_compiled
from rds.nc.configuration import configured
from rds.nc.path_block import Event, PathBlock
from rds.nc.run.in_part import from_line, stepwise
from rds.nc.setup import Setup
from rds.nc.tool_centre import ToolCentre, path_of_tip

MOST_SAMPLES = 20_000_000  # whose references fit into memory: five and a half hours at 1 kHz


@dataclass(frozen=True)
class TipPath:
    """The path of a program in work coordinates, segment for segment, and the machine as it is, with its errors."""

    path: np.ndarray  # of SEGMENT, as programmed for the tip where `tip` says so
    tip: Tip

    def of_axes(self, axes: Sequence[str], columns: Sequence[np.ndarray], length: np.ndarray) -> dict[int, np.ndarray]:
        """X, Y, Z of the tip (n,) by the number of the axis, of a column of positions for each of `axes`."""
        positions = np.zeros((len(length), len(AXES)))
        for name, column in zip(axes, columns, strict=True):
            positions[:, AXES.index(name)] = column
        places, _ = self.tip.places(positions, length)
        return {axes.index(name): places[:, i] for i, name in enumerate(AXES[:3]) if name in axes}


@dataclass(frozen=True)
class Prepared:
    """A program that a machine can run: what the loop gets, and the programmed path with each sample's segment in it.

    `rapid` says of each planned sample whether it is in a rapid move. `notes` are what a reader should know of it.
    """

    file: Path
    program: Program | InterpolatedProgram
    path: np.ndarray  # of SEGMENT
    segment: np.ndarray
    T: float
    notes: tuple[str, ...] = ()
    certificate: Certificate | None = None  # of the planned samples
    tip: TipPath | None = None  # of a program with moves for the tool's tip
    about: dict[str, Any] = field(default_factory=dict)  # of a path as reference: what made its samples, for the result
    outputs: tuple[dict[str, Any], ...] = ()  # that are switched: name, value, planned sample, line
    events: tuple[Event, ...] = ()  # of the path, each after one of its segments
    begin: int = 0  # line that it was begun at; 0: at its head

    @property
    def seconds(self) -> float:
        """How long it takes at an override of 100 %, without what it waits for."""
        return self.program.samples * self.T


def prepare(
    file: Path,
    machine: Machine,
    setup: Setup | None = None,
    T: float | None = None,
    progress: Progress | None = None,
    profile: str = "planned",
    last: LastMade | None = None,
    begin: int = 0,
    steps: bool = False,
) -> Prepared:
    """Check the program in `file` for `machine`, and plan its motion with samples of `T` s (default: the machine's).

    `profile` is one of `rds.interpolators.motion.profiles`. With `begin`, the motion is that from the first move of
    this line or a later one on, as `rds.nc.run.in_part.from_line` says. With `steps`, it waits after each line.

    A current compiled form beside the file is used, and made if there is none. `last` keeps what was planned, and
    nothing is planned again where all is as it was. Raises InputError with all faults if the machine cannot run it,
    and ProgramError or InputError for what cannot be read.
    """
    setup = setup or Setup()
    T = machine.sample_period if T is None else T
    compiled = compiled_form(file, machine, setup, progress)
    return (last or LastMade()).get(
        (file, compiled.header, compiled.trailer, machine, T, profile, begin, steps),
        lambda: _of_compiled(compiled, file, machine, setup, T, profile, begin, steps),
    )


def compiled_form(file: Path, machine: Machine, setup: Setup, progress: Progress | None = None) -> Compiled:
    """The current compiled form beside the program in `file`, made if there is none; errors as those of `prepare`.

    In a folder that cannot be written to, as that of a course, it is made for as long as it is in use.
    """
    compiled = compiled_if_current(file, machine, setup)
    if compiled is not None:
        return compiled
    folder = None if os.access(file.parent, os.W_OK) else TemporaryDirectory(prefix="rds-compiled-")
    wanted = None if folder is None else Path(folder.name) / beside(file).name
    validation, place = check_program(file, machine, setup, progress, wanted)
    if place is None:
        raise InputError(str(validation))
    compiled = open_compiled(place)
    if folder is not None:
        finalize(compiled, folder.cleanup)
    return compiled


def _of_compiled(
    compiled: Compiled, file: Path, machine: Machine, setup: Setup, T: float, profile: str, begin: int, steps: bool
) -> Prepared:
    require_room(least_seconds(compiled.blocks()), machine, T, file)
    blocks = from_line(compiled.blocks(), begin, file) if begin else compiled.blocks()
    found = planned(blocks, machine, T, file, profile)
    if steps:
        assert isinstance(found.program, Program)
        found = replace(found, program=stepwise(found.program))
    if (found.path["tip"] != JOINTS).any():
        own, _ = configured(file, machine, setup.options)
        found = replace(found, tip=tip_path(found.path, own, setup.on(machine, file).correct))
    return replace(found, notes=(*compiled.trailer.get("notes", ()), *found.notes), begin=begin)


def planned(
    blocks: Iterable[PathBlock],
    machine: Machine,
    T: float,
    file: Path,
    profile: str = "planned",
    axes: Sequence[str] | None = None,
) -> Prepared:
    """The motion of blocks that the machine can run; see `prepare`. RdsError if a sample breaks a promise of it.

    `axes` are those of the run, where these are not all of the machine's; the blocks move no others.
    """
    limits = Limits.of(machine)
    path: list[np.ndarray] = []
    events: list[Event] = []
    rows = _Rows([AXES.index(name) for name in (machine.axes if axes is None else axes) if name in AXES])
    samples, certificate = motion_of(profile, _kept(blocks, path, events), limits, T, start=np.zeros(len(AXES)))
    for block in samples:
        rows.add(block)
        if rows.count > MOST_SAMPLES:
            require_room(rows.count * T, machine, T, file)
    if not rows.count:
        raise InputError("nothing in it moves or waits: there is nothing to run", str(file))
    certificate.require(str(file))
    position, velocity, acceleration, line, segment = rows.columns()
    moved = tuple(AXES[i] for i in rows.axes)
    spindle = next((axis.name for axis in machine.axes.values() if axis.unit == SPINDLE_UNIT), None)
    table = np.array([limits.velocity, limits.acceleration, limits.jerk])[:, rows.axes]
    program = Program(
        axes=moved,
        spindle=spindle,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        line=line,
        happenings=tuple(
            ProgramEvent(sample, event.kind, float(event.value), event.line)
            for sample, event in rows.events
            if event.kind not in PASSING
        ),
        home=(0.0,) * len(moved),
        limits=table,
        name=file.name,
    )
    coolant = sorted({event.line for _, event in rows.events if event.kind == "coolant"})
    notes = (
        [f"{machine.name} has no coolant to switch: M7, M8 and M9 do nothing ({_lines(coolant)})"] if coolant else []
    )
    outputs = []
    for sample, event in rows.events:
        if event.kind == "output":
            kind, number, value = str(event.value).split()
            name = (machine.digital if kind == "digital" else machine.analog)[int(number)]
            outputs.append({"output": name, "value": float(value), "sample": sample, "line": event.line})
    whole = np.concatenate(path) if path else np.zeros(0, SEGMENT)
    return Prepared(
        *(file, program, whole, segment, T, tuple(notes), certificate), outputs=tuple(outputs), events=tuple(events)
    )


def tip_path(path: np.ndarray, machine: Machine, correct: bool) -> TipPath:
    """Where a program's moves for the tip take it on the work, for measuring."""
    made = path_of_tip(ToolCentre(machine, correct).real, path)
    return TipPath(made, Tip(machine.kinematics))


def least_seconds(blocks: Iterable[PathBlock]) -> float:
    """What feeds and dwells of a program take without any ramp or rapid, s: it runs for longer."""
    total = 0.0
    for block in blocks:
        feeds = block.segments[~block.segments["rapid"]]
        total += float((feeds["length"] / feeds["rate"]).sum())
        total += sum(float(event.value) for event in block.events if event.kind == "dwell")
    return total


def require_room(seconds: float, machine: Machine, T: float, file: Path) -> None:
    """InputError if a program that runs for `seconds` or more has too many samples for one run, or for the memory."""
    axes = sum(name in AXES for name in machine.axes)
    # planned: three tables, gathered and joined; recorded: seven columns for each axis and the spindle, three times
    bytes_ = seconds / T * 8.0 * (6 * axes + 4 + 3 * (5 + 7 * (axes + 1)))
    free = _free_memory()
    if seconds <= MOST_SAMPLES * T and not bytes_ > free:
        return
    memory = f"about {bytes_ / 1e9:.2g} GB of memory" + (f" ({free / 1e9:.2g} are free)" if free < inf else "")
    raise InputError(
        f"takes at least {seconds:.0f} s ({seconds / 3600.0:.1f} h), and with samples of {T:g} s {memory}; a run may "
        f"last for {MOST_SAMPLES * T:.0f} s: divide the program, raise its feeds, or take a longer sample_period",
        str(file),
    )


def _free_memory() -> float:
    """Bytes that programs may still have; inf where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(float(line.split()[1]) * 1024.0 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError):
        return inf


class _Rows:
    """The planned samples of the axes that a machine has, gathered."""

    def __init__(self, axes: list[int]):
        self.axes = axes
        self.count = 0
        self.events: list[tuple[int, Any]] = []
        self._parts: list[tuple[np.ndarray, ...]] = []

    def add(self, block: SampleBlock) -> None:
        tables = (block.position, block.velocity, block.acceleration)
        self._parts.append((*(table[:, self.axes] for table in tables), block.line, block.segment))
        self.count += len(block)
        self.events += block.events

    def columns(self) -> list[np.ndarray]:
        return [np.concatenate(parts) for parts in zip(*self._parts, strict=True)]


def _kept(blocks: Iterable[PathBlock], path: list[np.ndarray], events: list[Event]) -> Iterator[PathBlock]:
    first = 0
    for block in blocks:
        path.append(block.segments)
        events += [event._replace(after=first + event.after) for event in block.events]
        first += len(block)
        yield block


def _lines(lines: list[int]) -> str:
    shown = ", ".join(map(str, lines[:5]))
    return f"line{'s' * (len(lines) > 1)} {shown}{', ...' if len(lines) > 5 else ''}"
