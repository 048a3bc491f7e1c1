"""What a module does between frames in methods A, B and C: its buffer, its clock, and its position loop.

In each sample period, at an instant of its own clock, the module takes the next set point r' (that of the period's end)
from its buffer or from its difference equations, reads its encoder y, and applies

    u = Kp (r - y) + Ki Σ T (r - y) + Kv (r' - r)/T + F±

until the next one; T is the sample period, F± the friction of the set point's direction; the sum stands while u is more
than the amplifier can put out. Method A is the same, but each
set point comes in a frame, at whose instant the module takes it.

A spindle has no position to follow: its set point's speed alone makes its voltage, Kv (r' - r)/T.

What keeps voltage off the axis: a second without a word of the host, an axis 2048 counts from its set point, the
emergency stop; in method A also two and a half periods without a set point, until the next one. A buffer that runs
empty leaves the axis at its last set point.
"""

from __future__ import annotations

import logging
from collections import deque
from math import inf

from rds.bus.modules import segments
from rds.bus.modules.rds import motion_frames as codes
from rds.bus.modules.rds.motion_frames import Buffer, MotionStatus, Progress, Verb
from rds.bus.modules.segments import Equations
from rds.models.machine_axis import MachineAxis

LOG = logging.getLogger(__name__)

HOST = 1.0  # s without a word of the host, after which there is no voltage
FAR = 2048  # counts from the set point; method A's set points are told within that
SLEW = 0.5e-3  # s by which a correction of the clock moves a step at most
_OLDEST = 2.5  # periods without a set point in method A


