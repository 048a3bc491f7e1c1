"""A part program on the units of a serial line by methods A, B and C, and how far the carriages were from the path.

In a simulation time is virtual, and so is the line. In an emulation the motion is that of the simulation, and beside it
host and line do their work in real time without moving anything (`dcs.dry_run`). In an implementation the units are a
process of their own, behind a pseudo-terminal or a real port; dial gauges at the simulated carriages say where these
really were.
"""

from __future__ import annotations

import csv
import secrets
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from rds.bus.hub.bus_settings import DEFAULT_BAUD
from rds.bus.modules.dcs import dry_run
from rds.bus.modules.dcs import methods as on_line
from rds.bus.modules.dcs.buffers import bytes_of
from rds.bus.modules.dcs.build import make_line
from rds.bus.modules.dcs.commands import MOST_STEPS
from rds.bus.modules.dcs.drivers import exchange_time
from rds.bus.modules.dcs.host import Host
from rds.bus.modules.dcs.port import SerialPort, VirtualPort, is_device
from rds.bus.modules.motion_course import MotionCourse
from rds.core.errors import InputError
from rds.machines import Machine
from rds.modes import EMULATION, SIMULATION, mode_names
from rds.nc.run.contour import contour_error
from rds.nc.run.serial_motion import SerialMotion, by_equations

METHODS = ("A", "B", "C", "C-thesis", "B-free", "C-free")
MODES = tuple(mode_names("controller"))
_REACH = 5.0  # mm from the reference that a carriage may be
_APPROACH = 2  # BLU in 10 ms on the way to where the program starts
_SETTLE = 0.2  # s after the last step
_LINEAR = ("X", "Y", "Z")
THESIS = "C-thesis"  # method C as the thesis has it: each byte of the host is a step, so that there is no dry run
FREE = "-free"  # of methods B and C: each node goes by its own clock, which nobody corrects


@dataclass(frozen=True)
class MethodRun:
    """A run by one method. Positions in axis units, errors in mm; where nobody measured, they are empty."""

    method: str
    motion: SerialMotion
    course: MotionCourse
    time: np.ndarray = field(default_factory=lambda: np.zeros(0))  # s since the motion began
    position: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # where the carriages were
    error: np.ndarray = field(default_factory=lambda: np.zeros(0))  # of the carriage from the path, feeds only
    path_error: np.ndarray = field(default_factory=lambda: np.zeros(0))  # of the commanded steps
    lost: Mapping[str, int] = field(default_factory=dict)  # steps by axis, at the end
    bytes: int = 0  # of the host
    load: float = 0.0  # share of the motion's time in which the host's wires are busy
    segment: np.ndarray = field(default_factory=lambda: np.zeros(0, int))  # of the path, at each instant of `time`
    speed: np.ndarray = field(default_factory=lambda: np.zeros(0))  # of a spindle that turned, rev/min
    astray: Mapping[str, int] = field(default_factory=dict)  # steps that a unit was sent and did not get, by axis


def check_method(method: str, mode: str) -> None:
    """InputError for an unknown method or mode, and for a method that the mode has not."""
    if method not in METHODS:
        raise InputError(f"method {method!r} is unknown; known: {', '.join(METHODS)}")
    if mode not in MODES:
        raise InputError(f"mode {mode!r} is none of {', '.join(MODES)}, in which units on a serial line run by methods")
    if mode == EMULATION and method == THESIS:
        raise InputError(
            "method C-thesis has no dry run: each byte that its host sends is a step; take C, or simulation"
        )


