"""SDO block transfer, the server's side: up to 127 segments for one confirmation. CiA 301, 7.2.4.3.9 to 7.2.4.3.16."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable
from enum import Enum, auto

from canopen.sdo import SdoAbortedError
from canopen.sdo.constants import SDO_STRUCT

from rds.bus.modules.cia402.codes import Abort
from rds.bus.modules.cia402.dictionary import Dictionary

_SEGMENT = 7  # bytes
_MOST = 127  # segments in a block
_LONGEST = 1 << 10  # bytes of a download; no object of ours is longer
_UPLOAD, _DOWNLOAD, _CODE = 0xA0, 0xC0, 0xE0  # commands of the client
_LAST = 0x80  # in a segment's first byte
_CRC, _SIZE = 0x04, 0x02


class _State(Enum):
    IDLE = auto()
    READY = auto()  # an upload is confirmed, and waits for its start
    SENDING = auto()
    SENT = auto()  # its end is said
    RECEIVING = auto()
    RECEIVED = auto()  # the last segment is there, its end is not said yet


class BlockTransfers:
    """Takes requests of block transfers of `dictionary`; answers leave through `send`."""

    def __init__(self, dictionary: Dictionary, send: Callable[[bytes], None]):
        self._dictionary, self._send = dictionary, send
        self.end()

    def end(self) -> None:
        """Forget a transfer under way."""
        self._state = _State.IDLE
        self._data = bytearray()
        self._index = self._subindex = 0
        self._at = 0  # bytes that the client has confirmed
        self._block = _MOST  # segments in a block
        self._in_block = 0  # segments that this block has
        self._crc = False

    @property
    def busy(self) -> bool:
        """Whether the next frame belongs to a transfer under way."""
        return self._state is not _State.IDLE

    def take(self, request: bytes) -> bool:
        """Take a request; whether it was one of block transfer. SdoAbortedError for what cannot be."""
        if self._state is _State.RECEIVING and request[0] != 0x80:
            self._segment(request)
            return True
        code, command, ends = request[0] & _CODE, request[0] & 3, request[0] & 1
        if code == _UPLOAD and command == 0:
            self._begin_upload(request)
        elif code == _DOWNLOAD and not ends and self._state is not _State.RECEIVED:
            self._begin_download(request)
        elif code == _UPLOAD and self._state in (_State.READY, _State.SENDING, _State.SENT):
            self._go_on(command, request)
        elif code == _DOWNLOAD and ends and self._state is _State.RECEIVED:
            self._finish(request)
        elif code in (_UPLOAD, _DOWNLOAD):
            raise SdoAbortedError(Abort.COMMAND)
        else:
            return False
        return True

    # --- upload

    def _begin_upload(self, request: bytes) -> None:
        command, self._index, self._subindex = SDO_STRUCT.unpack_from(request)
        self._set_block(request[4])
        self._data = bytearray(self._dictionary.get_data(self._index, self._subindex, check_readable=True))
        self._at, self._in_block, self._crc, self._state = 0, 0, bool(command & _CRC), _State.READY
        head = SDO_STRUCT.pack(0xC0 | _CRC | _SIZE, self._index, self._subindex)
        self._send(head + len(self._data).to_bytes(4, "little"))

    def _go_on(self, command: int, request: bytes) -> None:
        if command == 3 and self._state is _State.READY:
            self._state = _State.SENDING
            self._send_block()
        elif command == 2 and self._state is _State.SENDING:
            if request[1] > self._in_block:
                raise SdoAbortedError(Abort.SEQUENCE)
            self._at += _SEGMENT * request[1]
            self._set_block(request[2])
            if self._at < len(self._data):
                self._send_block()
                return
            unused = -len(self._data) % _SEGMENT
            crc = crc_hqx(bytes(self._data), 0) if self._crc else 0
            self._state = _State.SENT
            self._send(bytes([0xC1 | unused << 2]) + crc.to_bytes(2, "little") + bytes(5))
        elif command == 1 and self._state is _State.SENT:
            self.end()
        else:
            raise SdoAbortedError(Abort.COMMAND)

    def _send_block(self) -> None:
        rest = self._data[self._at : self._at + _SEGMENT * self._block]
        self._in_block = -(-len(rest) // _SEGMENT)
        for number in range(self._in_block):
            part = bytes(rest[number * _SEGMENT : (number + 1) * _SEGMENT])
            is_last = self._at + (number + 1) * _SEGMENT >= len(self._data)
            self._send(bytes([(_LAST if is_last else 0) | number + 1]) + part.ljust(_SEGMENT, b"\0"))

    def _set_block(self, size: int) -> None:
        if not 1 <= size <= _MOST:
            raise SdoAbortedError(Abort.BLOCK_SIZE)
        self._block = size

    # --- download

    def _begin_download(self, request: bytes) -> None:
        command, self._index, self._subindex = SDO_STRUCT.unpack_from(request)
        self._dictionary.check_writable(self._index, self._subindex)
        if command & _SIZE and int.from_bytes(request[4:8], "little") > _LONGEST:
            raise SdoAbortedError(Abort.TOO_LONG)
        self._data, self._in_block, self._crc = bytearray(), 0, bool(command & _CRC)
        self._block, self._state = _MOST, _State.RECEIVING
        self._send(SDO_STRUCT.pack(0xA0 | _CRC, self._index, self._subindex) + bytes([_MOST, 0, 0, 0]))

    def _segment(self, request: bytes) -> None:
        number, is_last = request[0] & 0x7F, bool(request[0] & _LAST)
        fits = number == self._in_block + 1
        if fits:
            self._data += request[1:8]
            self._in_block = number
            if len(self._data) > _LONGEST + _SEGMENT:
                raise SdoAbortedError(Abort.TOO_LONG)
        if is_last or number == self._block:  # what is missing comes again
            self._send(bytes([0xA2, self._in_block, _MOST]) + bytes(5))
            self._in_block = 0
            if is_last and fits:
                self._state = _State.RECEIVED

    def _finish(self, request: bytes) -> None:
        data = bytes(self._data[: len(self._data) - (request[0] >> 2 & 7)])
        if self._crc and crc_hqx(data, 0) != int.from_bytes(request[1:3], "little"):
            raise SdoAbortedError(Abort.CRC)
        self._dictionary.set_data(self._index, self._subindex, data, check_writable=True)
        self.end()
        self._send(bytes([0xA1]) + bytes(7))
