"""A part program on the modules of a CAN bus (dialect rds) by methods A, B and C; see serial_methods.py.

The modules close their position loops (rds/bus/modules/rds/node_motion.py) by gains that come from the machine's model:
with τ and K of the model, Kv = 1/K cancels its speed and Kp = 1/(2 τ K) damps the loop by 1/√2;
Ki = Kp/(8 τ) is slow beside that.
"""

from __future__ import annotations

import csv
import secrets
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from rds.bus.hub.command import Command
from rds.bus.medium.bits import longest
from rds.bus.modules.drift import drift_by_axis, drifts
from rds.bus.modules.motion_course import MotionCourse
from rds.bus.modules.rds import frames, motion_frames
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.motion_frames import FINE, Buffer
from rds.bus.modules.rds.motion_host import MotionHost
from rds.bus.modules.rds.motion_port import CanPort, MotionPort, VirtualCan
from rds.bus.tools.link import BUILTIN, bus_name, open_bus, standard_filters
from rds.core.errors import InputError, MachineError
from rds.machines import Machine
from rds.machines.machine import Axis
from rds.modes import EMULATION, SIMULATION
from rds.nc.run.serial_methods import FREE, MethodRun, check_method, errors_from_path, gauges_file, segment_at
from rds.nc.run.serial_motion import SerialMotion, by_equations

METHODS = ("A", "B", "C", "B-free", "C-free")
BITRATE = 1_000_000
_SETTLE = 0.2  # s after the last step
_SPEED = 0.3  # of an axis's largest, on the way to where the program starts
_FULL_SPEED = 1000  # counts in a period that stand for the whole range of a spindle's voltage
_FULL = 0.8  # of the bus: a share above which it is too full to be relied on


def can_gains(axis: Axis, volts: float = 0.0, period: float = 1.0) -> tuple[float, ...]:
    """The gains of a module's position loop, by the model of its axis. InputError for a model without K and tau.

    Of a spindle: `volts` for `_FULL_SPEED` counts in a period.
    """
    if axis.is_spindle:
        return 0.0, volts * period / _FULL_SPEED, 0.0, 0.0, 0.0
    try:
        tau, K = float(axis.model["tau"]), float(axis.model["K"])
    except KeyError:
        raise InputError(
            f"axis {axis.name}: methods A, B and C need a model with tau and K, from which its module's gains follow; "
            f"model {axis.model.get('name')!r} has none: take linear-axis"
        ) from None
    count = axis.resolution
    friction = [float(axis.model.get(name, 0.0)) / K for name in ("friction_plus", "friction_minus")]
    proportional = 0.5 * count / (tau * K)
    return proportional, count / K, friction[0], friction[1], proportional / (8.0 * tau)


def check_room(machine: Machine, motion: SerialMotion, method: str, bitrate: int, period: float) -> None:
    """InputError for what does not fit: axes beyond a frame's set points, steps too long, a bus too slow."""
    names = [*motion.axes, *([motion.spindle.name] if motion.spindle is not None else [])]
    if method == "A" and (beyond := [name for name in names if machine.slots[name] >= motion_frames.SLOTS]):
        raise InputError(
            f"{beyond[0]} has slot {machine.slots[beyond[0]] + 1}, and a frame of method A carries the set points of "
            f"slots 1 to {motion_frames.SLOTS}; take method B or C"
        )
    steps = np.abs(np.diff(motion.positions, axis=0)).max(initial=0.0, axis=0) / motion.blu
    most = 1024.0 if method == "A" else motion_frames.MOST_INCREMENT
    if (steps > most).any():
        name = motion.axes[int(np.argmax(steps))]
        raise InputError(f"{name} moves {steps.max():.0f} counts in a step, more than {most:.0f}; lower the feed")
    count = len(names)
    bits = (1 + count) * longest(8) if method == "A" else count * longest(8) * 2 // motion_frames.PIECE
    share = bits / (bitrate * period)
    if method in ("A", "C", "C-free") and share > _FULL:
        needed = bits / (_FULL * bitrate)
        raise InputError(
            f"method {method} takes {100 * share:.0f} % of {bitrate} bit/s at a period of {period * 1e3:g} ms, above "
            f"{100 * _FULL:.0f} %; a period of {needed * 1e3:.2g} ms would do (--option period={needed:.2g}), or "
            f"{bits / (_FULL * period) / 1e3:.0f} kbit/s"
        )


