"""Layer setting services (CiA 305): a node-ID for a drive that has none. Both sides: host, and simulated drive."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Sequence
from typing import Any

import can

from rds.core.errors import MachineError

REQUEST, ANSWER = 0x7E5, 0x7E4
UNCONFIGURED = 255
_SWITCH, _NODE_ID, _BIT_TIMING, _STORE = 0x04, 0x11, 0x13, 0x17
_SELECT, _SELECTED = (0x40, 0x41, 0x42, 0x43), 0x44
_INQUIRE = (0x5A, 0x5B, 0x5C, 0x5D)
_INQUIRE_NODE, _FAST, _FOUND = 0x5E, 0x51, 0x4F
_IDENTIFY = (0x46, 0x47, 0x48, 0x49, 0x4A, 0x4B)  # vendor, product, revision from, to, serial number from, to
_IDENTIFY_NEW, _FOUND_NEW = 0x4C, 0x50
_WAIT = 0.1  # s for an answer; a fast scan asks 132 times at most
_RESET = 128  # bit check that begins a fast scan anew
_STORES = 5.0  # s for a drive to write its memory

Identity = tuple[int, int, int, int]  # vendor, product, revision, serial number


def give_node_id(bus: can.BusABC, node: int, keep: bool = True, wait: float = _WAIT) -> Identity:
    """Find the device without a node-ID by a fast scan, and give it `node`. Returns its identity.

    With `keep` it stores the node-ID. MachineError if there is none, or it refuses.
    """
    master = _Master(bus, wait)
    identity = master.fast_scan()
    if identity is None:
        raise MachineError(
            "no device without a node-ID answers to LSS: it has one already (`rds scan`), knows no LSS (see its "
            "switches or its maker's tool), or its bit rate is another"
        )
    try:
        master.command(_NODE_ID, bytes([node]), f"take node-ID {node}")
        if keep:
            master.command(_STORE, b"", "store it", _STORES)
    finally:
        master.send(_SWITCH, b"\0")  # waiting again: it boots with its node-ID
    return identity


class _Master:
    def __init__(self, bus: can.BusABC, wait: float):
        self._bus, self._wait = bus, wait

    def send(self, command: int, data: bytes) -> None:
        self._bus.send(
            can.Message(arbitration_id=REQUEST, is_extended_id=False, data=(bytes([command]) + data).ljust(8, b"\0")),
            0.5,
        )

    def ask(self, command: int, data: bytes, answers: Sequence[int], wait: float | None = None) -> bytes | None:
        """The first answer with one of these command specifiers."""
        while self._bus.recv(0.0) is not None:
            pass
        self.send(command, data)
        deadline = time.monotonic() + (self._wait if wait is None else wait)
        while (left := deadline - time.monotonic()) > 0:
            heard = self._bus.recv(left)
            if heard is not None and heard.arbitration_id == ANSWER and heard.data and heard.data[0] in answers:
                return bytes(heard.data)
        return None

    def command(self, command: int, data: bytes, what: str, wait: float | None = None) -> None:
        answer = self.ask(command, data, (command,), wait or 10 * self._wait)
        if answer is None:
            raise MachineError(f"the device did not answer when told to {what}")
        if answer[1]:
            raise MachineError(f"the device does not {what}: error {answer[1]} (specific {answer[2]}) of LSS")

    def fast_scan(self) -> Identity | None:
        """Bit by bit, the identity of one device; it is in the state of configuration then."""
        found = [0, 0, 0, 0]
        if self._fast(0, _RESET, 0, 0) is None:
            return None
        for part in range(4):
            for bit in range(31, -1, -1):
                if self._fast(found[part], bit, part, part) is None:
                    found[part] |= 1 << bit
            if self._fast(found[part], 0, part, (part + 1) % 4) is None:
                raise MachineError("the devices without a node-ID answer LSS in contradiction; connect one at a time")
        return found[0], found[1], found[2], found[3]

    def _fast(self, number: int, bit: int, part: int, following: int) -> bytes | None:
        return self.ask(_FAST, struct.pack("<IBBB", number, bit, part, following), (_FOUND,))


class Slave:
    """A simulated drive's side. `identity()` gives its four numbers, `node` its node-ID (255: none)."""

    def __init__(self, identity: Callable[[], Identity], node: int, taken: Callable[[int], Any]):
        self._identity, self.node, self._taken = identity, node, taken
        self._pending = node
        self.is_configuring = False
        self._selected = 0  # parts of the address that have fitted
        self._identified = 0  # the same for a range of addresses
        self._part = 0  # of a fast scan

    def receive(self, data: bytes) -> bytes | None:
        """Take a request; the answer, if there is one."""
        if len(data) != 8:
            return None
        command, value = data[0], int.from_bytes(data[1:5], "little")
        if command == _SWITCH:
            self._switch(data[1] == 1)
            return None
        if command == _FAST:
            return self._answer(_FOUND) if self.node == UNCONFIGURED and self._fits(value, *data[5:8]) else None
        if command in _SELECT:
            return self._select(_SELECT.index(command), value)
        if command in _IDENTIFY:
            return self._identify(_IDENTIFY.index(command), value)
        if command == _IDENTIFY_NEW:
            return self._answer(_FOUND_NEW) if self.node == UNCONFIGURED else None
        if not self.is_configuring:
            return None
        if command == _NODE_ID:
            right = 1 <= data[1] <= 127 or data[1] == UNCONFIGURED
            self._pending = data[1] if right else self._pending
            return self._answer(command, 0 if right else 1)
        if command == _BIT_TIMING:
            return self._answer(command, 1)  # it has the bus's
        if command == _STORE:
            return self._answer(command, 0)
        if command in _INQUIRE:
            return self._answer(command, *self._identity()[_INQUIRE.index(command)].to_bytes(4, "little"))
        return self._answer(command, self.node) if command == _INQUIRE_NODE else None

    def _switch(self, configuring: bool) -> None:
        was, self.is_configuring = self.is_configuring, configuring
        if was and not configuring and self._pending != self.node:
            self.node = self._pending
            self._taken(self.node)

    def _select(self, part: int, value: int) -> bytes | None:
        fits = self._identity()[part] == value and part in (0, self._selected)  # the vendor's number begins anew
        self._selected = part + 1 if fits else 0
        if self._selected < 4:
            return None
        self._selected, self.is_configuring = 0, True
        return self._answer(_SELECTED)

    def _identify(self, part: int, value: int) -> bytes | None:
        vendor, product, revision, serial = self._identity()
        fits = (
            value == vendor,
            value == product,
            value <= revision,
            revision <= value,
            value <= serial,
            serial <= value,
        )[part] and part in (0, self._identified)
        self._identified = part + 1 if fits else 0
        return self._answer(_FOUND) if self._identified == len(_IDENTIFY) else None

    def _fits(self, number: int, bit: int, part: int, following: int) -> bool:
        if bit == _RESET:
            self._part = 0
            return True
        if part != self._part or bit > 31 or (self._identity()[part] ^ number) >> bit:
            return False
        self._part = following
        if bit == 0 and following < part:
            self.is_configuring = True
        return True

    @staticmethod
    def _answer(*words: int) -> bytes:
        return bytes(words).ljust(8, b"\0")
