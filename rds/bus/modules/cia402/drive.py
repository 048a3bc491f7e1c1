"""A simulated CiA 402 drive: a CANopen node with an axis behind it. It knows frames and bus time, no bus.

Every verb takes an instant of bus time in s and returns the frames to send, as (identifier, data). However late the
drive learns of a frame, its axis, its deadlines and its faults keep the instants of the frames' time stamps.

Our own, because canopen's `LocalNode` answers SDO, but has no states of CiA 402 and sends no process data on
SYNC.
"""

from __future__ import annotations

import secrets
from math import inf
from pathlib import Path
from typing import Any

from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import NODES, Abort, Nmt, NmtCommand, State
from rds.bus.modules.cia402.dictionary import Dictionary, Key
from rds.bus.modules.cia402.errors import Errors
from rds.bus.modules.cia402.heartbeat import Heartbeats
from rds.bus.modules.cia402.operation import Operation
from rds.bus.modules.cia402.pdo import COUNT, Rpdo, Tpdo
from rds.bus.modules.cia402.quirks import Quirk
from rds.bus.modules.cia402.sdo import Server
from rds.bus.modules.cia402.servo import Servo
from rds.bus.modules.cia402.state_machine import Command, command
from rds.bus.modules.rds.module import machine_parameters
from rds.core.errors import InputError
from rds.machines.machine import Axis

Frame = tuple[int, bytes]
NMT, HEARTBEAT = 0x000, 0x700
SAVE, LOAD = 0x65766173, 0x64616F6C  # "save" and "load": what 0x1010 and 0x1011 take
_ON_COMMAND = 1  # 0x1010 and 0x1011: it does so on command
_CLOSE = 0.75  # periods: of any two hosts with one period, one comes closer than that after the other
_NONE_LOST = 1.5  # periods between two SYNCs: in less, none can have been lost
_LATE = 3  # SYNCs after one without a command in which that command may still come
_MOVING = 2e-3  # s between two looks at an axis under power if no frame comes