def run_can_method(
    method: str,
    motion: SerialMotion,
    machine: Machine,
    *,
    mode: str = SIMULATION,
    bitrate: int = BITRATE,
    interface: str = BUILTIN,
    channel: str | None = None,
    drift: Any = (),
    **options: Any,
) -> MethodRun:
    """Carry the motion out by one of `METHODS`. `drift` (ppm by axis) is of modules that are started for the run.

    `interface`, `channel` and `options` are those of a bus where modules are served already. InputError for a method
    that the mode has not, or that does not fit; MachineError if a module or the bus fails.
    """
    check_method(method, mode)
    check_room(machine, motion, method, bitrate, motion.period)
    titles = {axis.node: f"{axis.name} (module {axis.node})" for axis in machine.axes.values()}
    if mode == SIMULATION:
        if channel is not None or options:
            raise InputError("a simulation has a bus of its own; leave channel and its options out")
        drifting = drift_by_axis(drift, machine)
        modules = [
            AxisModule(
                axis, machine.slots[axis.name], motion.period, 0.0, drifting[axis.name] * 1e-6, machine.converter.range
            )
            for axis in machine.axes.values()
        ]
        for module in modules:
            module.by_itself.gauge = []
        virtual = VirtualCan(modules, bitrate)
        course, bits, sent = _carry_out(method, MotionHost(virtual, titles, "the virtual bus"), motion, machine)
        rows = {module.name: np.array(module.by_itself.gauge) for module in modules}
        return _measured(method, motion, course, rows, sent, bits / bitrate)
    if mode == EMULATION:
        simulation = run_can_method(method, motion, machine, bitrate=bitrate, drift=drift)
        with ExitStack() as stack:
            port, where, trace = _bus(machine, interface, channel, bitrate, drift, options, stack)
            if trace is not None:
                stack.callback(rmtree, trace.parent, ignore_errors=True)
            dry, _, _ = _carry_out(method, MotionHost(port, titles, where), motion, machine, dry=True)
        course = replace(simulation.course, late=dry.late, missing=dry.missing, retries=dry.retries)
        return replace(simulation, course=course)
    with ExitStack() as stack:
        port, where, trace = _bus(machine, interface, channel, bitrate, drift, options, stack)
        course, bits, sent = _carry_out(method, MotionHost(port, titles, where), motion, machine)
    load = bits / bitrate
    if trace is None:
        return MethodRun(method, motion, course, bytes=sent, load=load / (course.ended - course.begun))
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in machine.axes}
    with open(trace, newline="") as file:
        for name, at, position in csv.reader(file):
            found[name].append((float(at), float(position)))
    rmtree(trace.parent)
    return _measured(method, motion, course, {name: np.array(each) for name, each in found.items()}, sent, load)


def _bus(
    machine: Machine,
    interface: str,
    channel: str | None,
    bitrate: int,
    drift: Any,
    options: Mapping[str, Any],
    stack: ExitStack,
) -> tuple[MotionPort, str, Path | None]:
    """A bus with the modules on it and the command of it, as long as `stack` is open, and the file of the modules' dial
    gauges if they are started for this run."""
    from rds.bus.modules.server_process import end_server, start_server

    trace = None
    if channel is None and interface == BUILTIN:
        channel = f"{machine.channel[:20]}-{secrets.token_hex(4)}"
        trace = stack.enter_context(gauges_file())
        said = ",".join(f"{name}:{ppm:g}" for name, ppm in drifts(drift or {}, machine).items())
        words = {"bitrate": bitrate, "trace": str(trace)} | ({"drift": said} if said else {})
        server = start_server("rds", machine.path, channel, words)
        stack.callback(end_server, server)
    elif drift:
        raise InputError("drift is of modules that the run starts itself; give it to `rds machine serve`")
    if interface == BUILTIN:
        stack.enter_context(Command(str(channel)))
    known = options if interface == BUILTIN else {**options, "bitrate": bitrate}
    bus = open_bus(interface, channel, None, node="host", **known)
    stack.callback(bus.shutdown)
    filters = standard_filters([frames.answer_identifier(axis.node) for axis in machine.axes.values()])
    for base in (motion_frames.PROGRESS, motion_frames.CLOCK):
        for axis in machine.axes.values():
            filters.append({"can_id": base + axis.node, "can_mask": 0x1FFFFFFF, "extended": True})
    bus.set_filters(filters)
    return CanPort(bus), bus_name(interface, channel), trace


def _carry_out(
    method: str, host: MotionHost, motion: SerialMotion, machine: Machine, dry: bool = False
) -> tuple[MotionCourse, int, int]:
    """The course, and bits and bytes that went over the bus meanwhile."""
    try:
        return _carried_out(method, host, motion, machine, dry)
    except MachineError:
        raise
    except BaseException:  # interrupted: method A's modules would go on for a while
        with suppress(MachineError):
            host.stop_all()
        raise


