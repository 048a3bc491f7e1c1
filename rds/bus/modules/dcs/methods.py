"""Methods A, B and C of dcs-thesis, section 3.7: three ways to bring the same motion to the units.

- A: a frame with each unit's increment in every period; the host keeps the time.
- B: the difference equations of each segment; the units interpolate, by their own clocks.
- C: increments ahead of time, into buffers. `cyclic`: the buffer is refilled while it runs. Else as in the thesis: 1500
  bytes, then a byte of the host for each step and an answer of the master, then a pause to fill again.

Each returns a `MotionCourse`: when the motion began and ended, by the port's clock, and what went wrong on the way.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING

from rds.bus.modules import segments
from rds.bus.modules.dcs import commands, frames
from rds.bus.modules.dcs.answers import AnswerStream
from rds.bus.modules.dcs.buffers import bytes_of, fillings
from rds.bus.modules.dcs.commands import BUFFER, BYTE_TIME, Report
from rds.bus.modules.dcs.frames import Info, Mode, Status
from rds.bus.modules.dcs.host import TRIES, Host, NoAnswer
from rds.bus.modules.motion_course import LATE, MotionCourse
from rds.bus.modules.segments import NodeSegment
from rds.core.errors import MachineError

if TYPE_CHECKING:
    import numpy as np

_PIECE = 200  # bytes of data at once; 8 segments of 24
_LEAST = 25  # bytes of data at once on a line with so much noise that no larger piece comes through
_PIECES_LOST = 3  # of the least size, one after the other, that may be lost, each with all tries
LOOK = 0.1  # s between two looks at each unit
_CLOCK = 1.0  # s between two corrections of the units' clocks
_WRAP = 1 << 16
_SILENT = 30  # periods without an answer of a unit, after which it is asked what it does


def method_a(host: Host, pulses: np.ndarray, slots: Mapping[int, int], period: float = BYTE_TIME) -> MotionCourse:
    """A frame in each `period`: `pulses` (m × n) in BLU, of the units in `slots` (unit: place in a frame), in order.

    MachineError for a unit that resets, or that does not answer for 0.3 s.
    """
    port = host.port
    port.write(frames.encode(Info(Mode.SETUP), frames.setup_body(period, 1)))
    port.sleep(port.now() + 4 * period)
    port.read(0.0)
    begun = port.now() + period
    course = MotionCourse(begun, begun, len(pulses))
    silent = dict.fromkeys(slots, 0)
    answers = AnswerStream()
    places = list(slots.values())
    for k, row in enumerate(pulses):
        due = begun + k * period
        port.sleep(due)
        course.late += port.now() - due > LATE
        values = [0] * frames.SLOTS
        for place, count in zip(places, row, strict=True):
            values[place] = int(count)
        port.write(frames.encode(Info(Mode.INCREMENTS, k), frames.words(values)))
        collect(host, answers, k, due + 0.9 * period, silent, course)
    course.ended = begun + len(pulses) * period
    port.sleep(course.ended + period)
    return course


def collect(
    host: Host, answers: AnswerStream, number: int, deadline: float, silent: dict[int, int], course: MotionCourse
) -> None:
    """The answers of a frame, as far as they come."""
    awaited = set(silent)
    while awaited:
        answers.add(host.port.read(max(0.0, deadline - host.port.now())))
        while (answer := answers.next()) is not None:
            if answer.status & Status.NOT_SET_UP and answer.unit in silent:  # or noise that looks like it
                answers.clear()
                if host.inquire(answer.unit).status & Status.NOT_SET_UP:
                    raise _reset(host, answer.unit)
                continue
            if answer.number == number % frames.NUMBERS:
                awaited.discard(answer.unit)
                if answer.unit in silent:
                    silent[answer.unit] = 0
        if host.port.now() >= deadline:
            break
    course.missing += len(awaited)
    for unit in awaited:
        silent[unit] += 1
        if silent[unit] >= _SILENT:  # the unit's doing, or that of a host which is late itself
            answers.clear()
            if host.inquire(unit).status & Status.NOT_SET_UP:
                raise _reset(host, unit)
            silent[unit] = 0


def method_b(host: Host, nodes: Mapping[int, Sequence[NodeSegment]], *, synchronize: bool = True) -> MotionCourse:
    """The segments of each unit, which all take the same steps. Errors as `cyclic`."""
    steps = {sum(each.steps for each in found) for found in nodes.values()}
    assert len(steps) == 1
    ends = {unit: segment_ends(found) for unit, found in nodes.items()}
    return cyclic(host, segment_bytes(nodes), steps.pop(), ends, synchronize=synchronize)


def segment_bytes(nodes: Mapping[int, Sequence[NodeSegment]]) -> dict[int, bytes]:
    """What travels of the segments of each unit."""
    return {unit: b"".join(each.pack() for each in found) for unit, found in nodes.items()}


def segment_ends(nodes: Sequence[NodeSegment]) -> list[int]:
    """After how many steps each segment is over."""
    return list(accumulate(each.steps for each in nodes))


def method_c(
    host: Host, pulses: np.ndarray, units: Sequence[int], *, as_thesis: bool = False, synchronize: bool = True
) -> MotionCourse:
    """Buffers of `pulses` (m × n) in BLU; the first of `units` is the master. Errors as `cyclic`."""
    data = {unit: bytes_of(pulses[:, i]) for i, unit in enumerate(units)}
    return stepwise(host, data) if as_thesis else cyclic(host, data, len(pulses), synchronize=synchronize)


def stepwise(host: Host, data: Mapping[int, bytes]) -> MotionCourse:
    """As the thesis's Execute: fill, step through, fill again. The motion rests meanwhile."""
    master, port = next(iter(data)), host.port
    course = MotionCourse(0.0, 0.0, len(data[master]))
    rounds = list(zip(*(fillings(each) for each in data.values()), strict=True))
    retries = host.counters.retries
    for number, parts in enumerate(rounds):
        since = port.now()
        for unit, part in zip(data, parts, strict=True):
            host.fill(unit, part, unit == master)
        if number:
            course.pauses += port.now() - since
        else:
            course.begun = port.now()
        host.step_through(master, lambda step: course.instants.append(port.now()))
    course.ended = port.now()
    course.missing, course.retries = host.counters.lost, host.counters.retries - retries
    return course