class Drive:
    """The drive of `axis`; `node` is its node-ID (default: the axis's), `volts` its full voltage at 1000 ‰ torque,
    `quirks` are things that are wrong with it. With another drive's `eds` it has the objects and identity of that.
    """

    def __init__(
        self,
        axis: Axis,
        start: float,
        volts: float = 10.0,
        node: int | None = None,
        quirks: frozenset[Quirk] = frozenset(),
        eds: Path | None = None,
    ):
        self.quirks = quirks
        self.name = axis.name
        self.node = axis.node if node is None else node
        if self.node not in NODES:
            raise InputError(f"axis {axis.name}: CANopen node {self.node!r} must be from 1 to 127")
        self.nmt = Nmt.BOOT_UP
        self.syncs = 0
        self.serial = secrets.randbelow(1 << 31) + 1
        self._out: list[Frame] = []
        self.objects = Dictionary(self.node, eds)
        self.servo = Servo(axis, machine_parameters(axis), start, volts, self._axis_fault)
        self.errors = Errors(self.objects, self._send)
        self.operation = Operation(self.objects, self.servo, self.errors.report, self.errors.clear)
        self.heartbeats = Heartbeats(self.objects, lambda: self.operation.now)
        self.operation.is_host_missing = lambda: self.heartbeats.is_one_missing
        self.receive_pdos = [Rpdo(number, self.objects) for number in range(COUNT)]
        self.transmit_pdos = [Tpdo(number, self.objects) for number in range(COUNT)]
        self._server = Server(self.node, self.objects, self._send)
        self.objects.writers[0x1005, 0] = self._check_sync_identifier
        self.objects.writers[0x1014, 0] = self._check_emergency_identifier
        self.objects.writers[0x1019, 0] = self._check_sync_counter
        self.objects.writers[0x1010, 1] = self._store
        self.objects.writers[0x1011, 1] = self._restore
        self.objects.readers |= dict.fromkeys([(0x1010, 1), (0x1011, 1)], lambda: _ON_COMMAND)
        if Quirk.FIXED_MAPPING in quirks:
            for key in self.objects.variables:
                if 0x1600 <= key[0] < 0x1604 or 0x1A00 <= key[0] < 0x1A04:
                    self.objects.writers[key] = _refuse_mapping
        self.servo.polarity = -1 if Quirk.WRONG_SIGN in quirks else 1
        self.servo.brake_is_closed = Quirk.CLOSED_BRAKE in quirks
        self.objects.readers[0x1018, 4] = lambda: self.serial
        self._bad_length = False
        self._synced_at = -inf  # s: the last SYNC
        self._contradicted = False  # two commands have come since then
        # what the objects say, looked up once for a thousand frames a second
        self._sync_identifier = 0x80
        self._taken: dict[int, list[Rpdo]] = {}
        self._by_sync: list[Tpdo] = []
        self._by_events: list[Tpdo] = []
        self._timed: list[Rpdo] = []
        self._reset_values(0x0000, 0xFFFF)

    @property
    def state(self) -> State:
        """The state of the power drive system."""
        return self.operation.machine.state

    @property
    def listens_to(self) -> frozenset[int]:
        """The identifiers that mean something to this drive now."""
        others = {HEARTBEAT + node for node in self.heartbeats.watched}
        return frozenset({NMT, self._sync_identifier, 0x600 + self.node, *self._taken} | others)

    @property
    def expires(self) -> float | None:
        """The instant until which the drive may sleep if no frame comes, s; None: as long as it likes."""
        moving = self.servo.motion is not None or self.servo.torque is not None
        instant = min(
            self.operation.deadline(),
            self.heartbeats.deadline(),
            self._event_deadline(),
            self.operation.now + _MOVING if moving else inf,
        )
        return None if instant == inf else instant

    def boot(self, at: float) -> list[Frame]:
        """Switched on: the boot-up message, then PRE-OPERATIONAL."""
        self._advance(at)
        self._boot()
        return self._flush()

    def receive(self, identifier: int, data: bytes | bytearray, at: float, remote: bool = False) -> list[Frame]:
        """Take a frame stamped `at`. What makes no sense to this drive changes nothing."""
        self._advance(at)
        if remote:
            return self._flush()  # neither node guarding nor PDO requests: both say so in the EDS
        if identifier in self._taken:
            self._take_pdo(self._taken[identifier], bytes(data))
        elif identifier == self._sync_identifier:
            self._sync(data)
        elif identifier == NMT:
            if len(data) == 2 and data[1] in (0, self.node):
                self._command(data[0])
        elif identifier == 0x600 + self.node:
            if self.nmt in (Nmt.PRE_OPERATIONAL, Nmt.OPERATIONAL):
                self._server.on_request(identifier, bytes(data), at)
                self._look_up()
        elif identifier > HEARTBEAT and identifier - HEARTBEAT in self.heartbeats.watched:
            self._hear(identifier - HEARTBEAT)
        self._send_events()
        return self._flush()

    def expire(self, now: float) -> list[Frame]:
        """Time has gone on to `now` without a frame."""
        self._advance(now)
        self._send_events()
        return self._flush()

    def fault(self, code: int, at: float) -> list[Frame]:
        """Inject a fault by its error code, such as 0x2310 (continuous over-current)."""
        self._advance(at)
        self.operation.fault(code)
        self._send_events()
        return self._flush()

    def set_emergency_input(self, active: bool, at: float) -> list[Frame]:
        """The drive's emergency stop button: pressed, the drive is in fault (0xFF03) and stays there until released.

        It tells by its emergency message, on which the host stops the other drives.
        """
        self._advance(at)
        was, self.operation.interlock = self.operation.interlock, active
        if active and not was:
            self.operation.fault(codes.EMERGENCY_STOP)
        self._send_events()
        return self._flush()

    # --- time

    def _advance(self, until: float) -> None:
        """Move on to `until`, through all deadlines on the way."""
        operation, heartbeats = self.operation, self.heartbeats
        while True:
            decision, beat, timeout = operation.deadline(), heartbeats.deadline(), self._rpdo_deadline()
            if decision > until and beat > until and timeout > until:
                break
            instant = min(decision, beat, timeout)
            operation.advance(instant)
            if timeout <= instant:
                self._rpdo_timeout(instant)
            elif operation.deadline() <= instant:
                operation.expire()
            elif beat <= instant:
                self._heartbeat()
        operation.advance(until)

    def _heartbeat(self) -> None:
        if self.heartbeats.due():
            self._send(HEARTBEAT + self.node, bytes([self.nmt]))
        if self.heartbeats.lost():
            behaviour = self.objects.values[0x1029, 1]
            self.operation.abort_connection(codes.HEARTBEAT_LOST)
            if behaviour == 2 or (behaviour == 0 and self.nmt is Nmt.OPERATIONAL):
                self._enter(Nmt.STOPPED if behaviour == 2 else Nmt.PRE_OPERATIONAL)

    def _hear(self, node: int) -> None:
        if self.heartbeats.heard(node) and self.state is not State.FAULT:
            self.errors.clear()

    def _axis_fault(self, code: int, at: float) -> None:
        self.operation.fault(code, at)

    # --- NMT

    def _boot(self) -> None:
        self._send(HEARTBEAT + self.node, b"\0")
        self.operation.wake()
        self._enter(Nmt.PRE_OPERATIONAL)
        self.heartbeats.restart()

    def _command(self, code: int) -> None:
        if code in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self._enter(Nmt.BOOT_UP)
            highest = 0x1FFF if code == NmtCommand.RESET_COMMUNICATION else 0xFFFF
            self.operation.control(codes.DISABLE_VOLTAGE)
            self._reset_values(0x1000, highest)
            self._boot()
        elif code == NmtCommand.START:
            self._enter(Nmt.OPERATIONAL)
        elif code == NmtCommand.ENTER_PRE_OPERATIONAL:
            self._enter(Nmt.PRE_OPERATIONAL)
        elif code == NmtCommand.STOP:
            if self.nmt is not Nmt.STOPPED and self.objects[0x6007] and self.state is State.OPERATION_ENABLED:
                self.operation.abort_connection(codes.HEARTBEAT_LOST)
            self._enter(Nmt.STOPPED)

    def _enter(self, nmt: Nmt) -> None:
        if nmt is not self.nmt:
            self.nmt = nmt
            self.operation.remote = nmt is Nmt.OPERATIONAL
            for pdo in (*self.receive_pdos, *self.transmit_pdos):
                pdo.restart()
            for pdo in self.transmit_pdos:
                pdo.sent_at = self.operation.now

    def _reset_values(self, lowest: int, highest: int) -> None:
        self.objects.reset(lowest, highest)
        if highest > 0x6000:
            values = self.objects.values
            turn = round(self.servo.counts_per_unit * (60.0 if self.servo.rotates else 1.0))
            values[0x608F, 1] = values[0x6092, 1] = turn  # a linear axis has a screw of 1 mm
            if Quirk.WRONG_GEAR in self.quirks:
                values[0x6091, 1] = 10
            if Quirk.ZERO_LIMITS in self.quirks:
                limits = [(0x6072, 0), (0x607D, 1), (0x607D, 2)]
                values |= dict.fromkeys([key for key in limits if key in self.objects.variables], 0)
            self.operation.power_off()
        for pdo in (*self.receive_pdos, *self.transmit_pdos):
            pdo.reset()
        self.errors.restore()
        self._look_up()

    def _look_up(self) -> None:
        self.operation.look_up()
        self._sync_identifier = self.objects[0x1005] & 0x7FF
        self._taken = {}
        for taken in self.receive_pdos:
            if taken.exists:
                self._taken.setdefault(taken.identifier, []).append(taken)
        self._timed = [pdo for pdo in self.receive_pdos if pdo.exists and pdo.event_time]
        self._by_sync = [pdo for pdo in self.transmit_pdos if pdo.exists and pdo.synchronous]
        self._by_events = [pdo for pdo in self.transmit_pdos if pdo.exists and not pdo.synchronous]

    # --- process data

    def _sync(self, data: bytes | bytearray) -> None:
        if self.nmt is not Nmt.OPERATIONAL:
            return
        if len(data) != (1 if self.objects[0x1019] else 0):
            self._complain(0x8240)
            return
        self.syncs += 1
        was_lost = self.operation.now - self._synced_at > _NONE_LOST * self.operation.period
        self._synced_at = self.operation.now
        contradicted, self._contradicted = self._contradicted, False
        if contradicted and not was_lost and self.state is State.OPERATION_ENABLED:
            self.operation.fault(codes.IDENTIFIER_COLLISION)
        for received in self.receive_pdos:
            if received.waiting is None:
                received.missed = self.syncs
            else:
                waiting, received.waiting = received.waiting, None
                received.apply(waiting, self._refused)
        self.operation.sync()
        for pdo in self._by_sync:
            if pdo.due_at_sync():
                self._transmit(pdo)

    def _take_pdo(self, pdos: list[Rpdo], data: bytes) -> None:
        if self.nmt is not Nmt.OPERATIONAL:
            return
        for pdo in pdos:
            if len(data) < pdo.size:
                self._complain(codes.PDO_TOO_SHORT)
                continue
            if pdo in self._timed:
                pdo.deadline = self.operation.now + pdo.event_time
            if pdo.synchronous:
                if self._contradicts(pdo, data):
                    self.operation.fault(codes.IDENTIFIER_COLLISION)
                pdo.waiting, pdo.came_at = data, self.operation.now
            else:
                pdo.apply(data, self._refused)
                self.operation.actuate()

    def _contradicts(self, pdo: Rpdo, data: bytes) -> bool:
        """Whether two hosts command: two commands for one SYNC, too close for one whose SYNC was lost.

        The next SYNC decides about those that are further apart: if it comes in time, none was lost between them. A
        host that takes the power away may always change its mind. Where a SYNC has just found no command, one of the
        two is the one that it missed: that waited for the bus together with SYNC, which goes first.
        """
        if pdo.waiting in (None, data) or self.state is not State.OPERATION_ENABLED:
            return False
        word = int.from_bytes(data[:2], "little") if pdo.mapped[0] == (0x6040, 0) else codes.ENABLE_OPERATION
        if command(word) is not Command.ENABLE_OPERATION:
            return False
        if self.syncs - pdo.missed < _LATE:
            pdo.missed = -inf
            return False
        self._contradicted = True
        return self.operation.now - pdo.came_at < _CLOSE * self.operation.period

    def _complain(self, code: int) -> None:
        """A frame was wrong: say so once, not for each of a thousand in a second."""
        if not self._bad_length:
            self._bad_length = True
            self.errors.report(code)

    def _refused(self, key: Key, value: Any) -> None:
        """A PDO carries what its object refuses: it keeps the value that it has. PDOs have no answer (CiA 301)."""

    def _rpdo_timeout(self, now: float) -> None:
        for pdo in self._timed:
            if pdo.deadline <= now:
                pdo.deadline = inf
                if self.state is State.OPERATION_ENABLED:
                    self.operation.fault(codes.RPDO_TIMEOUT)

    def _rpdo_deadline(self) -> float:
        return min([pdo.deadline for pdo in self._timed]) if self._timed else inf

    def _event_deadline(self) -> float:
        if self.nmt is not Nmt.OPERATIONAL:
            return inf
        instants = [pdo.sent_at + pdo.event_time for pdo in self._by_events if pdo.event_time]
        return min([*instants, self._rpdo_deadline()])

    def _send_events(self) -> None:
        """The event-driven TPDOs whose data has changed, or whose event timer has run out."""
        if not self._by_events or self.nmt is not Nmt.OPERATIONAL:
            return
        now = self.operation.now
        for pdo in self._by_events:
            age = now - pdo.sent_at
            timed_out = pdo.event_time and age >= pdo.event_time
            if timed_out or (age >= pdo.inhibit_time and pdo.pack() != pdo.sent):
                self._transmit(pdo)

    def _transmit(self, pdo: Tpdo) -> None:
        pdo.sent, pdo.sent_at = pdo.pack(), self.operation.now
        self._send(pdo.identifier, pdo.sent)

    # --- what is written to communication objects

    def _check_sync_identifier(self, value: int) -> None:
        # producing SYNC and 29-bit identifiers aren't for us
        if value & ~0x7FF or any(value in taken for taken in codes.RESTRICTED):
            raise SdoAbortedError(Abort.VALUE)

    def _check_emergency_identifier(self, value: int) -> None:
        if value & 0x7FFFF800 or value & 0x7FF == 0x80 or any(value & 0x7FF in taken for taken in codes.RESTRICTED):
            raise SdoAbortedError(Abort.VALUE)

    def _check_sync_counter(self, value: int) -> None:
        if value == 1:
            raise SdoAbortedError(Abort.VALUE)
        if self.objects[0x1006]:
            raise SdoAbortedError(Abort.DEVICE_STATE)

    def _store(self, word: int) -> None:
        if word != SAVE:
            raise SdoAbortedError(Abort.DEVICE_STATE)
        self.objects.store()

    def _restore(self, word: int) -> None:
        if word != LOAD:
            raise SdoAbortedError(Abort.DEVICE_STATE)
        self.objects.forget()

    # --- frames

    def _send(self, identifier: int, data: bytes) -> None:
        if self.nmt is Nmt.STOPPED and not HEARTBEAT < identifier < HEARTBEAT + 0x80:
            return
        self._out.append((identifier, data))

    def _flush(self) -> list[Frame]:
        out, self._out = self._out, []
        return out


def _refuse_mapping(_: Any) -> None:
    raise SdoAbortedError(Abort.READ_ONLY)