def _carried_out(
    method: str, host: MotionHost, motion: SerialMotion, machine: Machine, dry: bool
) -> tuple[MotionCourse, int, int]:
    period, nodes = motion.period, motion.units
    host.port.send(frames.SETUP, frames.encode_setup(period))
    if not dry:
        _approach(host, motion, machine)
    fine = np.rint(motion.positions / motion.blu * FINE).astype(np.int64)
    names, equations = list(motion.axes), list(motion.nodes)
    if motion.spindle is not None:
        turned = np.append(0, np.cumsum(motion.spindle.counts(_FULL_SPEED) * FINE))
        fine, names, nodes = (
            np.column_stack([fine, turned]),
            [*names, motion.spindle.name],
            (*nodes, motion.spindle.unit),
        )
        equations.append(motion.spindle.segments(_FULL_SPEED))
    kind = {"A": Buffer.NONE, "B": Buffer.SEGMENTS, "C": Buffer.INCREMENTS}[method[0]]
    for i, (name, node) in enumerate(zip(names, nodes, strict=True)):
        start = round(equations[i][0].own * FINE) if kind is Buffer.SEGMENTS else int(fine[0, i])
        host.begin(node, kind, start, can_gains(machine.axis(name), machine.converter.range, period))
    since = host.port.bits
    if method == "A":
        slots = {node: machine.slots[name] for name, node in zip(names, nodes, strict=True)}
        steps = len(fine) - 1
        if dry:
            host.stop_all()
            course = host.calls(nodes, steps, period)
        else:
            course = host.set_points(fine[1:].tolist(), slots, period)
    else:
        if method.startswith("B"):
            pieces = [motion_frames.pieces_of_segments(each) for each in equations]
            steps = sum(motion.counts)
        else:
            pieces = [motion_frames.pieces_of_increments(np.diff(fine[:, i]).tolist()) for i in range(len(nodes))]
            steps = len(fine) - 1
        found = dict(zip(nodes, pieces, strict=True))
        if dry:
            course = host.dry(found, steps, period)
        else:
            course = host.stream(found, steps, period, synchronize=not method.endswith(FREE))
    bits = host.port.bits - since
    if not dry:
        host.port.sleep(host.port.now() + _SETTLE)
        host.stop_all()
        host.port.sleep(host.port.now() + 0.01)
    return course, bits, host.port.sent_bytes


def _approach(host: MotionHost, motion: SerialMotion, machine: Machine) -> None:
    """Slowly to where the program starts."""
    there = np.array([host.position(node) for node in motion.units])
    way = motion.start - there
    speed = np.array([machine.axis(name).limits.velocity for name in motion.axes])  # type: ignore[union-attr]
    steps = int(np.ceil((np.abs(way) * motion.blu / (_SPEED * speed * motion.period)).max(initial=0.0)))
    if not steps:
        return
    places = there * FINE + np.rint(np.outer(np.arange(steps + 1) / steps, way * FINE)).astype(np.int64)
    pieces = {}
    for i, (name, node) in enumerate(zip(motion.axes, motion.units, strict=True)):
        host.begin(node, Buffer.INCREMENTS, int(places[0, i]), can_gains(machine.axis(name)))
        pieces[node] = motion_frames.pieces_of_increments(np.diff(places[:, i]).tolist())
    host.stream(pieces, steps, motion.period)
    host.port.sleep(host.port.now() + _SETTLE)


def _measured(
    method: str,
    motion: SerialMotion,
    course: MotionCourse,
    rows: Mapping[str, np.ndarray],
    sent: int,
    busy: float,
) -> MethodRun:
    """What the dial gauges say of it, each millisecond."""
    length = course.ended - course.begun
    time = np.arange(0.0, length, 1e-3)
    position = np.column_stack([_at(time, rows[name], course) for name in motion.axes])
    segment = segment_at(method, motion, course, time)
    exact, places = motion.positions, motion.segment
    if method.startswith("B"):
        exact, places = by_equations(motion.nodes, motion.blu, motion.counts)
    fine = motion.blu / FINE
    commanded = np.rint(exact / fine) * fine if not method.startswith("B") else exact
    return MethodRun(
        method,
        motion,
        course,
        time,
        position,
        errors_from_path(motion, position, segment),
        errors_from_path(motion, commanded, places),
        {},
        sent,
        busy / length,
        segment,
        np.zeros(0) if motion.spindle is None else _at(time, rows[motion.spindle.name], course),
    )


def _at(time: np.ndarray, rows: np.ndarray, course: MotionCourse) -> np.ndarray:
    """What a gauge showed at these instants since the motion began; `rows` are instants and readings."""
    return np.interp(time, rows[:, 0] - course.begun, rows[:, 1])
