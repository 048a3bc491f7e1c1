"""A part program by the controllers of distributed modules: a move command to each axis of a line (oacs-thesis, 8.7).

A move command takes one axis to a point, at the speed that its module's controller makes of it. The axes of a line
start together, each arrives by itself, and the next line begins when all have arrived. So no feed is kept, nor the way
between two points: it is for positioning, as in drilling. What keeps to a path is commanded cyclically, in a loop.

In a simulation the modules are virtual and time is that of their bus; a dial gauge says where each axis really is.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.bus.hub.command import Command
from rds.bus.modules.oacs.codes import Kind, MessageToHost, Select
from rds.bus.modules.oacs.messages import Decoded
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import ModuleData, read_modules
from rds.bus.modules.oacs.module_group import BusPort, ModuleGroup, Port, VirtualPort
from rds.bus.modules.oacs.pid import Tuning
from rds.bus.tools.link import BUILTIN, open_bus
from rds.core.errors import InputError, MachineError
from rds.core.progress import Progress
from rds.interpolators.motion.segments import AXES, JOINTS, LINE
from rds.machines import Machine
from rds.modes import EMULATION, SIMULATION, mode_names
from rds.nc.path_block import Event, PathBlock
from rds.nc.run.prepare import compiled_form
from rds.nc.setup import Setup
from rds.results.reports.content import Report, Table

if TYPE_CHECKING:
    from rds.core.figure import Picture

METHOD = "moves"
MODES = tuple(name for name in mode_names("controller") if name != EMULATION)
MACHINE = "mrmt-oacs"
BITRATE = 500_000  # bit/s, of a real bus: appendix H
COLUMNS = ("line", "axis", "unit", "from", "to", "arrived", "off", "gauge", "gauge off", "time [s]")
_DIGITS = dict.fromkeys(("arrived", "off", "gauge", "gauge off"), 3) | {"time [s]": 2}
_SLACK = 10.0  # s that a motion may take beyond twice its way at the slowest speed
_SLOWEST = 0.1  # unit/s, where a module says no speed
_NOTE = (
    "Arrived: where the axis stands by its module's encoder; gauge: where it really is, by a dial gauge at the "
    "simulated axis. Off: from the point that the line says. Time: from the command to its last acknowledgement."
)
_NOT_CARRIED = {"stop": "M0 and M1", "tool": "tool changes", "coolant": "coolant", "output": "outputs"}


@dataclass(frozen=True)
class AxisMove:
    """One axis in one line, axis units and s. `gauge` is where the axis really was; None where nobody measured."""

    line: int
    axis: str
    unit: str
    start: float
    end: float
    arrived: float
    gauge: float | None
    seconds: float

    @property
    def off(self) -> float:
        """How far from the point it stands by its module; positive beyond in the axis's direction."""
        return self.arrived - self.end


@dataclass(frozen=True)
class MovesRun:
    """A program carried out by move commands: each axis of each line, the time that it took, s, and what was left out.

    `accuracy` is what the module of each axis promises, in its unit; 0 where it promises nothing. `positions` are what
    the modules told on their way, by axis: s since the beginning, and axis units.
    """

    moves: tuple[AxisMove, ...]
    seconds: float
    accuracy: Mapping[str, float]
    notes: tuple[str, ...]
    positions: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)


