"""What methods A, B and C take of a CAN bus: load and time left against units and bit rate (dialect rds).

The curves of figures 3.13, 3.15, 3.16 and 3.18 of dcs-thesis, which are of its serial line, for the frames of
rds/bus/modules/rds/motion_frames.py. With R the bit rate, n modules and the period T:

- figures 3.13 and 3.18, method A: a frame of set points and n answers, of 8 bytes each; what is left of T is for
  the controller. A frame carries four set points, so n is at most 4.
- figure 3.15, method C: n buffers of 1500 bytes, in pieces of 6 bytes with 2 bytes of their own. On CAN nothing rests
  meanwhile but the beginning of the motion.
- figure 3.16: the clocks of n modules are asked for by one frame; each answers by one. This happens four times a
  second, and not at each step.

- methods B and C as they run: what the motion itself needs, the four frames of a segment for each module, or a frame
  of three increments for each module in three periods.

Stuff bits depend on the content, so each formula gives a least and a most; what is measured lies between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rds.bus.medium.bits import longest, shortest
from rds.bus.modules.rds.motion_frames import BUFFER, PIECE, SLOTS
from rds.bus.modules.segments import SIZE as SEGMENT_SIZE
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.machines import Machine

BITRATES = (125_000, 250_000, 500_000, 1_000_000)
_COUNTS = range(1, 16)
_MEASURED = 20  # periods
_SOFT = (0.01, 0.0, 0.0, 0.0, 0.0)  # gains of motion_frames.Gain


@dataclass(frozen=True)
class CanTimes:
    """What `units` modules take of a bus of `bitrate`, s: by formula the most, or by measurement."""

    units: int
    bitrate: int
    cycle: float  # of method A
    filling: float  # of all buffers of 1500 bytes
    clocks: float  # asked for once


def by_formula(units: int, bitrate: int, most: bool = True) -> CanTimes:
    """With the most stuff bits that the frames can have, or with none."""
    bits = longest if most else shortest
    return CanTimes(
        units,
        bitrate,
        (1 + units) * bits(8) / bitrate,
        units * (BUFFER // PIECE) * bits(2 + PIECE) / bitrate,
        (bits(2) + units * bits(4, True)) / bitrate,
    )


COLUMNS = ("method", "bit rate [bit/s]", "takes [ms]", "of the period [%]", "left [ms]", "most modules")


def table(units: int, period: float, bitrates: Sequence[int] = BITRATES) -> list[list[Any]]:
    """Rows of method, bit rate, ms taken at worst, load in %, ms left, and the most modules that fit, of fifteen.

    InputError for modules that no program moves.
    """
    if units not in _COUNTS:
        raise InputError(f"{units} modules; the methods are reckoned for {_COUNTS[0]} to {_COUNTS[-1]}")
    rows: list[list[Any]] = []
    for method, (most, time) in _METHODS.items():
        for bitrate in bitrates:
            takes = time(units, bitrate)
            fitting = max((n for n in range(1, most + 1) if time(n, bitrate) <= period), default=0)
            rows.append([method, bitrate, takes * 1e3, 100.0 * takes / period, (period - takes) * 1e3, fitting])
    return rows


def _pieces(units: int, bitrate: int, pieces: float) -> float:
    """s of the bus for so many frames of data to each module."""
    return units * pieces * longest(2 + PIECE) / bitrate


# by method: the most modules that it can have, and s that it takes at worst; an increment has two bytes
_METHODS: dict[str, tuple[int, Callable[[int, int], float]]] = {
    "A, set points and answers": (SLOTS, lambda units, bitrate: by_formula(units, bitrate).cycle),
    "B, a segment a period": (_COUNTS[-1], lambda units, bitrate: _pieces(units, bitrate, SEGMENT_SIZE / PIECE)),
    "C, cyclic buffer": (_COUNTS[-1], lambda units, bitrate: _pieces(units, bitrate, 2.0 / PIECE)),
}


def measure(machine: Machine, units: int, bitrate: int) -> CanTimes:
    """The same with the machine's first `units` modules in virtual time, through the code that runs, bit by bit.

    `units` is 1 to 4. The modules follow softly: what they answer changes, where they stand does not matter.
    """
    from rds.bus.modules.rds import frames, motion_frames
    from rds.bus.modules.rds.module import AxisModule
    from rds.bus.modules.rds.motion_host import MotionHost
    from rds.bus.modules.rds.motion_port import VirtualCan

    period = 10.0 * by_formula(units, bitrate).cycle  # nothing meets anything else
    axes = [axis for axis in machine.axes.values() if not axis.is_spindle][:units]
    modules = [AxisModule(axis, slot, period, 0.0, 0.0) for slot, axis in enumerate(axes)]
    port = VirtualCan(modules, bitrate)
    host = MotionHost(port, {}, "the virtual bus")
    port.send(frames.SETUP, frames.encode_setup(period))
    slots = {axis.node: slot for slot, axis in enumerate(axes)}
    for axis in axes:
        host.begin(axis.node, motion_frames.Buffer.NONE, 0, _SOFT)
    before = port.bits
    rows = [[round(2000.0 * k / _MEASURED)] * units for k in range(_MEASURED)]
    host.set_points(rows, slots, period)
    cycle = (port.bits - before) / _MEASURED / bitrate
    host.stop_all()  # else the modules miss the host
    port.sleep(port.now() + period)
    before = port.bits
    for axis in axes:
        for number in range(BUFFER // PIECE):
            data = motion_frames.pieces_of_increments([number, -number, 100])[0]
            port.send(motion_frames.DATA, bytes([axis.node, number % 256]) + data)
    port.sleep(port.now() + 10.0 * by_formula(units, bitrate).filling)
    filling = (port.bits - before) / bitrate
    before = port.bits
    port.send(motion_frames.CONTROL, bytes([motion_frames.Verb.TIME, 0]))
    port.sleep(port.now() + period)
    return CanTimes(units, bitrate, cycle, filling, (port.bits - before) / bitrate)


def plot(machine: Machine, period: float, bitrates: Sequence[int] = BITRATES) -> Picture:
    """The four curves in one picture: lines by formula (the most), crosses by measurement."""
    import numpy as np

    from rds.core.figure import CYCLE, Picture, dress, legend

    picture = Picture(6.4)
    (frame, filling), (clocks, left) = picture.subplots(2, 2)
    there = sum(not axis.is_spindle for axis in machine.axes.values())
    counts = range(1, min(there, SLOTS) + 1)
    rates = np.linspace(10.0, 2000.0, 100)
    for bitrate, colour in zip(bitrates, CYCLE, strict=False):
        label = f"{bitrate / 1e3:g} kbit/s"
        found = [measure(machine, units, bitrate) for units in counts]
        lines = [by_formula(units, bitrate) for units in _COUNTS]
        room = lines[:SLOTS]
        frame.plot([one.units for one in room], [100 * one.cycle / period for one in room], color=colour, label=label)
        frame.plot(counts, [100.0 * one.cycle / period for one in found], "x", color=colour)
        filling.plot(_COUNTS, [one.filling for one in lines], color=colour, label=label)
        filling.plot(counts, [one.filling for one in found], "x", color=colour)
        clocks.plot(_COUNTS, [1e3 * one.clocks for one in lines], color=colour, label=label)
        clocks.plot(counts, [1e3 * one.clocks for one in found], "x", color=colour)
        whole = by_formula(counts[-1], bitrate).cycle
        left.plot(rates, [1e3 * max(0.0, 1.0 / f - whole) for f in rates], color=colour, label=label)
        left.plot([1.0 / period], [1e3 * max(0.0, period - found[-1].cycle)], "x", color=colour)
    frame.set_ylim(0.0, 150.0)
    left.set_yscale("log")
    dress(frame, f"load at {period * 1e3:g} ms, method A [%]", "modules (figure 3.13)")
    dress(filling, "filling all buffers [s]", "modules (figure 3.15)")
    dress(clocks, "asking for the clocks [ms]", "modules (figure 3.16)")
    dress(left, f"time left, {counts[-1]} modules [ms]", "sampling frequency [Hz] (figure 3.18)")
    for axes in (frame, filling, clocks):
        legend(axes)
    return picture
