"""From displacements to position bytes: the host functions of dcs-thesis, appendix D, section 6.3.

`prepare_data` is the thesis's own, and shows where it fails: each axis's feed is rounded by itself, so that axes do
not arrive together; the remainder is sent first, as a jerk; and its library counts in 100 ms what the firmware carries
out in 10 ms. `bytes_of` is what we run: whole BLU of a path's samples, each sample's remainder carried to the next
(`rds.interpolators.reference_pulse`), all axes in step.

We take the firmware's 10 ms (`commands.BYTE_TIME`), for four reasons: it is what the machine does; section 3.6.1 states
a bandwidth of 100 Hz; with 100 ms a byte's 127 BLU would end at 762 mm/min, below the machine's 1200; and at 1200
mm/min a straight line's corners would come only every 2 mm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import trunc
from typing import TYPE_CHECKING

from rds.bus.modules.dcs.commands import BUFFER, BYTE_TIME, MOST_STEPS, position_byte, steps_of
from rds.core.errors import InputError

if TYPE_CHECKING:
    import numpy as np

PER_MM = 100  # BLU: dcs-thesis, eq. 5.1


def prepare_data(displacement: float, feed: float, byte_time: float = BYTE_TIME) -> bytes:
    """Position bytes of a displacement (mm) at a feed (m/min), as the thesis's PrepareData makes them.

    With `byte_time` = 0.1 s they are exactly those of appendix D. InputError for a feed that rounds to nothing, where
    the original divides by zero.
    """
    if displacement == 0.0:
        return bytes(1)
    counts = min(float(round(abs(feed) * 1000.0 / 60.0 * PER_MM * byte_time)), float(MOST_STEPS))
    if counts == 0.0:
        least = 0.5 * 60.0 / (1000.0 * PER_MM * byte_time)
        raise InputError(f"feed {feed:g} m/min rounds to no BLU in {byte_time:g} s; it must be above {least:g} m/min")
    share = abs(displacement * PER_MM / counts)
    whole = trunc(share)
    first = round((share - whole) * counts)
    backward = 0x80 if displacement < 0.0 else 0
    return bytes([first + backward]) + bytes([int(counts) + backward]) * whole


def add_to_queue(dx: float, dy: float, dz: float, feed: float, byte_time: float = BYTE_TIME) -> tuple[bytes, ...]:
    """Position bytes of three axes for a straight move (mm) at `feed` (m/min), as the thesis's AddtoQueue queues them.

    The shorter ones end in bytes of no motion: their axes arrive earlier, and the path is no straight line.
    """
    length = (dx * dx + dy * dy + dz * dz) ** 0.5
    if length == 0.0:
        return (bytes(1),) * 3
    found = [prepare_data(d, d / length * feed, byte_time) for d in (dx, dy, dz)]
    longest = max(map(len, found))
    return tuple(data.ljust(longest, b"\0") for data in found)


def pulses_of(positions: np.ndarray, blu: Sequence[float]) -> np.ndarray:
    """Whole BLU (m × n) of samples (m + 1 × n, axis units); the remainders are carried. `blu` is each axis's.

    InputError where a step does not go into a position byte.
    """
    import numpy as np

    pulses: np.ndarray = np.diff(np.rint(positions / np.asarray(blu)).astype(np.int64), axis=0)
    if (most := int(np.abs(pulses).max(initial=0))) > MOST_STEPS:
        sample, axis = (int(each[0]) for each in np.nonzero(np.abs(pulses) == most))
        raise InputError(
            f"sample {sample + 1} moves axis number {axis + 1} by {most} BLU; a position byte holds {MOST_STEPS}: "
            "feed less, or take a shorter sample period"
        )
    return pulses


def bytes_of(pulses: Sequence[int] | np.ndarray) -> bytes:
    """The position bytes of one axis's pulses."""
    return bytes(position_byte(int(each)) for each in pulses)


def decoded(data: bytes) -> list[int]:
    """The pulses in position bytes."""
    return [steps_of(byte) for byte in data]


def fillings(data: bytes) -> Iterator[bytes]:
    """The data as buffers of 1500 bytes each, the last one filled with bytes of no motion."""
    for first in range(0, len(data), BUFFER):
        yield data[first : first + BUFFER].ljust(BUFFER, b"\0")
