"""What a serial line holds: load and time left against units, baud rate and period, by method (dcs-thesis, chapter 3).

With b = 10/baud the time of a byte, n units and the period T:

- figures 3.13 and 3.18, method A as in the thesis: a frame of 1 + 2n bytes; what is left of T is for the controller.
  Ours has six places at least, a checksum, and answers of seven bytes (`drivers.exchange_time`).
- figure 3.15, method C: n buffers of 1500 bytes, with the selections and answers, in which the motion rests.
- figure 3.16: a step of a buffer costs the host's byte and the master's answer; the thesis counts three bytes.
- methods B and C with a cyclic buffer: what the motion itself needs, a byte for each unit and step, or 24 bytes for
  each unit and segment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any

from rds.bus.modules import segments
from rds.bus.modules.dcs import commands, frames
from rds.bus.modules.dcs.commands import BUFFER, TURN_ROUND
from rds.bus.modules.dcs.frames import SIZE, SLOTS, UNITS, byte_time
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.core.figure import Picture

BAUDS = (9_600, 19_200, 38_400, 57_600, 115_200, 1_000_000)
_FILLING = commands.data_size(200)  # bytes of a piece of data, and its report
_SYNC_BYTES = 3  # section 3.6.2


@dataclass(frozen=True)
class Fit:
    """What a method takes of a period, s; `left` may be negative. A loop refuses more than the `share` of it."""

    method: str
    units: int
    baud: float
    period: float
    time: float
    share: float = 1.0

    @property
    def left(self) -> float:
        """What is left of the period, s."""
        return self.period - self.time

    @property
    def load(self) -> float:
        """Share of the period."""
        return self.time / self.period

    @property
    def fits(self) -> bool:
        """Whether it does."""
        return self.load <= self.share


def frame_time(units: int, baud: float) -> float:
    """Method A as in the thesis: s for a frame of 1 + 2n bytes, without answers."""
    return (1 + 2 * units) * byte_time(baud)


def cycle_time(units: int, baud: float) -> float:
    """Method A here: s for a frame with its checksum and the answers of all units, one after the other."""
    byte = byte_time(baud)
    frame = (SIZE + 2 * max(0, units - SLOTS) + 1) * byte
    return frame + units * (frames.ANSWER_SIZE * byte + TURN_ROUND)


def filling_time(units: int, baud: float) -> float:
    """Method C as in the thesis: s in which the motion rests while the buffers of all units are filled."""
    return units * ((BUFFER + 4) * byte_time(baud) + 2 * TURN_ROUND)


def synchronization_time(baud: float) -> float:
    """Method C as in the thesis: s that the synchronization of a step takes, of three bytes."""
    return _SYNC_BYTES * byte_time(baud)


def cyclic_time(units: int, baud: float) -> float:
    """Method C with a cyclic buffer: s of the line for each step of all units."""
    return units * _FILLING * byte_time(baud) / 200.0


def segment_time(units: int, baud: float) -> float:
    """Method B: s of the line for one segment of all units."""
    return units * commands.data_size(segments.SIZE) * byte_time(baud)


def fits(units: int, baud: float, period: float) -> list[Fit]:
    """The methods at these numbers. InputError for units that a line cannot have, or a period that is none."""
    if units not in UNITS:
        raise InputError(f"{units} units; a serial line has {UNITS[0]} to {UNITS[-1]}")
    if not 0.0 < period < inf:
        raise InputError(f"period {period!r} must be a positive number of s")
    times = {
        "A, frame alone (thesis)": frame_time(units, baud),
        "A, with answers": cycle_time(units, baud),
        "B, a segment a period": segment_time(units, baud),
        "C, cyclic buffer": cyclic_time(units, baud),
        "C, a byte a step (thesis)": synchronization_time(baud),
    }
    shares = {"A, with answers": frames.FULL}
    return [Fit(method, units, baud, period, time, shares.get(method, 1.0)) for method, time in times.items()]


def most_units(method: int, baud: float, period: float) -> int:
    """How many units the method of this place in `fits` can have; 0: none."""
    return max((units for units in UNITS if fits(units, baud, period)[method].fits), default=0)


def table(units: int, period: float, bauds: Sequence[int] = BAUDS) -> list[list[Any]]:
    """Rows of method, baud, ms taken, load in %, ms left and the most units that fit."""
    rows: list[list[Any]] = []
    for place, first in enumerate(fits(units, bauds[0], period)):
        for baud in bauds:
            fit = fits(units, baud, period)[place]
            most = most_units(place, baud, period)
            rows.append([first.method, baud, fit.time * 1e3, 100.0 * fit.load, fit.left * 1e3, most])
    return rows


COLUMNS = ("method", "baud [bit/s]", "takes [ms]", "of the period [%]", "left [ms]", "most units")


@dataclass(frozen=True)
class Measured:
    """What was measured on a line: s."""

    units: int
    baud: float
    frame: float  # of the thesis
    cycle: float  # with answers
    filling: float  # of all buffers
    synchronization: float  # of a step


def measure(machine: Any, baud: float, units: Sequence[int] | None = None) -> Measured:
    """The same quantities, measured on a line with the machine's units in virtual time, through the code that runs."""
    from rds.bus.modules.dcs.build import make_line
    from rds.bus.modules.dcs.frames import Info, Mode
    from rds.bus.modules.dcs.host import Host
    from rds.bus.modules.dcs.port import VirtualPort

    line = make_line(machine, baud=baud)
    port = VirtualPort(line)
    host = Host(port, baud, {})
    used = [unit.number for unit in line.units] if units is None else list(units)
    port.write(frames.encode(Info(Mode.CALL, 0, False, False), bytes(SIZE - 1)))
    frame = line.down.free - port.now()
    port.sleep(port.now() + 0.05)
    begun = port.now()
    port.write(frames.encode(Info(Mode.CALL), bytes(SIZE - 1)))
    got = 0
    while got < len(line.units) * frames.ANSWER_SIZE:
        got += len(port.read(1.0))
    cycle = port.now() - begun
    port.sleep(port.now() + 0.05)
    begun = port.now()
    for unit in used:
        host.fill(unit, bytes(BUFFER), unit == used[0], checked=False)
    filling = port.now() - begun
    begun = port.now()
    host.step_through(used[0])
    step = (port.now() - begun) / BUFFER - commands.BYTE_TIME
    return Measured(len(used), baud, frame, cycle, filling, step)