def run_moves(
    file: Path,
    machine: Machine,
    setup: Setup | None = None,
    *,
    mode: str = SIMULATION,
    channel: str | None = None,
    interface: str = BUILTIN,
    bitrate: int = BITRATE,
    tuning: Mapping[str, float | str] | None = None,
    progress: Progress | None = None,
    carried: Progress | None = None,
    tell: Callable[[str], None] = lambda note: None,
) -> MovesRun:
    """Carry the program in `file` out by the modules of `machine`, in a mode of `MODES`.

    `tuning` (fields of `rds.bus.modules.oacs.pid.Tuning`) is of modules that the run starts itself; those that are
    served on `channel` keep theirs. `progress` hears how many lines are read, `carried` how many moves are carried out,
    and `tell`, before anything moves, what of the program is not.
    InputError for a mode or a program that move commands cannot carry out; MachineError if a module or the bus fails.
    """
    check_mode(mode)
    blocks = list(compiled_form(file, machine, setup or Setup(), progress).blocks())
    rows = [row for block in blocks for row in block.segments]
    _require_points(rows, file)
    if mode != SIMULATION:
        _require_no_hands(blocks, file)
    modules = read_modules(machine)
    chosen = _tuning(tuning or {})
    notes = ["F is not obeyed: each module moves at the speed of its own controller."]
    if left := sorted({_NOT_CARRIED[e.kind] for block in blocks for e in block.events if e.kind in _NOT_CARRIED}):
        notes.append(f"Modules move axes and a tool only; not carried out of the program: {', '.join(left)}.")
    for note in notes:
        tell(note)
    with ExitStack() as stack:
        if mode == SIMULATION:
            if channel is not None:
                raise InputError("a simulation has modules of its own; leave the channel out")
            virtual = _virtual(machine, modules)
            port: Port = VirtualPort(list(virtual.values()))
            gauges = {name: module.plant for name, module in virtual.items()}
        else:
            port, gauges = _bus(machine, channel, interface, bitrate, stack), {}
        host = ModuleGroup(port, {data.node: f"{name} (module {data.node})" for name, data in modules.items()})
        if chosen is not None:
            if mode != SIMULATION and not _starts_modules(channel, interface):
                raise InputError(
                    f"{', '.join(chosen[1]) or 'controller'}: modules that are served already keep their tuning; set "
                    "it by `rds module ID tune`"
                )
            for data in modules.values():
                if data.kind != Kind.TOOL:
                    host.tune(data.node, *chosen)
        require_start(host, modules, {AXES[k]: float(place) for k, place in enumerate(rows[0]["start"])})
        done, began = _Carrier(host, machine, modules, gauges), port.now()
        try:
            number = 0
            for row, events in _in_order(blocks):
                done.carry_out(row, events)
                number += row is not None
                if carried is not None:
                    carried(number, len(rows))
        finally:
            host.stop()
        seconds = port.now() - began
    accuracy = {name: modules[name].accuracy for name in dict.fromkeys(move.axis for move in done.moves)}
    told = {name: tuple(places) for name, places in done.told.items()}
    return MovesRun(tuple(done.moves), seconds, accuracy, tuple(notes), told)


def check_mode(mode: str) -> None:
    """InputError for a mode that move commands have not."""
    if mode not in MODES:
        raise InputError(f"method {METHOD} runs in {' and '.join(MODES)}: a move command has no dry run; not in {mode}")


def require_start(host: ModuleGroup, modules: Mapping[str, ModuleData], start: Mapping[str, float]) -> None:
    """MachineError, before anything moves, where an axis stands off the place from which the program takes it.

    All axes are asked, not only those that the program moves: a line that sends an axis to where it is thought to be
    already has no motion for it. Nor is an axis brought there: what the tool would meet on the way nobody knows.
    """
    off = []
    for name, data in modules.items():
        if data.kind == Kind.TOOL:
            continue
        here, there = host.position(data.node) / data.counts_per_unit, start.get(name, 0.0)
        if abs(here - there) > max(data.accuracy, 1.0 / data.counts_per_unit):
            off.append((name, data, here, there))
    if not off:
        return
    off.sort(key=lambda found: found[0] != "Z")  # the tool leaves the work first
    said = ", ".join(f"{name} stands at {here:.4g} {data.unit}" for name, data, here, _ in off)
    moves = ", then ".join(f"`rds module {data.node} move --to {there:g}`" for _, data, _, there in off)
    homes = ", ".join(f"`rds module {data.node} home`" for _, data, _, _ in off)
    begins = ", ".join(f"{name} at {there:g}" for name, _, _, there in off)
    raise MachineError(
        f"{said}, and the program begins with {begins}: nothing has moved; take the axes there, Z first, in the Jog "
        f"panel or by {moves}, with --channel of their bus (where the zero is lost, {homes} before)"
    )


