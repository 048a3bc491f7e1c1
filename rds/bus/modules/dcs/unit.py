"""A unit on the serial line: the firmware of dcs-thesis, appendices B and C, as it behaves, with its gaps closed.

It takes bytes, each with the instant at which it is whole, and gives what it sends, with the instant at which it
begins. It knows no port. Where it differs from the firmware, and why:

- A unit that hears another one selected skips the 1500 bytes that follow. The firmware reads them as commands, and a
  position byte "h" before one of 122 drives unit 2 home.
- Silence ends whatever is half received. The firmware waits in getc() for ever, deaf to everything.
- After something damaged it hears nothing until there is silence, for what follows may be data that look like commands.
- A jog ends with the next byte, as in the firmware, except an inquiry; and after half a second without any byte.
- The steps of a buffer end with "s", and after a second without a byte.
- The cyclic buffer, segments, inquiries and the clock are new (commands.py), as is all of the cyclic protocol.
"""

from __future__ import annotations

from binascii import crc_hqx
from math import inf

from rds.bus.modules.dcs import commands, frames
from rds.bus.modules.dcs.commands import BUFFER, BYTE_TIME, HOST, TURN_ROUND, Report, steps_of
from rds.bus.modules.dcs.frames import Mode, Status
from rds.bus.modules.dcs.motors import Motor
from rds.bus.modules.dcs.program import Program

GAP = 2e-3  # s of silence after which half a frame is none, on a line whose instants are exact
SKIP = 0.05  # s of silence after which the data for another unit are over
JOG_TIME = 0.5  # s without a byte until a jog ends
STEP_PATIENCE = 1.0  # s without a byte until the steps of a buffer end
FILLING = 10.0  # s for which a spindle goes on after a buffer's last step, while buffers are filled again
OLDEST = 2.5  # periods for which a voltage acts, as of the modules on CAN
HOME_STEPS = 8  # BLU in 10 ms, backward: chosen. The firmware's 80 are 4.8 m/min, four times what the machine can do
Sent = list[tuple[float, bytes]]
_TWO = frozenset((commands.JOG, commands.STOP, commands.HOME, commands.RESET, commands.INQUIRY, commands.GO))