class Feed:
    """What is still to be sent to a unit; `ends` are the steps after which each segment of method B is over."""

    def __init__(self, unit: int, data: bytes, ends: Sequence[int] | None):
        self.unit, self.data, self.sent, self._ends = unit, data, 0, ends
        self.step = 0
        self.command = commands.DATA if ends is None else commands.SEGMENT
        self._most, self._lost = _PIECE, 0
        self.doubtful: set[int] = set()  # bytes of pieces that may have been taken, though no answer said so

    def next_piece(self) -> bytes:
        """What is sent next; nothing where all is sent, or where the unit's buffer has no room for it."""
        most = self._most if self._ends is None else self._most // segments.SIZE * segments.SIZE
        piece = self.data[self.sent : self.sent + most]
        carried_out = self.step if self._ends is None else bisect_right(self._ends, self.step) * segments.SIZE
        return piece if self.sent + len(piece) - carried_out <= BUFFER else b""

    def lose(self, size: int) -> bool:
        """A piece of this size had no answer: the next ones are smaller; whether it is worth while to send one."""
        self.doubtful.add(size)
        self._lost = self._lost + 1 if self._most == _LEAST else 0
        self._most = max(self._most // 2, _LEAST)
        return self._lost < _PIECES_LOST

    def answered(self) -> None:
        """The unit has said what it took."""
        self.doubtful, self._lost = set(), 0

    def take(self, report: Report) -> bool:
        """Note how far the unit is; whether that can be, for none goes back."""
        further = (report.step - self.step) % _WRAP
        if further >= _WRAP // 2:
            return False
        self.step += further
        return True


def cyclic(
    host: Host,
    data: Mapping[int, bytes],
    steps: int,
    ends: Mapping[int, Sequence[int]] | None = None,
    *,
    synchronize: bool = True,
) -> MotionCourse:
    """Fill the units' cyclic buffers, go, and refill them until all `steps` are made.

    `data` are position bytes, or segments where `ends` says after which step each of them is over. Without
    `synchronize` each unit goes by its own clock. MachineError for a unit that resets, does not answer, or whose buffer
    ran empty because the host was too slow; all units stand then, and where it is interrupted.
    """
    feeds = [Feed(unit, each, None if ends is None else ends[unit]) for unit, each in data.items()]
    retries = host.counters.retries
    host.stop_all()
    try:
        for feed in feeds:
            while send(host, feed):
                pass
        begun = _go(host, feeds)
        course = MotionCourse(begun, begun + steps * BYTE_TIME, steps)
        clock = begun + _CLOCK
        while True:
            look = host.port.now() + LOOK
            running = [_look_after(host, feed, steps) for feed in feeds]
            if not any(running):
                break
            if synchronize and host.port.now() >= clock:
                host.clock(begun)
                clock += _CLOCK
            host.port.sleep(look)
    except BaseException:
        host.stop_all()
        raise
    course.retries = host.counters.retries - retries
    return course


def _go(host: Host, feeds: Sequence[Feed]) -> float:
    """Say go until it is heard; the instant at which the units begin. MachineError where some have not begun."""
    for _ in range(TRIES):
        begun = host.go()
        waiting = [feed.unit for feed in feeds if _waits(host.inquire(feed.unit))]
        if not waiting:
            return begun
        if len(waiting) < len(feeds):
            break
        host.counters.retries += 1
    raise MachineError(f"{', '.join(map(host.title, waiting))} did not begin; {host.help}")


def _waits(report: Report) -> bool:
    return bool(report.status & Status.FILLED) and not report.status & Status.EXECUTING and report.step == 0


def send(host: Host, feed: Feed) -> bool:
    """One more piece; whether it was taken, and there is more."""
    part = feed.next_piece()
    if not part:
        return False
    try:
        report = host.data(feed.unit, feed.command, feed.sent, part)
    except NoAnswer:
        host.inquire(feed.unit)  # it is the line, not the unit: of smaller pieces fewer are damaged
        if not feed.lose(len(part)):
            raise
        return True
    taken = (report.step - feed.sent) % _WRAP
    if taken not in {0, len(part), *feed.doubtful}:
        raise _reset(host, feed.unit)
    feed.sent += taken
    feed.answered()
    return taken > 0 and feed.sent < len(feed.data)


def _look_after(host: Host, feed: Feed, steps: int) -> bool:
    """Refill a unit while it runs; whether it goes on."""
    report = host.inquire(feed.unit)
    if not feed.take(report):
        raise _reset(host, feed.unit)
    if feed.step >= steps:
        return False
    if not report.status & Status.EXECUTING:
        if report.status & Status.EMPTY:
            raise MachineError(
                f"the buffer of {host.title(feed.unit)} ran empty at step {feed.step} of {steps}: the host was too "
                "slow, or the baud rate is too low"
            )
        raise _reset(host, feed.unit)
    while send(host, feed):
        pass
    return True


def _reset(host: Host, unit: int) -> MachineError:
    return MachineError(
        f"{host.title(unit)} has been reset in the middle of the motion; its position is lost: home it, and start again"
    )
