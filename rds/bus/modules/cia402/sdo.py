"""The drive's SDO server: canopen's, over our dictionary, refusing what it lets pass or trips over."""

# mypy: allow-untyped-calls
# canopen's server, which this one is, has no types
from __future__ import annotations

from collections.abc import Callable
from typing import Any

from canopen.objectdictionary.datatypes import NUMBER_TYPES
from canopen.sdo import SdoAbortedError, SdoServer
from canopen.sdo.constants import (
    EXPEDITED,
    NO_MORE_DATA,
    REQUEST_BLOCK_DOWNLOAD,
    REQUEST_BLOCK_UPLOAD,
    SDO_STRUCT,
    SIZE_SPECIFIED,
)

from rds.bus.modules.cia402.codes import Abort
from rds.bus.modules.cia402.dictionary import Dictionary
from rds.bus.modules.cia402.sdo_block import BlockTransfers

_LONGEST = 1 << 10  # bytes in a segmented download; no object of ours is longer
_PATIENCE = 2.0  # s between two frames of a block; then the client that began it has gone


class _Out:
    """The part of a canopen.Network that an SDO server uses."""

    def __init__(self, send: Callable[[int, bytes], None]):
        self._send = send

    def send_message(self, can_id: int, data: bytes) -> None:
        self._send(can_id, bytes(data))


class Server(SdoServer):
    """Serves `dictionary` as node `node`; answers leave through `send(identifier, data)`. No thread, no bus."""

    network: Any
    _buffer: Any

    def __init__(self, node: int, dictionary: Dictionary, send: Callable[[int, bytes], None]):
        super().__init__(0x600 + node, 0x580 + node, dictionary)  # which stands in for a canopen node
        self.network = _Out(send)
        self._dictionary = dictionary
        self._index = self._subindex = 0
        self._heard = 0.0  # s, the last request
        self._blocks = BlockTransfers(dictionary, lambda answer: send(0x580 + node, answer))

    def on_request(self, can_id: int, data: bytes, timestamp: float) -> None:
        """Answer a request of the instant `timestamp`, s. A frame of a wrong length is none.

        While segments of a block are expected, every frame is one. So a client that ended in the middle of its block
        would leave the server deaf: a block without a frame for `_PATIENCE` is forgotten.
        """
        if len(data) != 8:
            return
        if timestamp - self._heard > _PATIENCE:
            self._blocks.end()
        self._heard = timestamp
        if self._blocks.busy or data[0] & 0xE0 in (REQUEST_BLOCK_UPLOAD, REQUEST_BLOCK_DOWNLOAD):
            self._index, self._subindex = int.from_bytes(data[1:3], "little"), data[3]
            try:
                if self._blocks.take(bytes(data)):
                    return
            except SdoAbortedError as error:
                self.abort(error.code)
                return
            self._blocks.end()  # another request ends it
        super().on_request(can_id, bytearray(data), timestamp)

    def init_download(self, request: bytearray) -> None:
        """As canopen's, but what can't be written is refused before its segments come.

        A client may leave out how many of the four bytes it sends; then the object's type says so.
        """
        command, self._index, self._subindex = SDO_STRUCT.unpack_from(request)
        variable = self._dictionary.check_writable(self._index, self._subindex)
        if command & EXPEDITED and not command & SIZE_SPECIFIED and variable.data_type in NUMBER_TYPES:
            request[0] |= SIZE_SPECIFIED | max(0, 4 - len(variable) // 8) << 2
        super().init_download(request)
        if command & EXPEDITED:
            self._buffer = None

    def segmented_download(self, command: int, request: bytearray) -> None:
        """A segment without a transfer, or of an endless one, is refused."""
        self._check_transfer()
        if len(self._buffer) > _LONGEST:
            self._buffer = None
            raise SdoAbortedError(Abort.TOO_LONG)
        super().segmented_download(command, request)
        if command & NO_MORE_DATA:
            self._buffer = None

    def segmented_upload(self, command: int) -> None:
        """A segment without a transfer is refused."""
        self._check_transfer()
        super().segmented_upload(command)
        self._buffer = self._buffer or None

    def request_aborted(self, data: bytearray) -> None:
        """The client has given up."""
        self._buffer = None
        super().request_aborted(data)

    def abort(self, abort_code: int = Abort.GENERAL) -> None:
        """Say why not, and forget the transfer."""
        self._buffer = None
        self._blocks.end()
        super().abort(abort_code)

    def _check_transfer(self) -> None:
        if self._buffer is None:
            raise SdoAbortedError(Abort.COMMAND)