class _Carrier:
    """Carries lines out, one after the other, and keeps what came of them."""

    def __init__(
        self, host: ModuleGroup, machine: Machine, modules: Mapping[str, ModuleData], gauges: Mapping[str, Any]
    ):
        self._host, self._modules, self._gauges = host, modules, gauges
        self._by_number = {data.node: data for data in modules.values() if data.kind != Kind.TOOL}
        self._began = host.port.now()
        self.told: dict[str, list[tuple[float, float]]] = {}
        host.listen = self._listen
        self._axes = {AXES.index(name): name for name in machine.axes if name in AXES}
        self._tool = next((data.node for data in modules.values() if data.kind == Kind.TOOL), None)
        self.moves: list[AxisMove] = []

    def carry_out(self, row: np.void | None, events: Sequence[Event]) -> None:
        """The motion of a segment, if there is one, then what happens after it."""
        if row is not None:
            self._move(row)
        for event in events:
            if event.kind == "dwell":
                self._host.rest(float(event.value))
            elif event.kind == "spindle" and self._tool is not None:
                self._host.turn(self._tool, float(event.value))

    def _listen(self, at: float, message: Decoded) -> None:
        """Keep the positions that modules tell on their way."""
        fields = message.fields
        if message.kind == "Reply" and fields["Code"] == MessageToHost.POSITION:
            data = self._by_number.get(fields["BoardID"])
            if data is not None:
                place = fields["Position"] / data.counts_per_unit
                self.told.setdefault(data.name, []).append((at - self._began, place))

    def _move(self, row: np.void) -> None:
        moved = {self._axes[int(k)]: int(k) for k in np.flatnonzero(row["start"] != row["end"])}
        if not moved:
            return
        targets = {self._modules[name].node: float(row["end"][k]) for name, k in moved.items()}
        ways = {name: abs(row["end"][k] - row["start"][k]) for name, k in moved.items()}
        patience = max(_patience(self._modules[name], way) for name, way in ways.items())
        arrived = self._host.to(targets, patience)
        for name, k in moved.items():
            data = self._modules[name]
            end = arrived[data.node]
            gauge = self._gauges[name].true_position if name in self._gauges else None
            start, to = float(row["start"][k]), float(row["end"][k])
            at = end.counts / data.counts_per_unit
            self.moves.append(AxisMove(int(row["line"]), name, data.unit, start, to, at, gauge, end.seconds))


def _in_order(blocks: Sequence[PathBlock]) -> Iterator[tuple[np.void | None, list[Event]]]:
    """The segments of all blocks, each with the events after it; those before a block's first come with none."""
    for block in blocks:
        yield None, [event for event in block.events if event.after < 0]
        for k, row in enumerate(block.segments):
            yield row, [event for event in block.events if event.after == k]


def _require_points(rows: Sequence[np.void], file: Path) -> None:
    """InputError for a program that is more than points to go to."""
    for row in rows:
        if row["plane"] != LINE:
            raise InputError(
                f"line {row['line']} is an arc, and a move command takes an axis to a point: leave --method out, which "
                "commands the modules cyclically, or write the arc as straight moves",
                str(file),
            )
        if row["tip"] != JOINTS:
            raise InputError(
                f"line {row['line']} is a move for the tool's tip (G43.4), and a move command takes one axis to a "
                "point: leave --method out",
                str(file),
            )
    if not any((row["start"] != row["end"]).any() for row in rows):
        raise InputError("nothing in it moves: there is nothing to run", str(file))


def _require_no_hands(blocks: Sequence[PathBlock], file: Path) -> None:
    """InputError for a program that stops for somebody's hands, which a run that does not stop would meet."""
    stopped = None
    for row, events in _in_order(blocks):
        if stopped is not None and row is not None and (row["start"] != row["end"]).any():
            raise InputError(
                f"line {stopped} waits for somebody (M0, M1) and line {row['line']} moves on, but move commands do not "
                "wait: end the program at the stop and make the rest another one, or leave --method out",
                str(file),
            )
        for event in events:
            if event.kind == "tool":
                raise InputError(
                    f"line {event.line} changes the tool (M6), and move commands do not wait for it: make a program "
                    "for each tool, without M6, or leave --method out",
                    str(file),
                )
            if event.kind == "stop":
                stopped = event.line


def _virtual(machine: Machine, modules: Mapping[str, ModuleData]) -> dict[str, OacsModule]:
    return {
        axis.name: OacsModule(axis, modules[axis.name], slot, machine.sample_period, 0.0, slot, machine.converter.range)
        for slot, axis in enumerate(machine.axes.values())
    }


def _starts_modules(channel: str | None, interface: str) -> bool:
    """Whether modules are started for the run, where nobody says which bus they are on."""
    return channel is None and interface == BUILTIN


