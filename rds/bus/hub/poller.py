"""Waiting for sockets: epoll where there is one, else `select` behind the same four methods."""

from __future__ import annotations

import select
import time
from typing import Protocol

READ, WRITE, ERROR, HANGUP = 1, 4, 8, 16  # as in <sys/poll.h> and <sys/epoll.h>
_LONGEST_WAIT = 86400.0  # s


class Poller(Protocol):
    """What the hub and the machine's server use."""

    def register(self, fd: int, eventmask: int) -> None: ...
    def modify(self, fd: int, eventmask: int) -> None: ...
    def unregister(self, fd: int) -> None: ...
    def poll(self, timeout: float | None = None) -> list[tuple[int, int]]: ...
    def sleep(self, timeout: float) -> None: ...
    def close(self) -> None: ...


def make_poller() -> Poller:
    """The best that the system has."""
    return EpollPoller() if hasattr(select, "epoll") else SelectPoller()


class EpollPoller:
    """`select.epoll`, and a sleep that is exact to the µs."""

    def __init__(self) -> None:
        self._epoll = select.epoll()
        self._itself = [self._epoll.fileno()]
        self._exact = self._itself[0] < 1024  # select() knows no higher descriptors
        self.register, self.modify = self._epoll.register, self._epoll.modify
        self.unregister, self.poll, self.close = self._epoll.unregister, self._epoll.poll, self._epoll.close

    def sleep(self, timeout: float) -> None:
        """Wait up to `timeout` s, or until something is ready."""
        if self._exact:
            select.select(self._itself, [], [], timeout)
        else:
            self._epoll.poll(int(timeout * 1000.0) / 1000.0)


class SelectPoller:
    """`select.select` with epoll's methods. It reports no ERROR or HANGUP: reading tells."""

    def __init__(self) -> None:
        self._masks: dict[int, int] = {}

    def register(self, fd: int, eventmask: int) -> None:
        """Watch `fd` for the events in the mask."""
        self._masks[fd] = eventmask

    modify = register

    def unregister(self, fd: int) -> None:
        """Watch `fd` no more."""
        del self._masks[fd]

    def poll(self, timeout: float | None = None) -> list[tuple[int, int]]:
        """Wait up to `timeout` s (None: for ever); return (fd, events) of those that are ready."""
        reading = [fd for fd, mask in self._masks.items() if mask & READ]
        writing = [fd for fd, mask in self._masks.items() if mask & WRITE]
        if not reading and not writing:  # Windows refuses to wait for nothing
            time.sleep(_LONGEST_WAIT if timeout is None else timeout)
            return []
        readable, writable, _ = select.select(reading, writing, [], timeout)
        ready = dict.fromkeys(readable, READ)
        for fd in writable:
            ready[fd] = ready.get(fd, 0) | WRITE
        return list(ready.items())

    def sleep(self, timeout: float) -> None:
        """Wait up to `timeout` s, or until something is ready."""
        self.poll(timeout)

    def close(self) -> None:
        """Forget everything."""
        self._masks.clear()