def run_method(
    method: str,
    motion: SerialMotion,
    machine: Machine,
    *,
    mode: str = SIMULATION,
    baud: float = DEFAULT_BAUD,
    channel: str | None = None,
    **line: Any,
) -> MethodRun:
    """Carry the motion out by one of `METHODS`; `line` are options of a line that is simulated (noise, drift...).

    InputError for a method that the mode has not; MachineError if a unit or the line fails.
    """
    check_method(method, mode)
    if method == "A" and (time := exchange_time(baud, len(machine.axes))) > motion.period:
        raise InputError(
            f"a frame of method A and its answers take {time * 1e3:.2f} ms at {baud:g} bit/s, more than a step of "
            f"{motion.period * 1e3:g} ms: raise the baud rate, or take B or C (`rds bus analyse` tells what fits)"
        )
    titles = {axis.node: f"{axis.name} (unit {axis.node})" for axis in machine.axes.values()}
    if mode == SIMULATION:
        if channel is not None:
            raise InputError("a simulation has a line of its own; leave the channel out, or take mode implementation")
        simulated = make_line(machine, baud=baud, **line)
        port = VirtualPort(simulated)
        rows: list[tuple[float, ...]] = []
        host = Host(port, baud, titles)
        _approach(host, motion)
        simulated.watch, simulated.next_look = lambda at, there: rows.append((at, *there)), port.now()
        sent, busy = simulated.down.bytes, simulated.down.busy
        course = _carry_out(method, host, motion, machine)
        port.sleep(port.now() + _SETTLE)
        traffic = (simulated.down.bytes - sent, simulated.down.busy - busy)
        astray = _astray(method, host, motion, machine)
        names = [unit.name for unit in simulated.units]
        return replace(_measured(method, motion, course, np.array(rows), names, traffic), astray=astray)
    if mode == EMULATION:
        simulation = run_method(method, motion, machine, baud=baud, **line)
        dry = _dry_run(method, motion, machine, titles, baud, channel, line)
        course = replace(simulation.course, late=dry.late, missing=dry.missing, retries=dry.retries)
        return replace(simulation, course=course)
    with ExitStack() as stack:
        where, trace = _line(machine, channel, baud, line, stack)
        real = SerialPort(where, baud)
        stack.callback(real.close)
        counted = _Counted(real)
        host = Host(counted, baud, titles, where)
        with host.stopping(hold=method == THESIS):
            _approach(host, motion)
            counted.bytes = 0
            course = _carry_out(method, host, motion, machine)
        traffic = (counted.bytes, counted.bytes * 10 / baud)
        real.sleep(real.now() + _SETTLE)
        astray = _astray(method, host, motion, machine)
    if trace is None:
        load = traffic[1] / (course.ended - course.begun)
        return MethodRun(method, motion, course, bytes=traffic[0], load=load, astray=astray)
    with open(trace, newline="") as file:
        names, *found = list(csv.reader(file))
    trace.unlink()
    trace.parent.rmdir()
    table = np.array([[float(cell) for cell in row] for row in found]).reshape(-1, len(names))
    return replace(_measured(method, motion, course, table, names[1:], traffic), astray=astray)


def _dry_run(
    method: str,
    motion: SerialMotion,
    machine: Machine,
    titles: dict[int, str],
    baud: float,
    channel: str | None,
    line: Mapping[str, Any],
) -> MotionCourse:
    """The same on a line in real time, on which nothing moves."""
    with ExitStack() as stack:
        where, trace = _line(machine, channel, baud, line, stack)
        if trace is not None:
            stack.callback(rmtree, trace.parent, ignore_errors=True)
        port = SerialPort(where, baud)
        stack.callback(port.close)
        host = Host(port, baud, titles, where)
        if method == "A":
            return dry_run.calls(host, motion.units, len(motion.pulses))
        if method.startswith("B"):
            nodes = dict(zip(motion.units, motion.nodes, strict=True))
            return dry_run.filled(host, on_line.segment_bytes(nodes), sum(motion.counts), nodes)
        data = {unit: bytes_of(motion.pulses[:, i]) for i, unit in enumerate(motion.units)}
        return dry_run.filled(host, data, len(motion.pulses))


class _Counted(SerialPort):
    """A port that counts what the host sends."""

    def __init__(self, port: SerialPort):
        self.__dict__.update(port.__dict__)
        self.bytes = 0

    def write(self, data: bytes) -> None:
        """As Port."""
        self.bytes += len(data)
        super().write(data)


def _line(
    machine: Machine, channel: str | None, baud: float, line: Mapping[str, Any], stack: ExitStack
) -> tuple[str, Path | None]:
    """The channel of the units, and the file of their dial gauges, if they are simulated for this run."""
    from rds.bus.modules.dcs.port import is_there
    from rds.bus.modules.server_process import end_server, start_server

    if channel is not None and (is_device(channel) or is_there(channel)):
        if line:
            raise InputError(f"{', '.join(line)} is for a line that the run starts itself; {channel} is there already")
        return channel, None
    where = channel if channel is not None else f"{machine.channel[:20]}-{secrets.token_hex(4)}"
    trace = stack.enter_context(gauges_file())
    server = start_server("dcs", machine.path, where, {**line, "baud": baud, "trace": str(trace)})
    stack.callback(end_server, server)
    return where, trace


@contextmanager
def gauges_file() -> Iterator[Path]:
    """A file for the readings of dial gauges, in a folder of its own, which goes if the block fails."""
    folder = Path(tempfile.mkdtemp(prefix="rds-gauges-"))
    try:
        yield folder / "gauges.csv"
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise


