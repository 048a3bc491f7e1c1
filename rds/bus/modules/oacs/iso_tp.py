"""A data download over ISO 15765-2: the module's end and the host's, both over can-isotp's state machine.

Both ends are fed frames and asked for frames; the bus itself is the caller's.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from typing import TYPE_CHECKING

import can

from rds.bus.modules.oacs import codes as words
from rds.core.errors import MachineError

if TYPE_CHECKING:
    import isotp

LONGEST = 512  # bytes of a download that a host takes
_TIMEOUT = 1000  # ms until a partner that says nothing is given up: N_Bs and N_Cr of ISO 15765-2


class _End:
    """One end: frames in by `feed`, frames out by `pump`."""

    def __init__(self, sends: int, hears: int):
        import isotp  # 0.1 s: only for who downloads

        self._in: deque[isotp.CanMessage] = deque()
        self._out: list[bytes] = []
        self.problem: str | None = None
        self._hears = hears
        self._make = isotp.CanMessage
        parameters = {
            "tx_padding": 0,  # the dialect's frames have 8 bytes
            "tx_data_min_length": 8,
            "max_frame_size": LONGEST,
            "blocksize": 0,
            "stmin": 0,
            "rx_flowcontrol_timeout": _TIMEOUT,
            "rx_consecutive_frame_timeout": _TIMEOUT,
            "logger_name": __name__,
        }
        self._layer = isotp.TransportLayerLogic(
            rxfn=self._next,
            txfn=lambda message: self._out.append(bytes(message.data)),
            address=isotp.Address(isotp.AddressingMode.Normal_11bits, txid=sends, rxid=hears),
            error_handler=self._note,
            params=parameters,
        )
        logging.getLogger(__name__).setLevel(logging.ERROR)  # what goes wrong is raised by us, in our words

    def _next(self, timeout: float) -> isotp.CanMessage | None:
        return self._in.popleft() if self._in else None

    def _note(self, error: Exception) -> None:
        self.problem = str(error) or type(error).__name__

    def feed(self, data: bytes | bytearray) -> None:
        """A frame from the other end."""
        self._in.append(self._make(arbitration_id=self._hears, data=bytes(data), dlc=len(data)))

    def pump(self) -> list[bytes]:
        """Go on as far as possible; return the frames to send now."""
        self._layer.process()
        frames, self._out[:] = list(self._out), []
        return frames


class Sender(_End):
    """The module's end."""

    def __init__(self, node: int):
        super().__init__(words.DOWNLOAD + node, words.FLOW + node)

    def start(self, payload: bytes) -> list[bytes]:
        """Send `payload`, from its beginning even if another download was under way; return the first frame."""
        self._layer.reset()
        self._in.clear()
        self._out.clear()
        self._layer.send(payload)
        return self.pump()

    @property
    def waiting(self) -> bool:
        """Whether a download is under way, so that pump() has to be called now and then."""
        return self._layer.transmitting()


class Receiver(_End):
    """The host's end."""

    def __init__(self, node: int):
        super().__init__(words.FLOW + node, words.DOWNLOAD + node)

    def result(self) -> bytes | None:
        """The whole payload, once it is here."""
        payload = self._layer.recv()
        return None if payload is None else bytes(payload)


def fetch(bus: can.BusABC, node: int, request: can.Message, timeout: float = 1.0) -> bytes:
    """Send `request`, take the download that answers it, and return its bytes; frames of others are passed over.

    Raises MachineError if it is not whole within `timeout` s; CanError goes to the caller.
    """
    receiver = Receiver(node)
    wanted = words.DOWNLOAD + node
    bus.send(request, 0.5)
    heard = False
    deadline = time.monotonic() + timeout
    while (left := deadline - time.monotonic()) > 0:
        message = bus.recv(min(left, 0.05))
        if message is not None and message.arbitration_id == wanted and not message.is_extended_id:
            heard = True
            receiver.feed(message.data)
        for data in receiver.pump():
            bus.send(can.Message(arbitration_id=words.FLOW + node, is_extended_id=False, data=data), 0.5)
        payload = receiver.result()
        if payload is not None:
            return payload
    if not heard:
        raise MachineError(
            f"nobody answers with this number: nothing came within {timeout:g} s; `rds scan` shows who is "
            "there, and in which dialect: check channel, power and cable"
        )
    why = receiver.problem or "a part is missing"
    raise MachineError(
        f"the data download is not whole after {timeout:g} s ({why}); ask again (`rds scan` shows who is there, and in "
        "which dialect)"
    )
