"""Whether a bus on which nobody answers is quiet, or taken by somebody who lets nobody else through."""

from __future__ import annotations

import time

import can

from rds.bus.statistics import Statistics
from rds.core.errors import MachineError

LISTENING = 0.25  # s
_TAKEN = 50.0  # % of the time: a machine whose own cycle takes so much answers
_MANY = 500.0  # frames a second, where the bit rate is not known


def refuse_taken(bus: can.BusABC, seconds: float = LISTENING) -> None:
    """Listen to an open `bus` for `seconds`: MachineError naming the identifier that takes it, if one does.

    A node that babbles with an identifier lower than the host's lets no frame of the host on the bus.
    """
    rate = getattr(bus, "bitrate", None)
    heard = Statistics(rate) if rate else Statistics()
    until = time.monotonic() + seconds
    try:
        while (left := until - time.monotonic()) > 0.0:
            message = bus.recv(left)
            if message is not None:
                heard.add(message)
    except (can.CanError, OSError) as error:
        raise MachineError(f"bus {bus.channel_info} failed: {error}; check the cable and the interface") from error
    found = heard.snapshot(seconds)
    if found.load < _TAKEN if rate else found.rate + found.errors / seconds < _MANY:
        return
    most = max(found.rows, key=lambda row: row.count, default=None)
    who = "" if most is None else f", {most.count} of identifier {most.key}"
    errors = f", and {found.errors} error frames" if found.errors else ""
    share = f" ({found.load:.0f} % of the time)" if rate else ""
    raise MachineError(
        f"no module answers: bus {bus.channel_info} is taken; {found.frames} frames in {seconds:g} s{share}{who}"
        f"{errors}. A node babbles, or a host sends without a pause: unplug or end it, then scan again"
    )
