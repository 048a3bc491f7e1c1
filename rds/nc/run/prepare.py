"""From a part program's file to what the loop runs: checked, planned, with its path for the measurement."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import PASSING, plan
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import AXES, SEGMENT
from rds.machines import Machine
from rds.modes.loop.program import Happening, InterpolatedProgram, Program
from rds.nc.check import Setup, check_program, compiled_if_current
from rds.nc.compiled_file import open_compiled
from rds.nc.toolpath import PathBlock

SPINDLE_UNIT = "rev/min"
MOST_SAMPLES = 20_000_000  # whose references fit into memory: five and a half hours at 1 kHz

Progress = Callable[[int, int], None]


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

    @property
    def seconds(self) -> float:
        """How long it takes at an override of 100 %, without what it waits for."""
        return self.program.samples * self.T


def prepare(
    file: Path, machine: Machine, setup: Setup | None = None, T: float | None = None, progress: Progress | None = None
) -> Prepared:
    """Check the program in `file` for `machine`, and plan its motion with samples of `T` s (default: the machine's).

    A current compiled form beside the file is used, and made if there is none. Raises InputError with all faults if the
    machine cannot run it, and ProgramError or InputError for what cannot be read.
    """
    setup = setup or Setup()
    T = machine.sample_period if T is None else T
    compiled = compiled_if_current(file, machine, setup)
    if compiled is None:
        validation, place = check_program(file, machine, setup, progress)
        if place is None:
            raise InputError(str(validation))
        compiled = open_compiled(place)
    require_room(least_seconds(compiled.blocks()), machine, T, file)
    found = planned(compiled.blocks(), machine, T, file)
    return replace(found, notes=(*compiled.trailer.get("notes", ()), *found.notes))


def planned(blocks: Iterable[PathBlock], machine: Machine, T: float, file: Path) -> Prepared:
    """The motion of blocks that the machine can run; see `prepare`. RdsError if a sample breaks a limit."""
    limits = Limits.of(machine)
    path: list[np.ndarray] = []
    rows = _Rows([AXES.index(name) for name in machine.axes if name in AXES])
    certificate = Certificate(limits)
    for block in certified(plan(_kept(blocks, path), limits, T), certificate):
        rows.add(block)
        if rows.count > MOST_SAMPLES:
            require_room(rows.count * T, machine, T, file)
    if not rows.count:
        raise InputError("nothing in it moves or waits: there is nothing to run", str(file))
    certificate.require(str(file))
    position, velocity, acceleration, line, segment = rows.columns()
    axes = tuple(AXES[i] for i in rows.axes)
    spindle = next((axis.name for axis in machine.axes.values() if axis.unit == SPINDLE_UNIT), None)
    table = np.array([limits.velocity, limits.acceleration, limits.jerk])[:, rows.axes]
    program = Program(
        axes=axes,
        spindle=spindle,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        line=line,
        happenings=tuple(
            Happening(sample, event.kind, float(event.value), event.line)
            for sample, event in rows.events
            if event.kind not in PASSING
        ),
        home=(0.0,) * len(axes),
        limits=table,
        name=file.name,
    )
    coolant = sorted({event.line for _, event in rows.events if event.kind == "coolant"})
    notes = (
        [f"{machine.name} has no coolant to switch: M7, M8 and M9 do nothing ({_lines(coolant)})"] if coolant else []
    )
    whole = np.concatenate(path) if path else np.zeros(0, SEGMENT)
    return Prepared(file, program, whole, segment, T, tuple(notes), certificate)


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


def _kept(blocks: Iterable[PathBlock], path: list[np.ndarray]) -> Iterator[PathBlock]:
    for block in blocks:
        path.append(block.segments)
        yield block


def _lines(lines: list[int]) -> str:
    shown = ", ".join(map(str, lines[:5]))
    return f"line{'s' * (len(lines) > 1)} {shown}{', ...' if len(lines) > 5 else ''}"
