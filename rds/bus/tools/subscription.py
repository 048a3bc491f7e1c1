"""What a receiver has for one of its readers: a bounded queue of frames."""

from __future__ import annotations

from collections.abc import Callable
from queue import Empty, SimpleQueue

import can


class Subscription:
    """A reader's queue of at most `limit` frames; made by `Receiver.subscribe`.

    `lost` counts the frames that found it full. `wake` is called (in the receiver's thread) when a frame comes into an
    empty queue, and at the end.
    """

    def __init__(self, name: str, limit: int, wake: Callable[[], object] | None = None):
        self.name = name
        self.limit = limit
        self.lost = 0
        self.closed = False
        self._queue: SimpleQueue[can.Message | None] = SimpleQueue()
        self._wake = wake
        self._overflowing = False
        self._over = False  # the None that ends the queue was taken

    def get(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, or None if none came within `timeout` s (None: ever) or the subscription has ended."""
        try:
            message = None if self._over else self._queue.get(timeout=timeout)
        except Empty:
            return None
        self._over = message is None
        return message

    @property
    def ended(self) -> bool:
        """Whether nothing more will come and everything was taken."""
        return self._over or (self.closed and self.waiting == 0)

    @property
    def waiting(self) -> int:
        """How many frames wait."""
        return max(0, self._queue.qsize() - self.closed)  # the last thing in a closed queue is no frame

    def put(self, message: can.Message) -> bool:
        """For the receiver: add a frame, or count it as lost. True when this loss is the first of a series."""
        waiting = self._queue.qsize()
        if waiting >= self.limit:
            self.lost += 1
            first, self._overflowing = not self._overflowing, True
            return first
        if self._overflowing and waiting <= self.limit // 2:
            self._overflowing = False
        self._queue.put(message)
        if waiting == 0 and self._wake is not None:
            self._wake()
        return False

    def close(self) -> None:
        """For the receiver: nothing more will come; what waits stays readable."""
        if self.closed:
            return
        self._queue.put(None)
        self.closed = True
        if self._wake is not None:
            self._wake()
