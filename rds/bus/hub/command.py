"""Who commands a channel of the built-in bus: one run at a time, so that two never drive the same axes."""

from __future__ import annotations

import contextlib
import os
import sys
import time

from rds.bus.hub.address import lock_file
from rds.bus.hub.runtime_folder import runtime_directory
from rds.core.errors import MachineError

_LONGEST = 400  # bytes of a holder's name
_LOOKS = 0.2  # s in which one who only looks whether somebody commands (`commanded`) has given it back
_YOUNG = 60.0  # s: a file may just have been made, and its lock not yet taken


class Command:
    """The command of a channel, held from acquire() to release() or the end of the process."""

    def __init__(self, channel: str):
        self.channel = channel
        self._path = runtime_directory() / f"{channel}.command"
        self._descriptor: int | None = None

    def acquire(self) -> bool:
        """Take the command; False if another run has it."""
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
            try:
                lock_file(descriptor)
            except OSError:
                os.close(descriptor)
                return False
            with contextlib.suppress(OSError):
                if os.fstat(descriptor).st_ino == self._path.stat().st_ino:
                    self._descriptor = descriptor
                    os.truncate(descriptor, 0)
                    os.write(descriptor, f"process {os.getpid()} ({' '.join(sys.orig_argv)})".encode()[:_LONGEST])
                    return True
            os.close(descriptor)  # the holder before took this file away

    def holder(self) -> str:
        """Who has the command, for people: its process and command line."""
        try:
            return self._path.read_text(errors="replace") or "a process that does not say its name"
        except OSError:  # it has just gone, or the system keeps locked files to itself
            return "a process that can't be told"

    def release(self) -> None:
        """Give the command back."""
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                self._path.unlink()
            os.close(self._descriptor)
            self._descriptor = None

    def __enter__(self) -> Command:
        end = time.monotonic() + _LOOKS
        while not self.acquire():
            if time.monotonic() > end:
                raise MachineError(
                    f"another run commands the machine on channel {self.channel!r}: {self.holder()}; wait, or stop it"
                )
            time.sleep(_LOOKS / 100.0)
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def commanded(channel: str) -> bool:
    """Whether a run commands the channel now."""
    command = Command(channel)
    free = command.acquire()
    command.release()
    return not free


def remove_left() -> None:
    """Remove the files of runs that were killed while they commanded a channel; that of a living one is locked."""
    for path in runtime_directory().glob("*.command"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > _YOUNG:
                commanded(path.stem)
