"""A receiver that cannot die silently.

One thread reads a bus and hands every frame to each subscriber's bounded queue. Whatever `recv()` or a subscriber
raises, either the receiver goes on or `on_error` was called:

- the bus fails (error, bus off, closed, hub killed): reported once for the outage, then it is opened again, first
  after 0.05 s, then after twice as long each time, up to 2 s, for as long as it takes. The outage is over when the bus
  has worked for a second; `on_recovery` is called then, and a later failure is reported anew;
- a subscriber's function raises: reported once; that subscriber gets nothing more, the others go on;
- a subscriber is too slow: reported when its queue overflows, again only after it had caught up to half;
- the receiving thread itself ends without being asked to: reported, `alive()` is false.

Each report also goes to the log, and nothing that `on_error` raises does any harm.

Our own, because an error of the bus can end python-can's `Notifier` without a word.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import can

from rds.bus.tools.subscription import Subscription

LOG = logging.getLogger(__name__)

FIRST_PAUSE, LONGEST_PAUSE = 0.05, 2.0  # s between attempts to open the bus again
STEADY = 1.0  # s without a failure until an outage is over
LIMIT = 65536  # frames: as many as the hub of the built-in bus keeps for a node
_LOOK = 0.2  # s after which the thread looks whether it shall end, and at the bus's state


class ReceiveFault(StrEnum):
    """What went wrong."""

    BUS = "bus"
    BUS_OFF = "bus off"
    SUBSCRIBER = "subscriber"
    OVERFLOW = "overflow"
    ENDED = "ended"  # the receiver reads no more


@dataclass(frozen=True)
class Fault:
    """One report."""

    trouble: ReceiveFault
    text: str
    error: BaseException | None = None


class _BusOff(Exception):
    """The controller has left the bus after too many errors."""


class Receiver:
    """Reads the bus that `open_` opens, from start() (or `with`) to stop().

    `name` is what messages call the bus. Without `reopen`, the first failure of the bus ends the receiver.
    start() raises what `open_` raises.
    """

    def __init__(
        self,
        open_: Callable[[], can.BusABC],
        on_error: Callable[[Fault], Any],
        on_recovery: Callable[[], Any] | None = None,
        *,
        reopen: bool = True,
        name: str = "bus",
    ):
        self._open = open_
        self._on_error = on_error
        self._on_recovery = on_recovery
        self._reopen = reopen
        self._name = name
        self._bus: can.BusABC | None = None
        self._stopping = threading.Event()
        self._lock = threading.Lock()  # of the tuple of subscriptions, which the reader takes as it is
        self._subscriptions: tuple[Subscription, ...] = ()
        self._workers: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._run, name=f"receiver of {name}", daemon=True)
        self._failed_at: float | None = None  # s, monotonic; None: no outage
        self._pause = FIRST_PAUSE
        self.received = 0  # frames
        self.outages = 0

    # --- for whoever uses it

    def start(self) -> None:
        """Open the bus and begin to read."""
        self._bus = self._open()
        self._thread.start()

    def stop(self) -> None:
        """Read no more, close the bus; returns when every subscriber's function has had its frames (5 s at most)."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(5.0)
        self._close_bus()
        for worker in self._workers:
            if worker is not threading.current_thread():
                worker.join(5.0)

    def __enter__(self) -> Receiver:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def alive(self) -> bool:
        """Whether it reads, or is about to open the bus again."""
        return self._thread.is_alive()

    @property
    def bus(self) -> can.BusABC | None:
        """The open bus, for sending; None during an outage."""
        return self._bus

    def subscribe(
        self,
        function: Callable[[can.Message], Any] | None = None,
        *,
        name: str = "subscriber",
        limit: int = LIMIT,
        wake: Callable[[], object] | None = None,
    ) -> Subscription:
        """A queue of the frames from now on; with a `function`, that is called with each frame in a thread of its own.

        `limit` is how many frames may wait; those that find no place are lost to this subscriber, counted and reported.
        """
        subscription = Subscription(name, limit, wake)
        with self._lock:
            self._subscriptions += (subscription,)
        if self._thread.ident is not None and not self._thread.is_alive():
            self._forget(subscription)
        if function is not None:
            worker = threading.Thread(target=self._work, args=(subscription, function), name=name, daemon=True)
            self._workers.append(worker)
            worker.start()
        return subscription

    # --- the reading thread

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                try:
                    if self._bus is None:
                        self._bus = self._open()
                    self._read(self._bus)
                except Exception as error:
                    self._lose(error)
                    if not self._reopen:
                        break
        except BaseException as error:  # SystemExit in a driver, for one
            self._report(ReceiveFault.ENDED, f"{self._name} is read no more: {_say(error)}", error)
        finally:
            self._close_bus()
            for subscription in self._subscriptions:
                self._forget(subscription)

    def _read(self, bus: can.BusABC) -> None:
        """Hand out frames until the end; raises what the bus raises."""
        look_at = 0.0
        while not self._stopping.is_set():
            message = bus.recv(_LOOK)
            if message is not None:
                self.received += 1
                for subscription in self._subscriptions:
                    if subscription.put(message):
                        self._report(
                            ReceiveFault.OVERFLOW,
                            f"{subscription.name} is {subscription.limit} frames behind {self._name}; it loses frames",
                        )
            now = time.monotonic()
            if now >= look_at:
                look_at = now + _LOOK
                self._look(bus, now)

    def _look(self, bus: can.BusABC, now: float) -> None:
        with suppress(NotImplementedError):
            if bus.state is can.BusState.ERROR:
                raise _BusOff("bus off: too many errors, the controller has left the bus")
        if self._failed_at is not None and now - self._failed_at >= STEADY:
            self._failed_at = None
            self._pause = FIRST_PAUSE
            LOG.info("%s works again", self._name)
            if self._on_recovery is not None:
                _call(self._on_recovery)

    def _lose(self, error: Exception) -> None:
        """The bus has failed, or could not be opened: report an outage's first failure, close, wait."""
        first, self._failed_at = self._failed_at is None, time.monotonic()
        self._close_bus()
        if first:
            self.outages += 1
            trouble = ReceiveFault.BUS_OFF if isinstance(error, _BusOff) else ReceiveFault.BUS
            next_ = "it is opened again" if self._reopen else "it is read no more"
            self._report(trouble, f"{self._name} failed: {_say(error)}; {next_}", error)
        else:
            LOG.debug("%s failed again: %s", self._name, _say(error))
        if self._reopen:
            self._stopping.wait(self._pause)
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)

    def _close_bus(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except BaseException as error:  # it is broken anyway
                LOG.debug("%s could not be shut down: %s", self._name, _say(error))

    # --- subscribers

    def _work(self, subscription: Subscription, function: Callable[[can.Message], Any]) -> None:
        try:
            while not subscription.ended:
                message = subscription.get(1.0)
                if message is not None:
                    function(message)
        except BaseException as error:
            text = f"{subscription.name} failed: {_say(error)}; it gets no more frames"
            self._report(ReceiveFault.SUBSCRIBER, text, error)
        finally:
            self._forget(subscription)

    def _forget(self, subscription: Subscription) -> None:
        with self._lock:
            self._subscriptions = tuple(other for other in self._subscriptions if other is not subscription)
            subscription.close()

    # --- reports

    def _report(self, trouble: ReceiveFault, text: str, error: BaseException | None = None) -> None:
        LOG.error("%s", text)
        _call(self._on_error, Fault(trouble, text, error))


def _call(function: Callable[..., Any], *arguments: Any) -> None:
    """Whatever the caller's own callback raises is logged and goes no further."""
    try:
        function(*arguments)
    except BaseException as error:
        LOG.error("the callback for bus errors failed itself: %s", _say(error))


def _say(error: BaseException) -> str:
    return str(error) or type(error).__name__