def plot(machine: Any, period: float, bauds: Sequence[int] = BAUDS[:5]) -> Picture:
    """Figures 3.13, 3.15, 3.16 and 3.18 in one picture: lines by formula, crosses by measurement."""
    import numpy as np

    from rds.core.figure import CYCLE, Picture, dress, legend

    picture = Picture(6.4)
    (frame, filling), (sync, left) = picture.subplots(2, 2)
    units = list(UNITS)
    found = [measure(machine, baud) for baud in bauds]
    for baud, one, colour in zip(bauds, found, CYCLE * len(bauds), strict=False):
        label = f"{baud} bit/s"
        frame.plot(units, [100.0 * frame_time(n, baud) / period for n in units], color=colour, label=label)
        frame.plot([SLOTS], [100.0 * one.frame / period], "x", color=colour)
        filling.plot(units, [filling_time(n, baud) for n in units], color=colour, label=label)
        filling.plot([one.units], [one.filling], "x", color=colour)
        rates = np.linspace(10.0, 500.0, 60)
        left.plot(rates, [1e3 * max(0.0, 1.0 / f - frame_time(SLOTS, baud)) for f in rates], color=colour, label=label)
        left.plot([1.0 / period], [1e3 * max(0.0, period - one.frame)], "x", color=colour)
    sync.plot(bauds, [1e3 * synchronization_time(baud) for baud in bauds], color=CYCLE[0], label="three bytes")
    sync.plot(
        [one.baud for one in found], [1e3 * one.synchronization for one in found], "x", color=CYCLE[1], label="measured"
    )
    frame.set_ylim(0.0, 150.0)
    left.set_yscale("log")
    sync.set_xscale("log")
    dress(frame, "load by frames [%]", "units (figure 3.13)")
    dress(filling, "filling all buffers [s]", "units (figure 3.15)")
    dress(sync, "synchronization [ms]", "baud rate [bit/s] (figure 3.16)")
    dress(left, "time left, 6 units [ms]", "sampling frequency [Hz] (figure 3.18)")
    for axes in (frame, filling, sync):
        legend(axes)
    return picture
