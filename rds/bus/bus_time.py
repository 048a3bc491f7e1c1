"""Bus time: what a node on a bus goes by."""

from __future__ import annotations

import time


class BusTime:
    """Bus time from time stamps: from frame to frame it never goes back, and between goes on by the local clock. In s.

    A stamp's clock may be stepped (some interfaces stamp with the wall clock); then time goes on from where it was.
    To ask for the time now changes nothing: a frame that is still under way may have been stamped before.
    """

    def __init__(self) -> None:
        self._last = time.time()
        self._shift = 0.0  # bus time less stamp
        self._offset = self._last - time.monotonic()  # bus time less local clock

    def at(self, stamp: float) -> float:
        """The bus time of a frame stamped `stamp`, which has just been received; a stamp of 0 means none."""
        if not stamp:
            return self.now()
        instant = stamp + self._shift
        if instant < self._last:
            self._shift += self._last - instant
            instant = self._last
        self._last = instant
        self._offset = instant - time.monotonic()
        return instant

    def now(self) -> float:
        """The bus time now."""
        return max(self._last, time.monotonic() + self._offset)
