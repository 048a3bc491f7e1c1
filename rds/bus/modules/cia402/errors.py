"""What the drive remembers and says of its errors: register 0x1001, history 0x1003, error code 0x603F, EMCY."""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct
from typing import Any

from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402.codes import Abort, error_register_bits
from rds.bus.modules.cia402.dictionary import Dictionary

_EMERGENCY = Struct("<HB5x")  # error code, error register, nothing of our own (CiA 301, 7.2.7)
_HISTORY = 8
_INVALID = 1 << 31


class Errors:
    """The errors of a drive; emergency messages leave through `send(identifier, data)`."""

    def __init__(self, dictionary: Dictionary, send: Callable[[int, bytes], None]):
        self._dictionary, self._send = dictionary, send
        self._history: list[int] = []
        dictionary.readers[0x1003, 0] = lambda: len(self._history)
        dictionary.writers[0x1003, 0] = self._forget

    def report(self, code: int) -> None:
        """A new error: remember it and send the emergency message."""
        values = self._dictionary.values
        values[0x1001, 0] |= error_register_bits(code)
        values[0x603F, 0] = code
        self._history = [code, *self._history][:_HISTORY]
        self._show()
        self._tell(code)

    def clear(self) -> None:
        """No error is left: say so once. The history stays."""
        values = self._dictionary.values
        if values[0x1001, 0]:
            values[0x1001, 0] = values[0x603F, 0] = 0
            self._tell(0)

    def restore(self) -> None:
        """Show what is remembered after the objects have been reset."""
        self._show()
        if code := self._dictionary[0x603F]:
            self._dictionary.values[0x1001, 0] = error_register_bits(code)

    def _tell(self, code: int) -> None:
        identifier = self._dictionary.values[0x1014, 0]
        if not identifier & _INVALID:
            self._send(identifier & 0x7FF, _EMERGENCY.pack(code, self._dictionary.values[0x1001, 0]))

    def _forget(self, value: Any) -> None:
        if value != 0:
            raise SdoAbortedError(Abort.VALUE)
        self._history = []
        self._show()

    def _show(self) -> None:
        for place in range(_HISTORY):
            self._dictionary.values[0x1003, place + 1] = self._history[place] if place < len(self._history) else 0