class NodeMotion:
    """The motion of one axis; `drift` is how much too fast the module's clock goes (1e-6: 1 ppm).

    `turns` says that it is a spindle. `gauge`, if it is a list, gets the instant and the carriage's true position (of a
    spindle its speed) at each step.
    """

    def __init__(
        self, name: str, axis: MachineAxis, resolution: float, highest: float, drift: float = 0.0, turns: bool = False
    ):
        self.name, self.status = name, MotionStatus.NONE
        self.gauge: list[tuple[float, float]] | None = None
        self._axis, self._resolution, self._highest, self._rate = axis, resolution, highest, 1.0 + drift
        self._turns = turns
        self._gains = [0.0] * len(codes.Gain)
        self._kind = Buffer.NONE
        self._clear(0.0)

    def _clear(self, position: float) -> None:
        self._position, self._step, self._wanted, self._held = position, 0, 0, 0
        self._steps: deque[float] = deque()
        self._data = bytearray()  # of a segment that is not whole yet
        self._segments: deque[bytes] = deque()
        self._equations: Equations | None = None
        self._sum = 0.0  # counts s
        self._begun = self._due = inf
        self._until = inf  # without a word of the host
        self._correction = (0.0, 0.0)

    @property
    def active(self) -> bool:
        """Whether it puts voltage on the axis, or may at the next frame."""
        return bool(self.status & MotionStatus.READY)

    @property
    def moves(self) -> bool:
        """Whether it still has set points to follow."""
        if self._kind is Buffer.NONE:
            return self.active and self._due < inf
        return bool(self.status & MotionStatus.RUNNING and (self._steps or self._segments or self._equations))

    @property
    def expires(self) -> float:
        """The next instant at which something is due, bus time in s."""
        return min(self._due, self._until)

    def stop(self, at: float, why: MotionStatus = MotionStatus.NONE) -> None:
        """Zero volts, and nothing in the buffer."""
        if self.active:
            self._axis.cut(at)
        self._clear(self._position)
        self.status = why

    # --- frames

    def control(self, data: bytes | bytearray, at: float, period: float, emergency: bool) -> tuple[int, bytes] | None:
        """A control frame for this module: identifier (without node) and data of the answer. ValueError if garbled."""
        verb = Verb(data[0])
        self._hear(at)
        if verb is Verb.BEGIN:
            kind, position = codes.decode_begin(data)
            self.stop(at, MotionStatus.EMERGENCY if emergency else MotionStatus.READY)
            self._kind, self._period = kind, period
            self._clear(position)
            self._hear(at)
        elif verb is Verb.GAIN:
            which, self._gains[which] = codes.decode_gain(data)
        elif verb is Verb.GO:
            if self.active and self._begun == inf and self._kind is not Buffer.NONE:
                self.status |= MotionStatus.RUNNING
                self._begun = self._due = at
                self.expire(at)
        elif verb is Verb.STOP:
            self.stop(at)
        elif verb is Verb.CORRECT:
            self._correction = codes.decode_correction(data)
        elif verb is Verb.TIME:
            return codes.CLOCK, (round(self._elapsed(at) * 1e6) % (1 << 32)).to_bytes(4, "little")
        else:
            room = codes.BUFFER - self._held
            return codes.PROGRESS, codes.encode_progress(Progress(self._step, self._wanted, room, self.status))
        return None

    def data(self, number: int, piece: bytes | bytearray, at: float) -> None:
        """A piece of the buffer. One that is not the wanted one, or has no room, is not taken."""
        self._hear(at)
        if not self.active or number != self._wanted % 256 or self._held + len(piece) > codes.BUFFER:
            return
        self._wanted += 1
        self._held += len(piece)
        if self._kind is Buffer.INCREMENTS:
            self._steps.extend(codes.increments(piece))
            return
        self._data += piece
        while len(self._data) >= segments.SIZE:
            self._segments.append(bytes(self._data[: segments.SIZE]))
            del self._data[: segments.SIZE]

    def setpoint(self, data: bytes | bytearray, slot: int, at: float) -> None:
        """A set point of method A, for the end of the period that begins now."""
        if self.active and self._kind is Buffer.NONE:
            self._follow(codes.decode_setpoint(data, slot, self._position), at)
            self._due = at + _OLDEST * self._period
            self.status |= MotionStatus.RUNNING if self.active else MotionStatus.NONE
            self._hear(at)

    def _hear(self, at: float) -> None:
        if self.active:
            self._until = at + HOST

    # --- time

    def _elapsed(self, at: float) -> float:
        """s since the motion began, by the module's clock."""
        return 0.0 if self._begun == inf else max(0.0, at - self._begun) * self._rate

    def expire(self, now: float) -> None:
        """Make the steps that are due by `now`, each at its own instant, and stop if the host has fallen silent."""
        while self.expires <= now:
            if self._until < self._due:
                LOG.warning("module %s: no word of the host, zero volts", self.name)
                self.stop(self._until, MotionStatus.SILENT)
                return
            if self._kind is Buffer.NONE:
                self._axis.cut(self._due)
                self._due = inf
                self.status &= ~MotionStatus.RUNNING
            else:
                self._make_step(self._due)

    def _make_step(self, at: float) -> None:
        target = self._next()
        if target is None:  # hold the last set point
            self.status = self.status & ~MotionStatus.RUNNING | MotionStatus.EMPTY
        else:
            self._step += 1
        self._follow(self._position if target is None else target, at)
        if not self.active:
            return
        if target is None:
            self._due = at + self._period
            return
        rate, offset = self._correction
        shown = (self._step * self._period - offset) / (1.0 + rate)
        due = self._begun + shown / self._rate
        even = at + self._period / (self._rate * (1.0 + rate))
        self._due = min(max(due, even - SLEW, at + 0.1 * self._period), even + SLEW)

    def _next(self) -> float | None:
        """The next set point, counts; None if the buffer is empty."""
        if self.status & MotionStatus.EMPTY:
            return None
        if self._kind is Buffer.INCREMENTS:
            if not self._steps:
                return None
            self._held -= 2
            return self._position + self._steps.popleft()
        if self._equations is None:
            if not self._segments:
                return None
            self._equations = Equations(segments.unpack(self._segments.popleft()))
            self._held -= segments.SIZE
        target = self._equations.next()
        if self._equations.left <= 0:
            self._equations = None
        return target

    def _follow(self, target: float, at: float) -> None:
        """The law, from now to the next step."""
        true = self._axis.advance(at)
        if self.gauge is not None:
            self.gauge.append((at, true))
        error = 0 if self._turns else self._position - round(true / self._resolution)
        proportional, velocity, forward, backward, integral = self._gains
        speed = (target - self._position) / self._period
        friction = forward if speed > 0.0 else backward if speed < 0.0 else 0.0
        total = self._sum + error * self._period
        voltage = proportional * error + integral * total + velocity * speed + friction
        if not (abs(error) <= FAR and abs(voltage) < inf):  # nor what a gain or a set point makes that is no number
            LOG.warning("module %s: %g counts from its set point, zero volts", self.name, error)
            self.stop(at, MotionStatus.FAR)
            return
        if abs(voltage) <= self._highest:
            self._sum = total
        self._axis.command(max(-self._highest, min(self._highest, voltage)), at)
        self._position = target
