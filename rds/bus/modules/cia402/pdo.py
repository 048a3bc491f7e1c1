"""The drive's process data objects: communication (0x1400, 0x1800) and mapping (0x1600, 0x1A00), CiA 301, 7.5.2.35ff.

A mapping is changed while the PDO does not exist (bit 31 of its COB-ID set) and its number of mapped objects is 0;
everything else is refused by an abort code.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from struct import Struct
from typing import Any

from canopen.objectdictionary.datatypes import REAL32, SIGNED_TYPES
from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402.codes import RESTRICTED, Abort
from rds.bus.modules.cia402.dictionary import Dictionary, Key

COUNT = 4  # PDOs in each direction
INVALID, NO_RTR, EXTENDED = 1 << 31, 1 << 30, 1 << 29
HIGHEST_SYNCHRONOUS = 240
_EVENT_DRIVEN = (254, 255)
_LONGEST = 64  # bits
_LETTERS = {8: "B", 16: "H", 32: "I"}


class Pdo:
    """One PDO; `number` from 0. Its parameters live in the dictionary, and it checks what is written to them."""

    receives = False
    _communication, _mapping = 0x1800, 0x1A00

    def __init__(self, number: int, dictionary: Dictionary):
        self._dictionary = dictionary
        self._values = dictionary.values
        self.communication = self._communication + number
        self.mapping = self._mapping + number
        self.mapped: list[Key] = []
        self._struct = Struct("<")
        writers = dictionary.writers
        writers[self.communication, 1] = self._set_identifier
        writers[self.communication, 2] = self._set_transmission
        if not self.receives:
            writers[self.communication, 3] = self._only_while_invalid
        writers[self.mapping, 0] = self._set_count
        for entry in range(1, 9):
            writers[self.mapping, entry] = partial(self._set_entry, entry)
        self.reset()

    def reset(self) -> None:
        """Work with what the dictionary says now. A mapping of another drive's EDS that ours cannot do: no such PDO."""
        try:
            self._remap(self._values[self.mapping, 0])
        except (SdoAbortedError, KeyError):
            self._values[self.communication, 1] |= INVALID
            self._values[self.mapping, 0] = 0
            self._remap(0)

    def restart(self) -> None:
        """NMT has entered or left OPERATIONAL."""

    @property
    def exists(self) -> bool:
        """Whether it is sent or taken at all, in NMT state OPERATIONAL."""
        return not self._values[self.communication, 1] & INVALID

    @property
    def identifier(self) -> int:
        """Its CAN identifier."""
        return int(self._values[self.communication, 1] & 0x7FF)

    @property
    def transmission(self) -> int:
        """Its transmission type: 0 to 240 with SYNC, 254 and 255 by events."""
        return int(self._values[self.communication, 2])

    @property
    def synchronous(self) -> bool:
        """Whether it goes with SYNC."""
        return self.transmission <= HIGHEST_SYNCHRONOUS

    @property
    def event_time(self) -> float:
        """The event timer, s; 0: none. For an RPDO the longest time between two."""
        return float(self._values[self.communication, 5]) * 1e-3

    @property
    def size(self) -> int:
        """Bytes."""
        return self._struct.size

    # --- what is written over SDO

    def _set_identifier(self, value: int) -> None:
        if value & EXTENDED or (not self.receives and self._values[self.communication, 1] & ~value & NO_RTR):
            raise SdoAbortedError(Abort.VALUE)  # neither 29-bit identifiers nor remote requests
        if not value & INVALID:
            if self.exists and (value ^ self._values[self.communication, 1]) & 0x3FFFFFFF:
                raise SdoAbortedError(Abort.DEVICE_STATE)
            if any(value & 0x7FF in taken for taken in RESTRICTED):
                raise SdoAbortedError(Abort.VALUE)

    def _set_transmission(self, value: int) -> None:
        if value > HIGHEST_SYNCHRONOUS and value not in _EVENT_DRIVEN:
            raise SdoAbortedError(Abort.VALUE)

    def _only_while_invalid(self, _: Any) -> None:
        if self.exists:
            raise SdoAbortedError(Abort.DEVICE_STATE)

    def _set_count(self, count: int) -> None:
        self._only_while_invalid(count)
        self._remap(count)

    def _set_entry(self, entry: int, value: int) -> None:
        self._only_while_invalid(value)
        if self._values[self.mapping, 0] != 0:
            raise SdoAbortedError(Abort.DEVICE_STATE)
        if value:
            self._check_entry(value)

    def _check_entry(self, value: int) -> tuple[Key, int, str]:
        """The object that a mapping entry names, its bits, and its letter in a struct."""
        key, bits = (value >> 16, value >> 8 & 0xFF), value & 0xFF
        if self.receives and key[1] == 0 and (dummy := {2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}.get(key[0])):
            if bits != dummy:
                raise SdoAbortedError(Abort.NOT_MAPPABLE)
            return key, bits, f"{bits // 8}x"
        variable = self._dictionary.variable(*key)
        allowed = variable.writable if self.receives else variable.readable
        if not variable.pdo_mappable or not allowed or bits != len(variable):
            raise SdoAbortedError(Abort.NOT_MAPPABLE)
        if self.receives and variable.access_type == "rw" and 0x1000 <= key[0] < 0x2000:
            raise SdoAbortedError(Abort.NOT_MAPPABLE)
        letter = "f" if variable.data_type == REAL32 else _LETTERS[bits]
        return key, bits, letter.lower() if variable.data_type in SIGNED_TYPES else letter

    def _remap(self, count: int) -> None:
        entries = [self._check_entry(self._values[self.mapping, entry]) for entry in range(1, count + 1)]
        if sum(bits for _, bits, _ in entries) > _LONGEST:
            raise SdoAbortedError(Abort.PDO_LENGTH)
        self._struct = Struct("<" + "".join(letter for _, _, letter in entries))
        self.mapped = [key for key, _, letter in entries if not letter.endswith("x")]