def _approach(host: Host, motion: SerialMotion) -> None:
    """Slowly to where the program starts."""
    there = np.array([host.inquire(unit).counts for unit in motion.units])
    way = motion.start - there
    steps = int(np.ceil(np.abs(way).max(initial=0) / _APPROACH))
    if steps:
        places = there + np.rint(np.outer(np.arange(steps + 1) / steps, way)).astype(np.int64)
        on_line.method_c(host, np.diff(places, axis=0), motion.units)


def _carry_out(method: str, host: Host, motion: SerialMotion, machine: Machine) -> MotionCourse:
    pulses, names, units = motion.pulses, list(motion.axes), list(motion.units)
    nodes = dict(zip(units, motion.nodes, strict=True))
    if motion.spindle is not None:
        pulses = np.column_stack([pulses, motion.spindle.counts(MOST_STEPS)])
        names, units = [*names, motion.spindle.name], [*units, motion.spindle.unit]
        nodes[motion.spindle.unit] = motion.spindle.segments(MOST_STEPS)
    if method == "A":
        order = list(machine.axes)
        return on_line.method_a(host, pulses, {u: order.index(name) for u, name in zip(units, names, strict=True)})
    synchronize = not method.endswith(FREE)
    if method.startswith("B"):
        return on_line.method_b(host, nodes, synchronize=synchronize)
    return on_line.method_c(host, pulses, units, as_thesis=method == THESIS, synchronize=synchronize)


def _astray(method: str, host: Host, motion: SerialMotion, machine: Machine) -> dict[str, int]:
    """Steps that each unit with a stepper was to get, less those that it says it got: what the line lost."""
    if method.startswith("B"):
        last = np.rint(by_equations(motion.nodes, motion.blu, motion.counts)[0][-1] / motion.blu)
    else:
        last = motion.start + motion.pulses.sum(axis=0)
    return {
        name: int(end) - host.inquire(unit).counts
        for name, unit, end in zip(motion.axes, motion.units, last, strict=True)
        if machine.axis(name).module.get("motor") == "stepper"
    }


def _measured(
    method: str,
    motion: SerialMotion,
    course: MotionCourse,
    rows: np.ndarray,
    names: Sequence[str],
    traffic: tuple[int, float],
) -> MethodRun:
    """What the dial gauges say of it."""
    during = (rows[:, 0] >= course.begun) & (rows[:, 0] <= course.ended + _SETTLE)
    time = rows[during, 0] - course.begun
    columns = [1 + list(names).index(name) for name in motion.axes]
    position = rows[during][:, columns]
    segment = segment_at(method, motion, course, time)
    exact, places = motion.positions, motion.segment
    if method.startswith("B"):
        exact, places = by_equations(motion.nodes, motion.blu, motion.counts)
    commanded = np.rint(exact / motion.blu) * motion.blu
    lost = np.rint((commanded[-1] - rows[-1, columns]) / motion.blu).astype(int)
    return MethodRun(
        method,
        motion,
        course,
        time,
        position,
        errors_from_path(motion, position, segment),
        errors_from_path(motion, commanded, places),
        {name: int(count) for name, count in zip(motion.axes, lost, strict=True)},
        traffic[0],
        traffic[1] / (course.ended - course.begun),
        segment,
        np.zeros(0) if motion.spindle is None else rows[during][:, 1 + list(names).index(motion.spindle.name)],
    )


def segment_at(method: str, motion: SerialMotion, course: MotionCourse, time: np.ndarray) -> np.ndarray:
    """Where on the path each instant belongs, as far as the method's clock tells."""
    if method.startswith("B"):
        steps = np.cumsum(motion.counts)
        at = np.searchsorted(steps, time / motion.period, "right")
        return np.asarray(np.minimum(at, len(steps) - 1))
    if method == THESIS:  # the host keeps the steps, and pauses between buffers
        made = np.searchsorted(np.asarray(course.instants) - course.begun, time, "right")
        return np.asarray(motion.segment[np.minimum(made, len(motion.segment) - 1)])
    share = np.clip(time / max(course.ended - course.begun, 1e-9), 0.0, 1.0)
    found: np.ndarray = motion.segment[np.rint(share * (len(motion.segment) - 1)).astype(int)]
    return found


def errors_from_path(motion: SerialMotion, position: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Distance from the path of each position in a feed, mm; of all, where there are rapids only."""
    path = motion.prepared.path
    points = np.zeros((len(position), 3))
    for i, name in enumerate(motion.axes):
        if name in _LINEAR:
            points[:, _LINEAR.index(name)] = position[:, i]
    error, _ = contour_error(points, path, np.asarray(segment), np.full(len(points), _REACH))
    feeds = ~path["rapid"][segment]
    return error[feeds] if feeds.any() else error
