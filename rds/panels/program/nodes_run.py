"""A part program on the nodes of a machine as a panel orders it: which methods, which mode, and what came of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.machines import Machine
    from rds.nc.run.module_moves import MovesRun
    from rds.nc.run.serial_methods import MethodRun
    from rds.nc.setup import Setup
    from rds.results.reports.content import Report

Say = Callable[[str, float, float | None], None]


@dataclass(frozen=True)
class NodesRequest:
    """What is to be carried out, by which methods, in which mode; `folder` is for the report's files."""

    file: Path
    machine: str
    setup: Setup
    methods: Sequence[str]
    mode: str
    motion: str
    folder: Path


@dataclass(frozen=True)
class CarriedOut:
    """How it was: runs by methods A, B and C, or one by move commands."""

    file: Path
    settings: Mapping[str, Any]
    runs: Sequence[MethodRun] = ()
    moves: MovesRun | None = None
    files: Sequence[Path] = field(default_factory=list)  # of its report, the page first

    def report(self) -> Report:
        """The same as a report, whose pictures are drawn when asked for."""
        from rds.nc.run.module_moves import moves_report
        from rds.nc.run.serial_report import methods_report

        if self.moves is not None:
            return moves_report(self.moves, self.file, self.settings)
        return methods_report(self.runs, self.file, self.settings)


def carry_out(order: NodesRequest, say: Say, tell: Callable[[str], None]) -> CarriedOut:
    """Do it, and write its report. Errors as of `run_together` and `run_moves`.

    `say` hears what begins, how much is done (0 to 1), and the s that this takes, where it is known;
    `tell`, before anything moves, what of the program is not carried out.
    """
    from rds.machines import load_machine
    from rds.nc.run.module_moves import run_moves
    from rds.nc.run.node_methods import MOVES, nodes_of, run_together
    from rds.nc.run.serial_records import write_records
    from rds.results.reports.write import write

    say("reading the program", 0.0, None)
    machine, file = load_machine(order.machine), order.file
    channel = _served(machine, order)
    settings = {"machine": machine.name, "mode": order.mode}
    if MOVES in order.methods:
        moves = run_moves(
            *(file, machine, order.setup),
            mode=order.mode,
            channel=channel,
            tell=tell,
            carried=lambda done, of: say("moving", done / of if of else 0.0, None),
        )
        made = CarriedOut(file, settings, moves=moves)
    else:
        nodes, names = nodes_of(machine), order.methods
        runs = run_together(
            *(nodes, names, file, machine, order.setup),
            mode=order.mode,
            motion=order.motion,
            channel=channel,
            tell=tell,
            begins=lambda number, seconds: say(f"method {names[number]}", number / len(names), seconds),
        )
        made = CarriedOut(file, settings | {"motion": order.motion, **nodes.rate}, runs)
    say("writing its report", 1.0, None)
    files = write(made.report(), order.folder)
    if made.runs:
        files += write_records(made.runs, order.folder)
    return replace(made, files=files)


def _served(machine: Machine, order: NodesRequest) -> str | None:
    """The channel on which the nodes of the machine are served already; None where the run has its own.

    InputError for modules that speak what the methods are not of.
    """
    from rds.bus.hub.address import channels
    from rds.bus.modules.dcs.port import is_there
    from rds.bus.modules.dialects import DEFAULT, find_dialect
    from rds.bus.tools.link import BUILTIN
    from rds.modes import load_mode
    from rds.nc.run.node_methods import MOVES, nodes_of

    if not load_mode(order.mode).real_time:
        return None
    if nodes_of(machine).whole:  # on a serial line
        return machine.channel if os.name == "posix" and is_there(machine.channel) else None
    if machine.channel not in channels():
        return None
    found = find_dialect(machine, BUILTIN, machine.channel, DEFAULT)
    wanted = "oacs" if MOVES in order.methods else DEFAULT
    if found not in (None, wanted):
        raise InputError(
            f"the modules that are served on {machine.channel} speak {found}, and method {', '.join(order.methods)} "
            f"needs {wanted}: serve them by rds machine serve --dialect {wanted}, or end that server for a run with "
            "modules of its own"
        )
    return None if found is None else machine.channel