class Unit:
    """Unit number `number` (1 to 15), whose commands have place `slot` in a frame.

    `motor` is the axis behind it, `blu` its step in axis units, `start` (axis units) where the carriage is when the
    unit is switched on, and `switch` where its limit switch is. `drift` is how much faster its clock goes than true
    time, as a share. `byte_time` is that of its baud rate, s.
    """

    def __init__(
        self,
        name: str,
        number: int,
        slot: int,
        motor: Motor,
        *,
        blu: float,
        byte_time: float,
        start: float = 0.0,
        switch: float = -inf,
        drift: float = 0.0,
        gap: float = GAP,
    ):
        self.name, self.number, self.slot, self.motor, self.blu = name, number, slot, motor, blu
        self.uid = commands.uid(number)
        self.byte_time, self.start, self.switch, self.drift = byte_time, start, switch, drift
        self._gap = max(gap, 3.0 * byte_time)
        self.heard = 0  # frames and commands that it understood
        self._reset(0.0)

    def _reset(self, at: float) -> None:
        self._offset = round(self.start / self.blu) - self.motor.counts(at)
        self._partial = bytearray()
        self._last = -inf  # when the last byte came
        self._filling: bytearray | None = None
        self._skip = 0
        self._buffer = b""
        self._jog = 0  # position byte; 0: no jog
        self._jog_ready = self._homing = False
        self._index: int | None = None  # of the next step of a buffer carried out byte by byte
        self._asked = 0  # steps that wait
        self._stepped = False  # a step is being carried out
        self._deaf = False  # until there is silence, after something that was damaged
        self._master = self._is_set_up = self._watchdog = self._limit = False
        self._period = BYTE_TIME
        self._tick = inf  # when the next 10 ms of jog, home or steps begin
        self._cuts = inf
        self.program = Program(self._time(BYTE_TIME))

    def power_cycle(self, at: float) -> None:
        """It is switched off and on again, or its processor has reset: it stands, and knows nothing any more."""
        self.motor.stop(at)
        self._reset(at)

    def _time(self, seconds: float) -> float:
        """True time in which its clock counts so many s."""
        return seconds / (1.0 + self.drift)

    def counts(self, at: float) -> int:
        """The position as it knows it, BLU."""
        return self.motor.counts(at) + self._offset

    def position(self, at: float) -> float:
        """Where the carriage really is, axis units."""
        return self.motor.advance(at) + self.start

    @property
    def status(self) -> Status:
        """What it says of itself."""
        busy = self._jog or self._homing or self._index is not None or self.program.runs
        found = Status.MOVING if busy or self.motor.moving else Status.NONE
        for flag, on in (
            (Status.MASTER, self._master),
            (Status.FILLED, bool(self._buffer) or self.program.filled),
            (Status.EXECUTING, self._index is not None or self.program.runs),
            (Status.NOT_SET_UP, not self._is_set_up),
            (Status.LIMIT, self._limit),
            (Status.EMPTY, self.program.ran_empty),
            (Status.WATCHDOG, self._watchdog),
        ):
            if on:
                found |= flag
        return found

    # --- time

    @property
    def due(self) -> float:
        """The next instant at which it does something by itself."""
        return min(self._tick, self._cuts, self.program.due)

    def expire(self, at: float) -> Sent:
        """Do what is due by the instant `at`; what it sends."""
        sent: Sent = []
        if at >= self._cuts:
            self.motor.stop(self._cuts)
            self._cuts, self._watchdog = inf, True
        if at >= self._tick:
            sent += self._go_on(self._tick)
        if at >= self.program.due:
            instant = self.program.due
            target = self.program.step()
            if target is not None:
                self.motor.steps(target, instant, self._time(BYTE_TIME))
            elif self.motor.turns:
                self.motor.stop(instant)
        return sent

    def _go_on(self, at: float) -> Sent:
        """The 10 ms that a position byte takes are over, or begin."""
        step = self._time(BYTE_TIME)
        self._tick = inf
        if self._jog:
            if at - self._last > JOG_TIME:
                self._jog = 0
            else:
                self.motor.steps(steps_of(self._jog), at, step)
                self._tick = at + step
            return []
        if self._homing:
            if self.position(at) <= self.switch:
                self._homing, self._limit = False, True
                self.motor.stop(at)
                self._offset = round(self.switch / self.blu) - self.motor.counts(at)
                return [(at, bytes([self.uid]))]
            self.motor.steps(-HOME_STEPS, at, step)
            self._tick = at + step
            return []
        if self._index is None:
            return []
        sent: Sent = [(at, bytes([self.uid]))] if self._master and self._stepped else []
        self._stepped = False
        if self._index >= BUFFER or at - self._last > STEP_PATIENCE:
            if self.motor.turns:
                self._cuts = at + FILLING
            self._index, self._buffer = None, b""
        elif self._asked:
            self._begin_step(at)
        else:
            self._tick = at + STEP_PATIENCE + step  # to end, if nobody asks any more
        return sent

    def _begin_step(self, at: float) -> None:
        assert self._index is not None
        self._asked -= 1
        self._cuts = inf
        self.motor.steps(steps_of(self._buffer[self._index]), at, self._time(BYTE_TIME))
        self._index += 1
        self._stepped = True
        self._tick = at + self._time(BYTE_TIME)

    # --- bytes

    def receive(self, byte: int, at: float) -> Sent:
        """A byte is whole at the instant `at`; what the unit sends."""
        silence, self._last = at - self._last, at
        if self._filling is not None:
            if silence > SKIP:
                self._filling = None
            else:
                return self._fill(byte, at)
        if self._skip:
            self._skip = self._skip - 1 if silence <= SKIP else 0
            if silence <= SKIP:
                return []
        if self._index is not None:
            return self._step_byte(byte, at)
        if silence > self._gap:
            self._partial.clear()
            self._deaf = False
        if self._deaf:
            return []
        self._partial.append(byte)
        size = self._size()
        if size and len(self._partial) < size:
            return []
        taken = self._take(bytes(self._partial), at) if size else None
        self._partial.clear()
        if taken is None:  # and what follows of it is data, not commands
            self._deaf = True
            return []
        return taken

    def _size(self) -> int:
        """Bytes of what begins with the first byte received; 0: nothing does."""
        first = self._partial[0]
        info = frames.decode_info(first)
        if info is not None:
            return info.size
        if first in (commands.DATA, commands.SEGMENT):
            return commands.data_size(self._partial[4]) if len(self._partial) > 4 else 6
        return 2 if HOST <= first <= HOST + 15 or first in _TWO or first == commands.CLOCK else 0

    def _take(self, whole: bytes, at: float) -> Sent | None:
        """What is complete; None if it is damaged."""
        first, second = whole[0], whole[1]
        if frames.decode_info(first) is not None:
            found = frames.decode(whole)
            if found is None:
                return None
            self.heard += 1
            return self._frame(*found, at)
        if first in (commands.DATA, commands.SEGMENT):
            if not commands.is_whole(whole):
                return None
            return self._data(first, second, whole, at)
        if self._jog and first != commands.INQUIRY:
            self._end_jog(at)
        if self._jog_ready:
            self._jog_ready = False
            if first == self.uid:
                self._jog, self._tick = second, at
                return []
        self.heard += 1
        return self._command(first, second, at)

    def _command(self, first: int, second: int, at: float) -> Sent:
        mine = second == self.uid
        if first == HOST:
            if self._buffer:
                self._index, self._asked, self._stepped = 0, 0, False
                self._tick = at + STEP_PATIENCE
        elif first == self.uid:
            self._master = mine
            self._filling = bytearray()
            return self._say_uid(at)
        elif HOST < first <= HOST + 15:
            self._skip = BUFFER
        elif first == commands.JOG and mine:
            self._jog_ready = True
            return self._say_uid(at)
        elif first == commands.STOP and (mine or second == commands.STOP):
            self._halt(at)
        elif first == commands.HOME and mine:
            self._halt(at)
            self._homing, self._tick = True, at
        elif first == commands.RESET and second == commands.RESET:
            self.power_cycle(at)
        elif first == commands.INQUIRY and mine:
            return [(at + TURN_ROUND, self.report(at))]
        elif first == commands.GO and second == HOST:
            self.program.start(at)
        elif first == commands.CLOCK:
            self.program.correct(second, at)
        return []

    def report(self, at: float, index: int | None = None) -> bytes:
        """What it answers to an inquiry."""
        step = self.program.index if index is None else index
        if index is None and self._buffer:
            step = crc_hqx(self._buffer, 0)  # for a host that wants to be sure of what it filled
        counts = self.counts(at)  # first: the motor moves on to this instant
        return commands.encode_report(Report(self.number, self.status, counts, step))

    def _say_uid(self, at: float) -> Sent:
        return [(at + TURN_ROUND, bytes([self.uid]))]

    def _end_jog(self, at: float) -> None:
        self._jog, self._tick = 0, inf
        self.motor.stop(at)

    def _halt(self, at: float) -> None:
        self._jog, self._homing, self._index, self._tick, self._buffer = 0, False, None, inf, b""
        self._cuts = inf
        self.program = Program(self._time(BYTE_TIME))
        self.motor.stop(at)

    def _fill(self, byte: int, at: float) -> Sent:
        assert self._filling is not None
        self._filling.append(byte)
        if len(self._filling) < BUFFER:
            return []
        self._buffer, self._filling = bytes(self._filling), None
        return self._say_uid(at)

    def _step_byte(self, byte: int, at: float) -> Sent:
        if byte == commands.STOP:
            self._halt(at)
            return []
        self._asked += 1
        if not self._stepped:
            self._begin_step(at)
        return []

    def _data(self, command: int, uid: int, whole: bytes, at: float) -> Sent:
        if uid != self.uid:
            return []
        self.heard += 1
        if not self.program.runs and not self.program.filled:
            self.program.begin(self.counts(at))
        index, count = commands.DATA_HEAD.unpack_from(whole, 2)
        data = whole[2 + commands.DATA_HEAD.size :][:count]
        wanted = self.program.take(command == commands.SEGMENT, index, data)
        return [(at + TURN_ROUND, self.report(at, wanted))]

    # --- the cyclic protocol

    def _frame(self, info: frames.Info, body: bytes, at: float) -> Sent:
        counts, status = self.counts(at), self.status
        self._watchdog = False
        if info.mode is Mode.SETUP:
            self._period = frames.decode_setup(body)[0] or BYTE_TIME
            self._halt(at)
            self._is_set_up = True
        elif info.mode is Mode.CALL or not self._is_set_up:
            if self._cuts < inf:
                self.motor.stop(at)
            self._cuts = inf
        elif info.mode is Mode.VOLTAGES:
            self.motor.voltage(frames.decode_words(body)[self.slot] * frames.VOLTS_PER_UNIT, at)
            self._cuts = at + OLDEST * self._time(self._period)
        else:
            self.motor.steps(frames.decode_words(body)[self.slot], at, self._time(self._period))
            if self.motor.turns:
                self._cuts = at + OLDEST * self._time(self._period)
        if not info.answers:
            return []
        answer = frames.encode_answer(frames.Answer(self.number, info.number, status, counts))
        place = TURN_ROUND + self.slot * (frames.ANSWER_SIZE * self.byte_time + TURN_ROUND)
        return [(at + place, answer)]