class Tpdo(Pdo):
    """A PDO that the drive sends."""

    def __init__(self, number: int, dictionary: Dictionary):
        super().__init__(number, dictionary)
        self.sent: bytes | None = None  # what was sent last
        self.sent_at = 0.0  # s
        self._syncs = 0

    @property
    def inhibit_time(self) -> float:
        """The shortest time between two, s."""
        return float(self._values[self.communication, 3]) * 1e-4

    def pack(self) -> bytes:
        """Its data now."""
        read = self._dictionary.read
        return self._struct.pack(*[read(*key) for key in self.mapped])

    def due_at_sync(self) -> bool:
        """Count a SYNC; whether it is this PDO's turn. Type 0 waits for a change besides."""
        transmission = self.transmission
        if transmission == 0:
            return self.pack() != self.sent
        self._syncs += 1
        if self._syncs < transmission:
            return False
        self._syncs = 0
        return True

    def restart(self) -> None:
        self.sent, self._syncs = None, 0


class Rpdo(Pdo):
    """A PDO that the drive takes. `refused` is called with the key and the value of what it can't."""

    receives = True
    _communication, _mapping = 0x1400, 0x1600

    def __init__(self, number: int, dictionary: Dictionary):
        super().__init__(number, dictionary)
        self.waiting: bytes | None = None  # data that the next SYNC makes act
        self.came_at = 0.0  # s, those data
        self.missed = -inf  # number of the SYNC that found none, until a command more than one makes up for it
        self.deadline = inf  # s, by the event timer

    def apply(self, data: bytes, refused: Callable[[Key, Any], None]) -> None:
        """Write the mapped objects; `data` is at least `size` bytes."""
        write = self._dictionary.write
        for (index, subindex), value in zip(self.mapped, self._struct.unpack_from(data), strict=True):
            try:
                write(index, subindex, value)
            except SdoAbortedError:
                refused((index, subindex), value)

    def restart(self) -> None:
        self.waiting, self.deadline = None, inf
