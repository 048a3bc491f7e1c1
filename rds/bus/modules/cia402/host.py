"""The host's side of CiA 402 drives: RPDOs and SYNC out, one TPDO of each drive in, in our own loop.

The library (`canopen`) gets the drives ready (configure.py); from then on its thread is gone, and a cycle costs one
send per drive and one for SYNC. The order within a cycle is that of our own modules' tick: targets are sent before
SYNC, take effect at SYNC in all drives at once, and the positions that come back are those at SYNC.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import can

from rds.bus.modules.can_drivers import CanDrivers, Handler
from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.asking import ask, frame
from rds.bus.modules.cia402.codes import Nmt, NmtCommand, State, error_text, status_text
from rds.bus.modules.cia402.configure import library, prepare
from rds.bus.modules.cia402.mapping import RPDOS, TPDOS
from rds.bus.modules.cia402.remote import Remote
from rds.bus.modules.cia402.settings import read_settings
from rds.bus.modules.rds.identity import WAIT as LISTENING
from rds.bus.tools.link import BUILTIN
from rds.bus.tools.listening import frames_within
from rds.core import contracts
from rds.core.contracts import Watch, unwatched
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Machine

LOG = logging.getLogger(__name__)

_NMT, _SYNC, _EMERGENCY, _TPDO, _RPDO, _ANSWER, _HEARTBEAT = 0x000, 0x080, 0x080, 0x180, 0x200, 0x580, 0x700
LOST_AFTER = 10  # periods in a row without an answer
_HEARTBEATS = 3  # heartbeats that may be missing
_SWITCHING = 1.0  # s for all drives to change their state
_STOPPING = 5.0  # s for a quick stop; a spindle takes the longest


@dataclass
class Counters(contracts.Counters):
    """What drives tell besides. A tick is a SYNC."""

    emergencies: int = 0  # emergency messages with an error


class Cia402Drivers(CanDrivers[Remote]):
    """Implements `rds.core.contracts.Drivers` for the `axes` (names; default all) of `machine`.

    Takes an open `bus`, which stays the caller's, or opens one: `interface`, `channel` (default on the built-in bus:
    the machine's name) and further `options` for it. `cia402` is the `[bus.cia402]` table (settings.py).

    What write() takes depends on each drive's mode: "cst" (default) voltages, as the contract says, sent as a target
    torque of 1000 ‰ per rated voltage; "csp" positions in the axis's unit, which the drive follows from SYNC to SYNC;
    "csv" velocities in unit/s; "pp" positions that the drive goes to by a profile of its own. Positions, read and
    commanded, are relative to where the axis stood at start(), or with `positions = "drive"` the drive's own.
    Power comes on with the first write() after start(); with `dry_run` never.
    """

    noun = "drives"
    counters: Counters

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
        self.drives = [Remote(drive, self.settings.absolute) for drive in self.settings.drives]
        handlers: dict[int, Handler[Remote]] = {}
        for drive in self.drives:
            for base in TPDOS if drive.fixed_mapping else TPDOS[:1]:
                handlers[base + drive.node] = _pass_over  # until start() knows which one it is
            handlers[_EMERGENCY + drive.node] = partial(self._take_emergency, drive)
            handlers[_HEARTBEAT + drive.node] = partial(self._take_heartbeat, drive)
            handlers[_ANSWER + drive.node] = partial(self._take_answer, drive)
        super().__init__(
            machine,
            self.drives,
            handlers,
            hosts=(_SYNC, *_received(self.drives)),
            also=(_NMT,),
            bus=bus,
            interface=interface,
            channel=channel,
            options=options,
            period=machine.sample_period if sample_period is None else sample_period,
            timeout=timeout,
            lost_after=LOST_AFTER,
        )
        self._dry_run = dry_run
        self._send_timeout = self._timeout * LOST_AFTER
        self._sync = frame(_SYNC, b"")
        self._beat = frame(_HEARTBEAT + self.settings.host, bytes([Nmt.OPERATIONAL]))
        self._next_beat = self._check_beats_at = inf
        # with SYNC, targets are sent as soon as they are known, and wait in the drives; else just before SYNC
        self._early = self.settings.transmission <= 240
        self._is_sent = False
        self._armed = False
        self._armed_at = 0.0
        self._commanded = (0.0,) * len(self.drives)  # what the next SYNC makes act
        self._acting = self._commanded
        self._stopping = False  # after stop()
        self.told: dict[tuple[int, int], bytes] = {}  # answers to ask_for()
        self._configured = False  # from then on the drives take process data

    def _count_anew(self) -> None:
        self.counters = Counters()

    # --- start

    def start(self, watch: Watch = unwatched) -> None:
        """Configure the drives, home them where asked for, bring them to SWITCHED ON, and take the origins.

        The axes stand when this returns, without power. `watch(axis, position)` is called while an axis is homed, with
        the drive's own position in axis units; what it raises ends the homing, takes the power, and comes out of here.
        `limits` are the software limits 0x607D from then on, axis units, from the drives' own zero. Raises MachineError
        naming node, state and error code, the devices that share a node-ID, and if another host commands the drives.
        """
        self._next_beat = inf  # drives wait for heartbeats from the first one on
        super().start(watch)
        for drive in self.drives:
            drive.hold()
        self._check_beats_at = 0.0

    def _refuse_company(self) -> None:
        for message in frames_within(self._bus, LISTENING):
            if message.arbitration_id not in self._handlers:
                self._take_foreign(message)

    def _set_up(self, watch: Watch) -> None:
        with library(self._bus) as network:
            self.limits, layouts = prepare(network, self.settings, self._period, watch)
        for drive, layout in zip(self.drives, layouts, strict=True):
            drive.use(layout)
            self._handlers[layout.send] = drive.take_status
        self._configured = True
        for drive in self.drives:
            drive.heard_at = inf
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

    def _hear_foreign(self, identifier: int, data: bytearray) -> None:
        """MachineError for a stop of the network."""
        if identifier != _NMT or len(data) != 2 or data[0] != NmtCommand.STOP:
            return
        if data[1] in (0, *(drive.node for drive in self.drives)):
            self.stop()
            raise MachineError(
                f"emergency stop: the drives on bus {self._bus_name} were stopped from outside this run (NMT stop)"
            )

    def _leave_to_other_host(self) -> None:
        self.stop()

    # --- the cycle

    def exchange(self) -> list[float]:
        """Send SYNC, at which the waiting targets act; return the measured values at SYNC, in axis units.

        An answer that doesn't come in time repeats the last value and is counted. Raises MachineError when a drive
        has not answered for 10 periods in a row, reports an error, leaves OPERATION ENABLED by itself, or when its
        heartbeat is missing; all drives are stopped then.
        """
        now = time.monotonic()
        measured = super().exchange()
        if now >= self._next_beat:
            self._next_beat = now + self.settings.heartbeat
            with self._failing():
                self._bus.send(self._beat, self._send_timeout)
        acting = self._commanded
        if self._armed:
            self._check(now)
            if not all(drive.enabled for drive in self.drives):
                acting = tuple(
                    [
                        value if drive.enabled else drive.resting
                        for value, drive in zip(acting, self.drives, strict=True)
                    ]
                )
        self._acting = acting
        return measured

    def _tick(self) -> None:
        if not self._is_sent:
            self._send_targets()
        self._is_sent = False
        self._bus.send(self._sync, self._send_timeout)

    def write(self, targets: Sequence[float]) -> tuple[float, ...]:
        """Take the targets (V; in the modes csp and pp unit, in csv unit/s) that act from the next SYNC on.

        Returns those that act since the last SYNC, as the drives' numbers say them; where the power isn't on yet, the
        one at which nothing moves.
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
            except self.failures as error:
                raise self._failed(error) from error
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
            drive.forget_set_points()

    def _send_targets(self) -> None:
        for drive in self.drives:
            if drive.enabled and self._armed:
                drive.operate()
            elif self._stopping:
                drive.quit()
            else:
                drive.lead(self._armed)
            self._bus.send(drive.fill(), self._send_timeout)

    def ask_for(self, drive: Remote, index: int, subindex: int = 0) -> None:
        """Ask for an object of at most 4 bytes between cycles; `told` has it once it has come, by node and index."""
        request = bytes((0x40, index & 0xFF, index >> 8, subindex)) + bytes(4)
        with self._failing():
            self._bus.send(frame(0x600 + drive.node, request), self._send_timeout)

    def _take_answer(self, drive: Remote, message: can.Message, late: bool) -> None:
        data = bytes(message.data)
        if len(data) == 8 and data[0] & 0xE3 == 0x43:  # an expedited upload
            size = 4 - (data[0] >> 2 & 3)
            self.told[drive.node, int.from_bytes(data[1:3], "little")] = data[4 : 4 + size]

    def _take_emergency(self, drive: Remote, message: can.Message, late: bool) -> None:
        if len(message.data) >= 2 and (code := int.from_bytes(message.data[:2], "little")):
            drive.emergency = code
            self.counters.emergencies += 1
            LOG.warning("%s reports %s", drive, error_text(code))

    def _take_heartbeat(self, drive: Remote, message: can.Message, late: bool) -> None:
        if len(message.data) != 1:
            return
        drive.heard_at = time.monotonic()
        nmt = message.data[0] & 0x7F
        if nmt != Nmt.OPERATIONAL and self._armed:
            what = "has restarted" if nmt == Nmt.BOOT_UP else f"has left NMT state OPERATIONAL (now {nmt})"
            raise self._wrong(drive, what)

    def _lost(self, modules: Sequence[Remote]) -> MachineError:
        self.stop()
        return self._silent(modules)

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
                    silent = f"no heartbeat from {drive} for {now - drive.heard_at:.2f} s"
                    raise MachineError(f"{silent}: check its power and the cable")

    # --- the end

    def stop(self) -> None:
        """Power off on all axes, now: voltage disabled in mode cst, a quick stop in the others.

        If the bus is broken, the drives do it themselves when SYNC and heartbeat are missing; the log says so.
        """
        self._armed = False
        self._stopping = True
        self._commanded = self._acting = (0.0,) * len(self.drives)
        if not self._configured:
            return
        try:
            for drive in self.drives:
                drive.hold()
                drive.quit()
                self._bus.send(drive.fill(), 0.1)
            self._bus.send(self._sync, 0.1)
        except (can.CanError, OSError) as error:
            LOG.error("power off could not be sent (%s); the drives do it when SYNC and heartbeat are missing", error)

    def _let_go(self) -> None:
        """Wait until the drives have stopped, then bring them to PRE-OPERATIONAL without heartbeats of ours.

        One that stays in QUICK STOP ACTIVE, as option codes 5 to 8 of 0x605A have it, is told to give up its power.
        """
        if not self._configured:
            return
        deadline = time.monotonic() + _STOPPING
        moving = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
        self._lost_after = sys.maxsize  # one that is lost ends nothing any more, and nobody waits for it
        while any(drive.state in moving and drive.missed < LOST_AFTER for drive in self.drives):
            if time.monotonic() >= deadline:
                break
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
            f"{drive} {what}: state {drive.state}, statusword {status_text(drive.status)}, "
            f"error code {error_text(code) if code is not None else 'unknown (no answer)'}"
        )


def _received(drives: Sequence[Remote]) -> list[int]:
    """The identifiers that a host commands these drives by."""
    return [base + drive.node for drive in drives for base in (RPDOS if drive.fixed_mapping else RPDOS[:1])]


def _pass_over(message: can.Message, late: bool) -> None:
    """What a drive answers to a request."""
