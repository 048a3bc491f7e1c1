"""A part program on the nodes of a machine by one method or several: which there are, and their runs under one report.

Methods A, B and C, on a serial line (serial_methods.py) or on CAN (can_methods.py), bring one motion to all nodes; by
move commands (module_moves.py) each module goes from point to point by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rds.bus.hub.bus_settings import BITRATE, DEFAULT_BAUD
from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.machines import Machine
from rds.modes import EMULATION, SIMULATION, load_mode
from rds.nc.run import can_methods, module_moves, serial_methods
from rds.nc.run.serial_methods import THESIS, MethodRun, check_method
from rds.nc.run.serial_motion import BYTE_TIME, serial_motion
from rds.nc.setup import Setup

MOVES = module_moves.METHOD
ALL = ("A", "B", "C", THESIS)  # what `all` stands for, as far as a machine has them


@dataclass(frozen=True)
class Nodes:
    """How the nodes of a machine take a motion: `methods`, the period of their steps in s, and what carries it out."""

    methods: tuple[str, ...]
    period: float
    whole: bool  # steps are whole BLU
    rate: Mapping[str, Any]  # of the line or bus, as a report's settings name it
    carry_out: Callable[..., MethodRun]
    options: Mapping[str, Any]  # of the line or bus beside its rate


def nodes_of(machine: Machine, baud: float | None = None, options: Mapping[str, Any] | None = None) -> Nodes:
    """The nodes of `machine` on a serial line at `baud`, or on CAN with `bitrate` and `period` of the `options`.

    InputError for a baud rate where there is no serial line.
    """
    if _has_steppers(machine):
        speed = DEFAULT_BAUD if baud is None else baud
        carry_out = partial(serial_methods.run_method, baud=speed)
        return Nodes(serial_methods.METHODS, BYTE_TIME, True, {"baud": speed}, carry_out, options or {})
    if baud is not None:
        raise InputError(f"--baud is of a serial line, and {machine.name} is on CAN: give --option bitrate=500000")
    words = dict(options or {})
    period = SAMPLE_PERIOD.check(words.pop("period", machine.sample_period), "period")
    bitrate = BITRATE.check(words.pop("bitrate", can_methods.BITRATE), "bitrate")
    carry_out = partial(can_methods.run_can_method, bitrate=bitrate)
    return Nodes(can_methods.METHODS, period, False, {"bitrate": bitrate, "period": period}, carry_out, words)


def methods_of(machine: Machine) -> tuple[str, ...]:
    """The methods by which the nodes of `machine` can carry programs out; none where it has no such nodes."""
    if _has_steppers(machine):
        return serial_methods.METHODS
    found: tuple[str, ...] = ()
    try:
        for axis in machine.axes.values():
            can_methods.can_gains(axis)
        found = can_methods.METHODS
    except InputError:  # a model from which no gains follow
        pass
    try:
        module_moves.read_modules(machine)
    except InputError:  # numbers that modules of oacs cannot have
        return found
    return (*found, MOVES)


def check_methods(names: Sequence[str], mode: str) -> None:
    """InputError for methods that do not go together, and for one that the mode has not."""
    if MOVES in names:
        if len(names) > 1:
            raise InputError(f"{MOVES} is run alone: it has another report than methods A, B and C; choose one of both")
        module_moves.check_mode(mode)
        return
    for name in names:
        check_method(name, mode)


def run_together(
    nodes: Nodes,
    names: Sequence[str],
    file: Path,
    machine: Machine,
    setup: Setup,
    *,
    mode: str = SIMULATION,
    motion: str = "plan",
    synchronized: bool = True,
    channel: str | None = None,
    progress: Progress | None = None,
    begins: Callable[[int, float | None], None] = lambda number, seconds: None,
    tell: Callable[[str], None] = lambda note: None,
) -> list[MethodRun]:
    """Carry the program in `file` out by each of the methods `names`, one after the other.

    `progress` hears how many lines are read, `tell` what of the program is not carried out, and `begins` the number of
    the method that begins, with the s that it takes, where time is real. Errors as of `serial_motion`, `run_method`.
    """
    made = serial_motion(
        file,
        machine,
        setup,
        motion=motion,
        synchronized=synchronized,
        progress=progress,
        period=nodes.period,
        whole=nodes.whole,
    )
    for note in made.notes:
        tell(note)
    seconds = len(made.positions) * nodes.period if load_mode(mode).real_time else None
    runs = []
    for number, name in enumerate(names):
        begins(number, seconds)
        runs.append(nodes.carry_out(name, made, machine, mode=mode, channel=channel, **nodes.options))
    return runs


def all_of(nodes: Nodes, mode: str) -> list[str]:
    """What `all` stands for in a mode."""
    return [name for name in ALL if name in nodes.methods and not (name == THESIS and mode == EMULATION)]


def _has_steppers(machine: Machine) -> bool:
    return any(axis.module.get("motor") for axis in machine.axes.values())
