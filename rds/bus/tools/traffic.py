"""Whether a bus on which nobody answers is quiet, or taken by somebody who lets nobody else through."""

from __future__ import annotations

import can

from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import frames_within
from rds.bus.tools.statistics import Statistics
from rds.core.errors import MachineError

LISTENING = 0.25  # s
_TAKEN = 50.0  # % of the time: a machine whose own cycle takes so much answers
_LEAST = 0.5  # of the listening time: a burst within less of it takes no bus
_SHORTEST = 0.001  # s, of frames that come faster than they are read
_MANY = 500.0  # frames a second, where the bit rate is not known


def refuse_taken(bus: can.BusABC, seconds: float = LISTENING) -> None:
    """Listen to an open `bus` for `seconds`: MachineError naming the identifier that takes it, if one does.

    A node that babbles with an identifier lower than the host's lets no frame of the host on the bus. The frames' own
    time stamps tell how dense they were: a listener that is held up hears them later, and in fewer or more `seconds`.
    """
    rate = getattr(bus, "bitrate", None)
    heard = Statistics(rate) if rate else Statistics()
    try:
        for message in frames_within(bus, seconds):
            heard.add(message)
        is_quiet_now = bus.recv(0.0) is None
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    # whoever reads more slowly than they come knows nothing of the time after the last that it has read
    spanned = max(heard.snapshot().seconds, seconds * _LEAST if is_quiet_now else _SHORTEST)
    found = heard.snapshot(spanned)
    if found.load < _TAKEN if rate else found.rate + found.errors / spanned < _MANY:
        return
    most = max(found.rows, key=lambda row: row.count, default=None)
    who = "" if most is None else f", {most.count} of identifier {most.key}"
    errors = f", and {found.errors} error frames" if found.errors else ""
    share = f" ({found.load:.0f} % of the time)" if rate else ""
    raise MachineError(
        f"no module answers: bus {bus.channel_info} is taken; {found.frames} frames in {spanned:.2f} s{share}{who}"
        f"{errors}. A node babbles, or a host sends without a pause: unplug or end it, then scan again"
    )
