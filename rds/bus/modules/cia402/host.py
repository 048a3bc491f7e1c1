"""The host's side of CiA 402 drives: RPDOs and SYNC out, one TPDO of each drive in, in our own loop.

The library (`canopen`) gets the drives ready (configure.py); from then on its thread is gone, and a cycle costs one
send per drive and one for SYNC. The order within a cycle is that of our own modules' tick: targets are sent before
SYNC, take effect at SYNC in all drives at once, and the positions that come back are those at SYNC.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import can

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.asking import ask, frame
from rds.bus.modules.cia402.codes import Nmt, NmtCommand, State, error_text, status_text
from rds.bus.modules.cia402.configure import Limits, Watch, library, prepare, unwatched
from rds.bus.modules.cia402.remote import Remote
from rds.bus.modules.cia402.settings import read_settings
from rds.bus.modules.rds.identity import WAIT as LISTENING
from rds.bus.tools.link import BUILTIN, bus_name, default_channel, open_bus
from rds.bus.tools.listening import frames_within
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Machine

LOG = logging.getLogger(__name__)

_NMT, _SYNC = 0x000, 0x080
HOST = "host"  # what the built-in bus calls this node
LOST_AFTER = 10  # periods in a row without an answer
_HEARTBEATS = 3  # heartbeats that may be missing
_SWITCHING = 1.0  # s for all drives to change their state
_STOPPING = 5.0  # s for a quick stop; a spindle takes the longest
_STANDSTILL = 20  # cycles in which no encoder moves until the axes count as standing
_LONGEST_COAST = 3.0  # s until then
_MOST_WAITING = 64  # frames taken before a cycle, whatever babbles
_TPDO, _EMERGENCY, _HEARTBEAT, _OTHER = range(4)


@dataclass
class Counters:
    """What went over the bus beside the expected answers."""

    ticks: int = 0  # SYNCs sent
    missing: int = 0  # answers that did not come in their period
    silent: int = 0  # periods in which a drive gave no answer at all, not even a late one
    late: int = 0  # answers that came after it
    emergencies: int = 0  # emergency messages with an error
    foreign: int = 0  # frames that no drive of ours sent


class Cia402Drivers:
    """Implements `rds.core.contracts.Drivers` for the `axes` (names; default all) of `machine`.

    Takes an open `bus`, which stays the caller's, or opens one: `interface`, `channel` (default on the built-in bus:
    the machine's name) and further `options` for it. `cia402` is the `[bus.cia402]` table (settings.py).

    What write() takes depends on each drive's mode: "cst" (default) voltages, as the contract says, sent as a target
    torque of 1000 ‰ per rated voltage; "csp" positions in the axis's unit; "csv" velocities in unit/s. Positions, read
    and commanded, are relative to where the axis stood at start(), or with `positions = "drive"` the drive's own.
    Power comes on with the first write() after start(); with `dry_run` never.
    """

    def __init__(
        self,
        machine: Machine,
        axes: Sequence[str] | None = None,
        *,
        bus: can.BusABC | None = None,
        interface: str = BUILTIN,
        channel: str | None = None,
        sample_period: float | None = None,
        dry_run: bool = False,
        timeout: float | None = None,
        cia402: Mapping[str, Any] | None = None,
        **options: Any,
    ):
        self.settings = read_settings(cia402 or {}, machine, axes)
        self.drives = [Remote(drive) for drive in self.settings.drives]
        self._period = machine.sample_period if sample_period is None else sample_period
        self._timeout = self._period if timeout is None else timeout
        self._dry_run = dry_run
        self._table: dict[int, tuple[int, Remote]] = {}
        for drive in self.drives:
            for base, kind in ((0x180, _TPDO), (0x080, _EMERGENCY), (0x700, _HEARTBEAT), (0x580, _OTHER)):
                self._table[base + drive.node] = kind, drive
        self._hosts = {_SYNC, *(0x200 + drive.node for drive in self.drives)}  # what only a host sends
        self._owns_bus = bus is None
        if bus is None:
            channel = default_channel(machine, interface, channel)
            bus = open_bus(interface, channel, [_NMT, *sorted({*self._table, *self._hosts})], node=HOST, **options)
            self._bus_name = bus_name(interface, channel)
        else:
            self._bus_name = bus.channel_info
        self._bus = bus
        self._sync = frame(_SYNC, b"")
        self._beat = frame(0x700 + self.settings.host, bytes([Nmt.OPERATIONAL]))
        self._next_beat = self._check_beats_at = inf
        # with SYNC, targets are sent as soon as they are known, and wait in the drives; else just before SYNC
        self._early = self.settings.transmission <= 240
        self._is_sent = False
        self._armed = False
        self._armed_at = 0.0
        self._commanded = (0.0,) * len(self.drives)  # what the next SYNC makes act
        self._acting = self._commanded
        self._unheard: set[int] = set()  # nodes of the drives that have been silent since the last SYNC
        self._stopping = False  # after stop()
        self._started = self._closed = False
        self.limits: list[Limits] = []  # software limits 0x607D since start(), axis units, from the drives' own zero
        self.counters = Counters()

    # --- start

    def start(self, watch: Watch = unwatched) -> None:
        """Configure the drives, home them where asked for, bring them to SWITCHED ON, and take the origins.

        The axes stand when this returns, without power. `watch(axis, position)` is called while an axis is homed, with
        the drive's own position in axis units; what it raises ends the homing, takes the power, and comes out of here.
        Raises MachineError naming node, state and error code, the devices that share a node-ID, and if another host
        commands the drives.
        """
        self._next_beat = inf  # drives wait for heartbeats from the first one on
        with self._failing_bus():
            self._refuse_company()
            with library(self._bus) as network:
                self.limits = prepare(network, self.settings, self._period, watch)
            self._started = True
            for drive in self.drives:
                drive.heard_at = inf
            self._switch_on()
            self._wait_for_standstill()
        for drive in self.drives:
            drive.origin = 0 if self.settings.absolute or drive.reads_velocity else drive.actual_counts
            drive.hold()
        self._check_beats_at = 0.0
        self.counters = Counters()

    def _refuse_company(self) -> None:
        for message in frames_within(self._bus, LISTENING):
            if message.arbitration_id not in self._table:
                self._take_foreign(message)

    def _take_foreign(self, message: can.Message) -> None:
        """A frame that no drive of ours sent. MachineError for a stop of the network, and for another host."""
        self.counters.foreign += 1
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame or not message.is_rx:
            return
        identifier, data = message.arbitration_id, message.data
        if identifier == _NMT and len(data) == 2 and data[0] == NmtCommand.STOP:
            if data[1] in (0, *(drive.node for drive in self.drives)):
                self.stop()
                raise MachineError(
                    f"emergency stop: the drives on bus {self._bus_name} were stopped from outside this run (NMT stop)"
                )
        elif identifier in self._hosts:
            self.stop()
            raise MachineError(
                f"another host commands the drives on bus {self._bus_name} (frame {identifier:#05x} was heard); stop "
                "one of them (`rds estop` stops the machine): two hosts never drive the same axes"
            )

    def _switch_on(self) -> None:
        deadline = time.monotonic() + _SWITCHING
        while not all(drive.state is State.SWITCHED_ON for drive in self.drives):
            if time.monotonic() > deadline:
                late = next(drive for drive in self.drives if drive.state is not State.SWITCHED_ON)
                if not late.seen:
                    raise self._silent([late])
                raise self._wrong(late, f"did not reach {State.SWITCHED_ON} in {_SWITCHING:g} s")
            for drive in self.drives:
                drive.missed = 0
                drive.hold()
            self._paced_exchange()

    def _wait_for_standstill(self) -> None:
        """An earlier run may have left an axis coasting."""
        still, before = 0, [drive.actual_counts for drive in self.drives]
        deadline = time.monotonic() + _LONGEST_COAST
        while still < _STANDSTILL and time.monotonic() < deadline:
            self._paced_exchange()
            now = [drive.actual_counts for drive in self.drives]
            still = still + 1 if now == before else 0
            before = now

    def _paced_exchange(self) -> None:
        due = time.monotonic() + self._period
        self.exchange()
        time.sleep(max(0.0, due - time.monotonic()))

    # --- the cycle

    def exchange(self) -> list[float]:
        """Send SYNC, at which the waiting targets act; return the measured values at SYNC, in axis units.

        An answer that doesn't come in time repeats the last value and is counted. Raises MachineError when a drive
        has not answered for 10 periods in a row, reports an error, leaves OPERATION ENABLED by itself, or when its
        heartbeat is missing; all drives are stopped then.
        """
        now = time.monotonic()
        try:
            if not self._is_sent:
                self._send_targets()
            self._is_sent = False
            self._drain()
            self.counters.silent += bool(self._unheard)
            self._unheard.clear()
            self._bus.send(self._sync, self._timeout * LOST_AFTER)
            self.counters.ticks += 1
            self._collect(now + self._timeout)
            if now >= self._next_beat:
                self._next_beat = now + self.settings.heartbeat
                self._bus.send(self._beat, self._timeout * LOST_AFTER)
        except can.CanError as error:
            raise MachineError(f"bus {self._bus_name} failed: {error}") from error
        acting = self._commanded
        if self._armed:
            self._check(now)
            if not all(drive.enabled for drive in self.drives):
                acting = tuple(
                    [value if drive.enabled else 0.0 for value, drive in zip(acting, self.drives, strict=True)]
                )
        self._acting = acting
        return [drive.actual for drive in self.drives]

    def write(self, targets: Sequence[float]) -> tuple[float, ...]:
        """Take the targets (V; in the modes csp and csv unit, unit/s) that act from the next SYNC on.

        Returns those that act since the last SYNC, as the drives' numbers say them; 0 for one whose power isn't on yet.
        InputError for one that is too large.
        """
        if len(targets) != len(self.drives):
            raise InputError(f"{len(targets)} values for {len(self.drives)} drives")
        commanded = tuple([drive.aim(value) for drive, value in zip(self.drives, targets, strict=True)])
        if self._dry_run:
            for drive in self.drives:
                drive.hold()
            return self._acting
        if not self._armed:
            self._arm()
        self._commanded = commanded
        if self._early:
            try:
                self._send_targets()
            except can.CanError as error:
                raise MachineError(f"bus {self._bus_name} failed: {error}") from error
            self._is_sent = True
        return self._acting

    def _arm(self) -> None:
        """From now on power is wanted, the drives wait for the host's heartbeats, and the host for theirs."""
        self._armed, self._stopping = True, False
        self._armed_at = now = time.monotonic()
        self._next_beat = 0.0
        self._check_beats_at = now + _HEARTBEATS * self.settings.heartbeat
        for drive in self.drives:
            drive.was_enabled = False
            drive.emergency = 0

    def _send_targets(self) -> None:
        for drive in self.drives:
            if drive.enabled and self._armed:
                drive.controlword = codes.ENABLE_OPERATION
            elif self._stopping:
                drive.quit()
            else:
                drive.lead(self._armed)
            self._bus.send(drive.fill(), self._timeout * LOST_AFTER)

    def _collect(self, deadline: float) -> None:
        """Take frames until all TPDOs are here or the deadline has passed."""
        receive, table, clock = self._bus.recv, self._table, time.monotonic
        awaited = {drive.node for drive in self.drives}
        while awaited:
            left = deadline - clock()
            message = receive(left if left > 0.0 else 0.0)
            if message is None:
                if left <= 0.0 or clock() >= deadline:
                    break
                continue
            entry = table.get(message.arbitration_id)
            if entry is None or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
                self._take_foreign(message)
                continue
            kind, drive = entry
            if kind != _TPDO:
                self._note(kind, drive, message)
            elif len(message.data) >= 6:
                drive.take_status(message.data)
                awaited.discard(drive.node)
        if awaited:
            self._note_missing(awaited)

    def _drain(self) -> None:
        """Take what has come since the last cycle; a position among it is late, and is not this cycle's."""
        for _ in range(_MOST_WAITING):
            message = self._bus.recv(0.0)
            if message is None:
                return
            kind, drive = self._table.get(message.arbitration_id, (_OTHER, None))
            if drive is None:
                self._take_foreign(message)
            elif kind == _TPDO:
                self._unheard.discard(drive.node)
                self.counters.late += 1
            else:
                self._note(kind, drive, message)

    def _note(self, kind: int, drive: Remote, message: can.Message) -> None:
        if kind == _EMERGENCY and len(message.data) >= 2:
            code = int.from_bytes(message.data[:2], "little")
            if code:
                drive.emergency = code
                self.counters.emergencies += 1
                LOG.warning("%s reports %s", drive.name, error_text(code))
        elif kind == _HEARTBEAT and len(message.data) == 1:
            drive.heard_at = time.monotonic()
            nmt = message.data[0] & 0x7F
            if nmt != Nmt.OPERATIONAL and self._armed:
                what = "has restarted" if nmt == Nmt.BOOT_UP else f"has left NMT state OPERATIONAL (now {nmt})"
                raise self._wrong(drive, what)

    def _note_missing(self, awaited: set[int]) -> None:
        lost = []
        for drive in self.drives:
            if drive.node in awaited:
                self._unheard.add(drive.node)
                drive.missed += 1
                self.counters.missing += 1
                if drive.missed >= LOST_AFTER and drive.seen:
                    lost.append(drive)
        if lost:
            self.stop()
            raise self._silent(lost)

    def _check(self, now: float) -> None:
        """Whether each drive is as it should be under command."""
        for drive in self.drives:
            if drive.enabled:
                drive.was_enabled = True
            elif drive.was_enabled or drive.state is State.FAULT or drive.state is State.FAULT_REACTION_ACTIVE:
                raise self._wrong(drive, f"left {State.OPERATION_ENABLED}" if drive.was_enabled else "is in fault")
            elif now - self._armed_at > _SWITCHING:
                raise self._wrong(drive, f"did not reach {State.OPERATION_ENABLED} in {_SWITCHING:g} s")
            if drive.emergency:
                raise self._wrong(drive, "reports an error")
        if now >= self._check_beats_at:
            allowed = _HEARTBEATS * self.settings.heartbeat
            self._check_beats_at = now + self.settings.heartbeat
            for drive in self.drives:
                if drive.heard_at < inf and now - drive.heard_at > allowed:
                    self.stop()
                    raise MachineError(f"no heartbeat from {drive.name} for {now - drive.heard_at:.2f} s")

    # --- the end

    def confirm(self) -> None:
        """After the last sample: a drive that was silent for 10 periods has ended the run already."""

    def stop(self) -> None:
        """Power off on all axes, now: voltage disabled in mode cst, a quick stop in csp and csv.

        If the bus is broken, the drives do it themselves when SYNC and heartbeat are missing; the log says so.
        """
        self._armed = False
        self._stopping = True
        self._commanded = self._acting = (0.0,) * len(self.drives)
        if not self._started:
            return
        try:
            for drive in self.drives:
                drive.hold()
                drive.quit()
                self._bus.send(drive.fill(), 0.1)
            self._bus.send(self._sync, 0.1)
        except (can.CanError, OSError) as error:
            LOG.error("power off could not be sent (%s); the drives do it when SYNC and heartbeat are missing", error)

    def close(self) -> None:
        """Power off, drives to PRE-OPERATIONAL, then let go of the bus (a bus that was handed in stays open)."""
        if self._closed:
            return
        self._closed = True
        self.stop()
        if self._started:
            with contextlib.suppress(MachineError, can.CanError, OSError):
                self._let_go()
        if self._owns_bus:
            self._bus.shutdown()

    def _let_go(self) -> None:
        """Wait until the drives have stopped; then they need neither SYNC nor our heartbeat any more.

        One that stays in QUICK STOP ACTIVE, as option codes 5 to 8 of 0x605A have it, is told to give up its power.
        """
        deadline = time.monotonic() + _STOPPING
        moving = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
        while any(drive.state in moving for drive in self.drives) and time.monotonic() < deadline:
            self._paced_exchange()
        for drive in self.drives:
            if drive.state in moving:
                drive.hold()
                drive.controlword = codes.DISABLE_VOLTAGE
                self._bus.send(drive.fill(), 0.1)
        self._bus.send(self._sync, 0.1)
        for drive in self.drives:
            self._bus.send(frame(0x600 + drive.node, b"\x23\x16\x10\x01\0\0\0\0"), 0.1)  # 0x1016:01 = 0
            self._bus.send(frame(0x000, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, drive.node])), 0.1)

    # --- errors

    def _wrong(self, drive: Remote, what: str) -> MachineError:
        """Stop all drives, and say what is wrong with one: its state, statusword and error code."""
        self.stop()
        code = ask(self._bus, drive)
        return MachineError(
            f"{drive.name} {what}: state {drive.state}, statusword {status_text(drive.status)}, "
            f"error code {error_text(code) if code is not None else 'unknown (no answer)'}"
        )

    def _silent(self, drives: Sequence[Remote]) -> MachineError:
        names = ", ".join(drive.name for drive in drives)
        return MachineError(f"no answer from {names} on bus {self._bus_name}; check [bus], power and cable")

    @contextlib.contextmanager
    def _failing_bus(self) -> Any:
        try:
            yield
        except (can.CanError, OSError) as error:
            raise MachineError(f"bus {self._bus_name} failed: {error}") from error