def _bus(machine: Machine, channel: str | None, interface: str, bitrate: int, stack: ExitStack) -> BusPort:
    """A bus with the modules on it, and the command of it, as long as `stack` is open.

    The modules are started for this run where no channel and no other bus is said.
    """
    from rds.bus.modules.server_process import end_server, start_server

    if _starts_modules(channel, interface):
        channel = f"{machine.channel[:20]}-{secrets.token_hex(4)}"
        stack.callback(end_server, start_server("oacs", machine.path, channel))
    if interface == BUILTIN:
        stack.enter_context(Command(str(channel)))
    bus = open_bus(interface, channel, None, node="host", **({} if interface == BUILTIN else {"bitrate": bitrate}))
    stack.callback(bus.shutdown)
    return BusPort(bus)


def _tuning(words: Mapping[str, float | str]) -> tuple[Select, dict[str, float]] | None:
    """Controller and parameters; None where nothing is said. InputError for those that cannot be."""
    if not words:
        return None
    known = [field.name for field in fields(Tuning)]
    if unknown := [name for name in words if name not in known]:
        raise InputError(
            f"--option {unknown[0]} is none of method {METHOD}; it takes interface and bitrate of the bus, and "
            f"of the modules' controllers {', '.join(known)}"
        )
    values = dict(words)
    name = str(values.pop("controller", "PID")).upper()
    if name not in Select.__members__:
        raise InputError(f"controller = {name!r} must be PI or PID")
    Tuning(controller=Select[name], **values)  # type: ignore[arg-type]
    return Select[name], {key: float(value) for key, value in values.items()}


def _patience(data: ModuleData, way: float) -> float:
    """s that a motion may take."""
    slowest = min(data.clockwise_speed, data.counterclockwise_speed) / 60.0
    return _SLACK + 2.0 * float(way) / max(slowest, _SLOWEST)


def moves_report(run: MovesRun, file: Path, settings: Mapping[str, Any]) -> Report:
    """The run as a table, and what it comes to as sentences."""
    table = Table("Moves", COLUMNS, [_row(move) for move in run.moves], _NOTE, _DIGITS)
    lines = len({move.line for move in run.moves})
    said = [f"{lines} line{'s' * (lines != 1)} with motion in {run.seconds:.1f} s."]
    for name, promised in run.accuracy.items():
        own = [move for move in run.moves if move.axis == name]
        worst = max(own, key=lambda move: abs(_true(move) - move.end))
        off = abs(_true(worst) - worst.end)
        verdict = "" if not promised else f", {'within' if off <= promised else 'beyond'} its {promised:g} {worst.unit}"
        said.append(f"{name} ends {off:.3g} {worst.unit} off at most, in line {worst.line}{verdict}.")
    return Report(
        kind="module-moves",
        title=f"{file.name} on {settings['machine']} by move commands",
        sources=[str(file)],
        settings=settings,
        tables=[table],
        figures={"Positions": lambda: _picture(run)} if run.positions else {},
        findings=[*said, *run.notes],
    )


def _picture(run: MovesRun) -> Picture:
    """Each axis over time as its module told it, and the points that it was sent to."""
    from rds.core.figure import BLACK, CYCLE, Picture, dress, legend, quantity

    names = [name for name in run.accuracy if run.positions.get(name)]
    picture = Picture(0.8 + 1.5 * len(names))
    for k, (axes, name) in enumerate(
        zip(np.atleast_1d(picture.subplots(len(names), 1, sharex=True)), names, strict=True)
    ):
        time, place = np.array(run.positions[name]).T
        axes.plot(time, place, color=CYCLE[k % len(CYCLE)], label=f"{name}, by its module")
        own = [move for move in run.moves if move.axis == name]
        for number, move in enumerate(own):
            label = "points of the program" if not number else None
            axes.axhline(move.end, color=BLACK, linewidth=0.7, linestyle=":", label=label)
        dress(axes, quantity(name, own[0].unit), "time [s]" if name == names[-1] else None)
        legend(axes)
    return picture


def _true(move: AxisMove) -> float:
    return move.arrived if move.gauge is None else move.gauge


def _row(move: AxisMove) -> list[Any]:
    gauge = (None, None) if move.gauge is None else (move.gauge, move.gauge - move.end)
    return [move.line, move.axis, move.unit, move.start, move.end, move.arrived, move.off, *gauge, move.seconds]
