"""The host's end of the line: a serial port through pyserial, the pseudo-terminal of a served machine, or virtual time.

A served machine's pseudo-terminal is a link in the user's runtime folder, by the name of its channel. What looks like a
path, or like COM3, is a real port.
"""

from __future__ import annotations

import os
import re
import select
import time
from math import inf
from pathlib import Path
from typing import Protocol

from rds.bus.hub.address import lock_file
from rds.bus.hub.bus_settings import BAUD
from rds.bus.hub.runtime_folder import runtime_directory
from rds.bus.modules.dcs.line import FieldLine
from rds.core.channel_name import CHANNEL
from rds.core.errors import InputError, MachineError

SUFFIX, LOCK = ".tty", ".tty-lock"
_POLL = 1e-3  # s between two looks, where a port cannot be waited for
_WRITING = 5.0  # s for a buffer of 1500 bytes to go out, and more


class Port(Protocol):
    """Bytes out, bytes in, and a clock."""

    def now(self) -> float:
        """The instant now, s."""

    def sleep(self, until: float) -> None:
        """Wait until that instant; bytes that come meanwhile are kept."""

    def write(self, data: bytes) -> None:
        """Send bytes. MachineError if the port fails."""

    def read(self, timeout: float) -> bytes:
        """What has come, waiting for the first byte at most so many s; nothing if none came."""

    def close(self) -> None:
        """Let go of it."""


def is_device(channel: str) -> bool:
    """Whether a channel is a real serial port, and not the name of a served machine."""
    return "/" in channel or "\\" in channel or bool(re.fullmatch(r"(?i)com\d+", channel))


def link_of(channel: str) -> Path:
    """Where the pseudo-terminal of a channel is linked. InputError for a name that none can have."""
    if not CHANNEL.fullmatch(channel):
        raise InputError(
            f"channel {channel!r} must be a serial port (/dev/ttyUSB0, COM3) or the name of a served machine: 1 to 32 "
            "letters, digits, '.', '_' and '-', the first a letter or digit"
        )
    return runtime_directory() / (channel + SUFFIX)


def is_there(channel: str) -> bool:
    """Whether a port, or a served machine, is there.

    The link of a server that was killed is taken away: its terminal's name may be another program's by now.
    """
    if is_device(channel):
        return os.name != "posix" or Path(channel).exists()
    link = link_of(channel)
    if not link.is_symlink():
        return False
    lock = os.open(link.with_suffix(LOCK), os.O_RDWR | os.O_CREAT, 0o600)
    try:
        lock_file(lock)
    except OSError:  # its server lives
        return link.exists()
    finally:
        os.close(lock)
    link.unlink(missing_ok=True)
    return False


class LineTaken(MachineError):
    """Another host has the port."""


class SerialPort:
    """A port that this host alone has, unless `alone` is false: an emergency stop goes between another host's bytes.

    MachineError if it is not there; LineTaken if another host has it.
    """

    def __init__(self, channel: str, baud: float, *, alone: bool = True):
        import serial

        baud = BAUD.check(baud, "baud")
        path = channel if is_device(channel) else str(link_of(channel))
        if not is_there(channel):
            start = "connect it" if is_device(channel) else f"start the machine (rds machine serve {channel})"
            raise MachineError(f"there is no serial line {channel}; {start}, or check [bus] channel")
        try:
            self._serial = serial.Serial(
                os.path.realpath(path) if not is_device(channel) else path,
                int(baud),
                timeout=0,
                write_timeout=_WRITING,
                **({"exclusive": alone} if os.name == "posix" else {}),
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            busy = "exclusively lock" in str(error) or "Access is denied" in str(error)
            why = "another host commands it; stop that one" if busy else f"{error}; check channel and rights"
            kind = LineTaken if busy and alone else MachineError
            raise kind(f"serial line {channel} can't be opened: {why}") from error
        self._descriptor = self._serial.fileno() if os.name == "posix" else -1

    def now(self) -> float:
        """This computer's monotonic clock."""
        return time.monotonic()

    def sleep(self, until: float) -> None:
        """As Port."""
        time.sleep(max(0.0, until - time.monotonic()))

    def write(self, data: bytes) -> None:
        """As Port."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise MachineError(f"the serial line failed: {error}") from error

    def read(self, timeout: float) -> bytes:
        """As Port."""
        try:
            if self._descriptor >= 0:
                if not select.select([self._descriptor], [], [], max(0.0, timeout))[0]:
                    return b""
                return bytes(self._serial.read(4096))
            deadline = time.monotonic() + timeout
            while not self._serial.in_waiting and time.monotonic() < deadline:
                time.sleep(_POLL)
            return bytes(self._serial.read(self._serial.in_waiting))
        except OSError as error:
            raise MachineError(f"the serial line failed: {error}; is the machine still there?") from error

    def close(self) -> None:
        """As Port."""
        self._serial.close()


class VirtualPort:
    """A line in virtual time: waiting costs none. `latency` is what a slow host takes to hear of a byte, s."""

    def __init__(self, line: FieldLine, latency: float = 0.0):
        self.line, self._latency, self._now = line, latency, 0.0
        self._kept = b""

    def now(self) -> float:
        """The virtual instant."""
        return self._now

    def sleep(self, until: float) -> None:
        """As Port."""
        if until > self._now:
            self._kept += self.line.advance(until)
            self._now = until

    def write(self, data: bytes) -> None:
        """As Port."""
        self.line.write(data, self._now)

    def read(self, timeout: float) -> bytes:
        """As Port."""
        deadline = self._now + max(0.0, timeout)
        while not self._kept:
            due = self.line.due
            self._now = min(max(due, self._now), deadline)
            self._kept = self.line.advance(self._now)
            if self._now >= deadline or due == inf:
                self._now = deadline if not self._kept else self._now
                break
        found, self._kept = self._kept, b""
        if found and self._latency:
            self.sleep(self._now + self._latency)
        return found

    def close(self) -> None:
        """Nothing to let go of."""
