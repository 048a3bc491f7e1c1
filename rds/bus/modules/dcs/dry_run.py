"""Methods A, B and C without motion, for emulation: the host and the line do their work, and the units stand.

Method A sends a call in place of each period's increments; its units answer as to any frame. Methods B and C fill the
buffers, never say go, look after each unit ten times a second for as long as the motion would take, and stop all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rds.bus.modules.dcs import frames
from rds.bus.modules.dcs.answers import AnswerStream
from rds.bus.modules.dcs.commands import BYTE_TIME
from rds.bus.modules.dcs.frames import Info, Mode
from rds.bus.modules.dcs.host import Host
from rds.bus.modules.dcs.methods import LOOK, Feed, collect, segment_ends, send
from rds.bus.modules.motion_course import LATE, MotionCourse
from rds.bus.modules.segments import NodeSegment
from rds.core.errors import MachineError


def calls(host: Host, units: Sequence[int], steps: int) -> MotionCourse:
    """Method A: `steps` calls, one each 10 ms. MachineError for a unit that does not answer for 0.3 s, or resets."""
    port = host.port
    port.write(frames.encode(Info(Mode.SETUP), frames.setup_body(BYTE_TIME, 1)))
    port.sleep(port.now() + 4 * BYTE_TIME)
    port.read(0.0)
    begun = port.now() + BYTE_TIME
    course = MotionCourse(begun, begun + steps * BYTE_TIME, steps)
    silent, answers = dict.fromkeys(units, 0), AnswerStream()
    for k in range(steps):
        due = begun + k * BYTE_TIME
        port.sleep(due)
        course.late += port.now() - due > LATE
        port.write(frames.encode(Info(Mode.CALL, k), frames.words([0] * frames.SLOTS)))
        collect(host, answers, k, due + 0.9 * BYTE_TIME, silent, course)
    return course


def filled(
    host: Host, data: Mapping[int, bytes], steps: int, nodes: Mapping[int, Sequence[NodeSegment]] | None = None
) -> MotionCourse:
    """Methods B (with the segments of `nodes`) and C. MachineError for a unit that does not answer, or resets."""
    retries = host.counters.retries
    host.stop_all()
    feeds = [Feed(unit, each, None if nodes is None else segment_ends(nodes[unit])) for unit, each in data.items()]
    for feed in feeds:
        while send(host, feed):
            pass
    begun = host.port.now()
    course = MotionCourse(begun, begun + steps * BYTE_TIME, steps)
    try:
        while (look := host.port.now() + LOOK) < course.ended:
            for feed in feeds:
                if not host.inquire(feed.unit).status & frames.Status.FILLED:
                    raise MachineError(f"{host.title(feed.unit)} has been reset: its buffer is empty; start again")
            host.port.sleep(look)
    finally:
        host.stop_all()
    course.retries = host.counters.retries - retries
    return course
