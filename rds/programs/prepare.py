"""From a part program's file to what the loop runs: checked, planned, with its path for the measurement."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.machines import Machine
from rds.motion.certificate import Certificate, certified
from rds.motion.limits import Limits
from rds.motion.planner import PASSING, plan
from rds.motion.samples import SampleBlock
from rds.motion.segments import AXES, SEGMENT
from rds.nc.check import Setup, check_program, compiled_if_current
from rds.nc.compiled_file import open_compiled
from rds.nc.toolpath import PathBlock
from rds.runtime.program import Happening, Program

SPINDLE_UNIT = "rev/min"
MOST_SAMPLES = 20_000_000  # whose references fit into memory: five and a half hours at 1 kHz

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Prepared:
    """A program that a machine can run: what the loop gets, and the programmed path with each sample's segment in it.

    `rapid` says of each planned sample whether it is in a rapid move. `notes` are what a reader should know of it.
    """

    file: Path
    program: Program
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
    return planned(compiled.blocks(), machine, T, file)


def planned(blocks: Iterable[PathBlock], machine: Machine, T: float, file: Path) -> Prepared:
    """The motion of blocks that the machine can run; see `prepare`. RdsError if a sample breaks a limit."""
    limits = Limits.of(machine)
    path: list[np.ndarray] = []
    rows = _Rows([AXES.index(name) for name in machine.axes if name in AXES])
    certificate = Certificate(limits)
    for block in certified(plan(_kept(blocks, path), limits, T), certificate):
        rows.add(block)
        if rows.count > MOST_SAMPLES:
            raise InputError(
                f"takes more than {MOST_SAMPLES * T:.0f} s, too long for one run with samples of {T:g} s; divide it",
                str(file),
            )
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
