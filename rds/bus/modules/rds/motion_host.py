"""The host's side of methods A, B and C on CAN: begin, fill, go, look after, and keep the modules' clocks together.

A module's report says what its buffer has room for and which piece it wants, so whatever was lost is sent again. The
first module's clock is the one that all go by: a frame of the host is on the bus at one instant, common to all, at
which each tells its clock; a line through these (rds.network.clocks) gives rate and offset of each against the first
one's, and is sent back. The delay of messages cancels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rds.bus.modules.motion_course import LATE, MotionCourse
from rds.bus.modules.rds import frames, motion_frames
from rds.bus.modules.rds.motion_frames import PIECE, WRAP, Buffer, Gain, MotionStatus, Progress, Verb
from rds.bus.modules.rds.motion_port import Frame, MotionPort
from rds.core.errors import MachineError
from rds.network.clocks import ClockEstimate

LOOK = 0.1  # s between two looks at each module
_CLOCK = 0.25  # s between two questions for the clocks
_FIRST_CLOCKS = 0.05  # the same, as long as little is known
_ANSWER = 0.1  # s for a report
_TRIES = 5
_SILENT = 30  # periods without an answer of a module in method A, after which it is asked what it does
_MOST_LOST = 50  # pieces that are sent again in one look at a module
_TURNS = 1 << 32  # of a clock in µs


@dataclass
class _Feed:
    """What one module has still to get; `sent` pieces are thought to be there."""

    node: int
    pieces: Sequence[bytes]
    sent: int = 0
    step: int = 0
    shown: int = 0  # µs, of its clock
    clock: ClockEstimate = field(default_factory=ClockEstimate)


class MotionHost:
    """Modules by node; `titles` name them in messages ("X (module 2)")."""

    def __init__(self, port: MotionPort, titles: Mapping[int, str], name: str = "the bus"):
        self.port, self._titles, self._name = port, titles, name
        self.retries = 0

    def title(self, node: int) -> str:
        """What messages call a module."""
        return self._titles.get(node, f"module {node}")

    # --- asking

    def _control(self, verb: Verb, node: int = 0) -> None:
        self.port.send(motion_frames.CONTROL, bytes([verb, node]))

    def _ask(self, verb: Verb, nodes: Sequence[int], base: int) -> dict[int, bytes]:
        """The answers of modules to a question to one, or to all; of those that answer in time."""
        while self.port.receive(0.0) is not None:
            pass
        self._control(verb, nodes[0] if len(nodes) == 1 else 0)
        found: dict[int, bytes] = {}
        deadline = self.port.now() + _ANSWER
        while len(found) < len(nodes) and (left := deadline - self.port.now()) > 0.0:
            frame = self.port.receive(left)
            if frame is not None and frame.identifier - base in nodes:
                found[frame.identifier - base] = frame.data
        return found

    def progress(self, node: int) -> Progress:
        """How far a module is. MachineError if it does not answer."""
        for attempt in range(_TRIES):
            self.retries += bool(attempt)
            answers = self._ask(Verb.INQUIRE, [node], motion_frames.PROGRESS)
            if node in answers:
                return motion_frames.decode_progress(answers[node])
        raise MachineError(f"no answer from {self.title(node)} on {self._name}; check power and cable")

    def position(self, node: int) -> int:
        """What a module's encoder shows, counts. MachineError if it does not answer."""
        for attempt in range(_TRIES):
            self.retries += bool(attempt)
            self.port.send(frames.CALL, b"")
            deadline = self.port.now() + _ANSWER
            while (left := deadline - self.port.now()) > 0.0:
                frame = self.port.receive(left)
                if frame is not None and frame.identifier == frames.answer_identifier(node):
                    return frames.decode_answer(frame.identifier, frame.data).counts
        raise MachineError(f"no answer from {self.title(node)} on {self._name}; check power and cable")

    def begin(self, node: int, kind: Buffer, position: int, gains: Sequence[float]) -> None:
        """A module is to close its loop about `position` (sixteenths of a count). MachineError if it refuses."""
        for which, gain in zip(Gain, gains, strict=True):
            self.port.send(motion_frames.CONTROL, motion_frames.encode_gain(node, which, gain))
        self.port.send(motion_frames.CONTROL, motion_frames.encode_begin(node, kind, position))
        status = self.progress(node).status
        if status & MotionStatus.EMERGENCY:
            raise MachineError(
                f"{self.title(node)} has its emergency stop latched; press Release on the page, or rds estop --reset"
            )
        if not status & MotionStatus.READY or status & MotionStatus.RUNNING:
            raise MachineError(f"{self.title(node)} does not begin: another host commands it; end that run")

    def stop_all(self) -> None:
        """Zero volts on all axes, as far as they are reached."""
        self._control(Verb.STOP)

    # --- method A

    def set_points(self, rows: Sequence[Sequence[int]], slots: Mapping[int, int], period: float) -> MotionCourse:
        """A frame in each period with each module's set point, in sixteenths of a count; `slots` are places by node.

        MachineError for a module that does not answer for 30 periods, or that has let go of its axis.
        """
        port = self.port
        begun = port.now() + period
        course = MotionCourse(begun, begun + len(rows) * period, len(rows))
        silent = dict.fromkeys(slots, 0)
        for k, row in enumerate(rows):
            due = begun + k * period
            port.sleep(due)
            course.late += port.now() - due > LATE
            words = [0] * motion_frames.SLOTS
            for place, word in zip(slots.values(), row, strict=True):
                words[place] = word
            self._drain(None, 0.0)
            port.send(motion_frames.SETPOINTS, motion_frames.encode_setpoints(words))
            missing = self._drain(set(slots), max(0.0, due + 0.9 * period - port.now()))
            self._count(silent, missing, course)
        port.sleep(course.ended)
        return course

    def calls(self, nodes: Sequence[int], steps: int, period: float) -> MotionCourse:
        """A dry run of method A: a call in each period, and nothing moves."""
        port = self.port
        begun = port.now() + period
        course = MotionCourse(begun, begun + steps * period, steps)
        silent = dict.fromkeys(nodes, 0)
        for k in range(steps):
            due = begun + k * period
            port.sleep(due)
            course.late += port.now() - due > LATE
            self._drain(None, 0.0)
            port.send(frames.CALL, b"")
            self._count(silent, self._drain(set(nodes), max(0.0, due + 0.9 * period - port.now())), course, True)
        return course

    def _drain(self, awaited: set[int] | None, timeout: float) -> set[int]:
        """Take frames until all the awaited modules have answered, or the time is over; who has not."""
        left = set(awaited or ())
        deadline = self.port.now() + timeout
        while left or awaited is None:
            frame: Frame | None = self.port.receive(max(0.0, deadline - self.port.now()))
            if frame is None:
                break
            left.discard(frame.identifier - frames.ANSWER)
        return left

    def _count(self, silent: dict[int, int], missing: set[int], course: MotionCourse, dry: bool = False) -> None:
        course.missing += len(missing)
        for node in silent:
            silent[node] = silent[node] + 1 if node in missing else 0
            if silent[node] < _SILENT:
                continue
            silent[node] = 0
            try:
                status = self.progress(node).status
                if dry or status & MotionStatus.READY:  # a host that is late itself hears no answers
                    continue
                raise self._let_go(node, status)
            except MachineError:
                self.stop_all()
                raise

    # --- methods B and C

    def stream(
        self, pieces: Mapping[int, Sequence[bytes]], steps: int, period: float, synchronize: bool = True
    ) -> MotionCourse:
        """Fill the buffers of modules that have begun, go, and refill them until all `steps` are made.

        `synchronize`: the modules' clocks are kept together. MachineError for a module that restarts, does not answer,
        lets go of its axis, or whose buffer ran empty; all stand then, and where it is interrupted.
        """
        feeds = [_Feed(node, each) for node, each in pieces.items()]
        self.retries = 0
        try:
            for feed in feeds:
                self._fill(feed, self.progress(feed.node))
            self._control(Verb.GO)
            begun = self.port.now()
            course = MotionCourse(begun, begun + steps * period, steps)
            self._run(feeds, steps, begun if synchronize else None)
        except BaseException:
            self.stop_all()
            raise
        course.retries = self.retries
        return course

    def dry(self, pieces: Mapping[int, Sequence[bytes]], steps: int, period: float) -> MotionCourse:
        """Fill the buffers and never say go: the host's work for as long as the motion takes, and nothing moves."""
        feeds = [_Feed(node, each) for node, each in pieces.items()]
        self.retries = 0
        for feed in feeds:
            self._fill(feed, self.progress(feed.node))
        begun = self.port.now()
        course = MotionCourse(begun, begun + steps * period, steps)
        try:
            while (look := self.port.now() + LOOK) < course.ended:
                for feed in feeds:
                    status = self.progress(feed.node).status
                    if not status & MotionStatus.READY:
                        raise self._let_go(feed.node, status)
                self.port.sleep(look)
        finally:
            self.stop_all()
        course.retries = self.retries
        return course

    def _fill(self, feed: _Feed, report: Progress) -> None:
        """Send what there is room for, from the piece on that the module wants, until it has taken all of that."""
        for _ in range(_MOST_LOST):
            behind = (feed.sent - report.wanted) % WRAP
            self.retries += behind
            feed.sent -= behind
            room = min(report.free // PIECE, len(feed.pieces) - feed.sent)
            for number in range(feed.sent, feed.sent + room):
                self.port.send(motion_frames.DATA, bytes([feed.node, number % 256]) + feed.pieces[number])
            feed.sent += room
            if not room:
                return
            report = self.progress(feed.node)
            if report.wanted == feed.sent % WRAP:
                return

    def _run(self, feeds: Sequence[_Feed], steps: int, begun: float | None) -> None:
        clock = self.port.now() + _FIRST_CLOCKS
        look = self.port.now()
        while True:
            if begun is not None and self.port.now() >= clock:
                self._keep_clocks(feeds)
                clock = self.port.now() + (_FIRST_CLOCKS if feeds[0].clock.answers < 10 else _CLOCK)
            if self.port.now() >= look:
                look = self.port.now() + LOOK
                running = [self._look_after(feed, steps) for feed in feeds]
                if not any(running):
                    return
            self.port.sleep(min(look, clock if begun is not None else look))

    def _look_after(self, feed: _Feed, steps: int) -> bool:
        """Refill a module while it runs; whether it goes on."""
        report = self.progress(feed.node)
        further = (report.step - feed.step) % WRAP
        if further >= WRAP // 2 or not report.status & MotionStatus.READY:
            raise self._let_go(feed.node, report.status)
        feed.step += further
        if feed.step >= steps:
            return False
        if report.status & MotionStatus.EMPTY:
            raise MachineError(
                f"the buffer of {self.title(feed.node)} ran empty at step {feed.step} of {steps}: the host was too "
                "slow, or the bit rate is too low"
            )
        if not report.status & MotionStatus.RUNNING:
            raise MachineError(f"{self.title(feed.node)} did not begin with the others; start again")
        self._fill(feed, report)
        return True

    def _keep_clocks(self, feeds: Sequence[_Feed]) -> None:
        """Ask all clocks at one instant, and correct all but the first by what a line through them says."""
        told = self._ask(Verb.TIME, [feed.node for feed in feeds], motion_frames.CLOCK)
        if len(told) < len(feeds):
            return
        for feed in feeds:
            shown = int.from_bytes(told[feed.node], "little")
            feed.shown += (shown - feed.shown) % _TURNS
        master = feeds[0].shown * 1e-6
        for feed in feeds:
            feed.clock.take(master, feed.shown * 1e-6, master)
            if feed is not feeds[0] and feed.clock.answers > 2:
                rate = 1.0 / feed.clock.rate - 1.0
                now = feed.clock.at(master)
                data = motion_frames.encode_correction(feed.node, rate, 0.0)
                rate, _ = motion_frames.decode_correction(data)
                data = motion_frames.encode_correction(feed.node, rate, master - now * (1.0 + rate))
                self.port.send(motion_frames.CONTROL, data)

    def _let_go(self, node: int, status: MotionStatus) -> MachineError:
        who = self.title(node)
        if status & MotionStatus.EMERGENCY:
            return MachineError(
                f"emergency stop of {who}; press Release on the page, or rds estop --reset, and home the machine"
            )
        if status & MotionStatus.FAR:
            return MachineError(
                f"{who} could not follow its set points, and let go of the axis; feed less, or look why"
            )
        if status & MotionStatus.SILENT:
            return MachineError(f"{who} heard nothing of the host for a second, and let go of the axis")
        return MachineError(f"{who} has been reset in the middle of the motion; its position is lost: home it")
