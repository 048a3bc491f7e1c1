"""An emulated serial CAN adapter (slcan, Lawicel's protocol) at a pseudo-terminal, in front of any bus.

Programs open it as they open the real one, and what goes wrong with real ones can be had on purpose: the latency timer
of a USB chip, a line that garbles, a plug that is pulled. Not on Windows, which has no pseudo-terminals.
"""

from __future__ import annotations

import contextlib
import os
import random
import threading
import time
from types import TracebackType

import can

from rds.core.errors import InputError

_OK, _ERROR = b"\r", b"\a"
_LOOK = 0.05  # s between two looks at whether it shall end
_BITRATES = {b"S0": 10_000, b"S1": 20_000, b"S2": 50_000, b"S3": 100_000, b"S4": 125_000, b"S5": 250_000}
_BITRATES |= {b"S6": 500_000, b"S7": 750_000, b"S8": 1_000_000}
_QUARTZ = 8_000_000  # Hz: time quanta of one, the half of 16 MHz
_ENDS = b"\r"
_LONGEST = 64  # bytes of a command
_ON_THE_WIRE = 0.1  # s that a frame may take until the bus has it


class SlcanAdapter:
    """Serves `bus` at the pseudo-terminal `path` from entering the context to leaving it.

    `latency` (s): frames for the computer wait up to so long, as in a USB chip that collects bytes; `garble`: the share
    of frames for the computer in which one character is another one, by `seed`. `bus_bitrate` (bit/s): what the bus
    has, where that is known; told another one, the adapter hears nothing, and what it sends nobody acknowledges.
    `gives_back`: `bus` gives back what it has sent, marked as such; then frames keep their order, as in real adapters,
    and don't overtake each other in a controller that sends by priority.
    """

    def __init__(
        self,
        bus: can.BusABC,
        latency: float = 0.0,
        garble: float = 0.0,
        seed: int = 1,
        bus_bitrate: int | None = None,
        gives_back: bool = False,
    ):
        try:
            import pty
            import tty
        except ImportError:
            raise InputError("this system has no pseudo-terminals; emulated serial adapters need one") from None
        self._bus, self._latency, self._garble = bus, latency, garble
        self._chance, self._bus_bitrate = random.Random(seed), bus_bitrate
        self._gives_back, self._sent = gives_back, threading.Event()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self.bitrate: int | None = None  # that the computer has asked for, bit/s
        self.is_open = False
        self.only_listens = False
        self._ended = threading.Event()
        self._write_lock = threading.Lock()
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._serve, self._forward)]

    def __enter__(self) -> SlcanAdapter:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Pull the plug: programs that have it open lose it."""
        if self._ended.is_set():
            return
        self._ended.set()
        with contextlib.suppress(OSError):
            os.close(self._slave)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()
        os.close(self._master)

    def alive(self) -> bool:
        """Whether it still serves."""
        return all(thread.is_alive() for thread in self._threads)

    @property
    def takes_part(self) -> bool:
        """Whether frames go through it: it is open, and not at another bit rate than the bus."""
        return self.is_open and self._bus_bitrate in (None, self.bitrate)

    def _serve(self) -> None:
        """What the computer says: lines that end in a carriage return."""
        import select

        pending = b""
        while not self._ended.is_set():
            if not select.select([self._master], [], [], _LOOK)[0]:
                continue
            try:
                pending += os.read(self._master, 4096)
            except OSError:
                return
            while _ENDS in pending:
                line, _, pending = pending.partition(_ENDS)
                self._say(self._obey(line))
            pending = pending[-_LONGEST:]

    def _obey(self, line: bytes) -> bytes:
        if line in _BITRATES:
            self.bitrate = _BITRATES[line]
            return _OK
        if line[:1] == b"s" and (rate := _rate_of_registers(line[1:])) is not None:
            self.bitrate = rate
            return _OK
        if line in (b"O", b"L", b"C"):
            self.is_open, self.only_listens = line != b"C", line == b"L"
            return _OK
        if line == b"V":
            return b"V1013" + _OK
        if line == b"N":
            return b"NRDS0" + _OK
        if line == b"F":
            return b"F00" + _OK
        if line[:1] in (b"t", b"T", b"r", b"R") and self.takes_part and not self.only_listens:
            message = _decode(line)
            if message is not None:
                with contextlib.suppress(can.CanError, OSError):
                    self._sent.clear()
                    self._bus.send(message, _ON_THE_WIRE)
                    if self._gives_back and not self._sent.wait(_ON_THE_WIRE):
                        return _ERROR
                    return (b"Z" if message.is_extended_id else b"z") + _OK
        return _OK if not line or line[:1] in (b"Z", b"X") else _ERROR

    def _forward(self) -> None:
        """What comes over the bus."""
        while not self._ended.is_set():
            try:
                message = self._hear(_LOOK)
            except (can.CanError, OSError):
                return
            if message is None:
                continue
            lines = [message]
            if self._latency:
                until = time.monotonic() + self._latency
                while (left := until - time.monotonic()) > 0 and not self._ended.is_set():
                    more = self._hear(left)
                    if more is not None:
                        lines.append(more)
            if self.takes_part:
                self._say(b"".join(self._disturbed(_encode(line)) for line in lines))

    def _hear(self, seconds: float) -> can.Message | None:
        """A frame of somebody else on the bus, within so long; None if there was none."""
        message = self._bus.recv(seconds)
        if message is None or message.is_error_frame or message.is_fd:
            return None
        if not message.is_rx:
            self._sent.set()
            return None
        return message

    def _disturbed(self, line: bytes) -> bytes:
        if self._garble and self._chance.random() < self._garble:
            place = self._chance.randrange(1, len(line) - 1)
            return line[:place] + b"?" + line[place + 1 :]
        return line

    def _say(self, answer: bytes) -> None:
        with self._write_lock, contextlib.suppress(OSError):
            os.write(self._master, answer)


def _rate_of_registers(digits: bytes) -> int | None:
    """The bit rate of the registers BTR0 and BTR1 of an SJA1000 at 16 MHz, four hexadecimal digits; None for others."""
    try:
        btr0, btr1 = bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        return None
    quanta = 3 + (btr1 & 0x0F) + (btr1 >> 4 & 0x07)  # of a bit: its first, and those before and after the sample
    return round(_QUARTZ / (((btr0 & 0x3F) + 1) * quanta))


def _encode(message: can.Message) -> bytes:
    letter, digits = ("t", 3) if not message.is_extended_id else ("T", 8)
    if message.is_remote_frame:
        letter = "r" if letter == "t" else "R"
    data = "" if message.is_remote_frame else bytes(message.data).hex().upper()
    return f"{letter}{message.arbitration_id:0{digits}X}{message.dlc}{data}\r".encode()


def _decode(line: bytes) -> can.Message | None:
    extended = line[:1] in (b"T", b"R")
    digits = 8 if extended else 3
    try:
        identifier, size = int(line[1 : 1 + digits], 16), int(line[1 + digits : 2 + digits])
        data = bytes.fromhex(line[2 + digits :].decode("ascii"))
    except ValueError:
        return None
    is_remote = line[:1] in (b"r", b"R")
    if size > 8 or identifier > (0x1FFFFFFF if extended else 0x7FF) or len(data) != (0 if is_remote else size):
        return None
    return can.Message(
        arbitration_id=identifier, is_extended_id=extended, is_remote_frame=is_remote, dlc=size, data=data
    )
