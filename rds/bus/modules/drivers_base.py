"""What all drivers on the host share: in every period one tick goes out, and one answer of each module comes in.

A dialect adds its own verbs to `DriversBase`: `_set_up` (until every module answers), `_tick` (send the commands),
`_take` (what a frame says), `write` and `stop`. How frames are sent and received is the medium's: `can_drivers.py` for
CAN. Collecting, answers that are late or missing, standstill, other hosts and closing stand here once.
"""

from __future__ import annotations

import contextlib
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import ceil, inf
from typing import Any, Generic, TypeVar

from rds.bus.tools.link import bus_failed
from rds.core.contracts import Counters, Limits, Watch, unwatched
from rds.core.errors import MachineError

_STANDSTILL = 20  # ticks in which no encoder leaves two neighbouring counts, until the axes count as standing
_LONGEST_COAST = 3.0  # s until then
_HALF, _TURN = 1 << 31, 1 << 32  # of a module's counter


class Module:
    """What the host knows of one module: its last position, and for how long it has been silent."""

    __slots__ = ("absolute", "counts", "missed", "origin", "per_count", "seen", "title")

    def __init__(self, title: str, per_count: float, *, absolute: bool = False):
        self.title = title  # for messages: "X (node 2)"
        self.per_count = per_count  # axis units
        self.absolute = absolute  # it counts from the module's own zero, as a spindle's speed does
        self.counts = 0  # at the last tick that it answered
        self.origin = 0  # counts where the position is 0
        self.missed = 0  # periods without an answer, in a row
        self.seen = False  # it has answered at all

    def stand(self) -> None:
        """Positions count from here on."""
        self.origin = 0 if self.absolute else self.counts

    @property
    def standing(self) -> float:
        """The position of the origin by the module's own counter, axis units."""
        return ((self.origin + _HALF) % _TURN - _HALF) * self.per_count

    def __str__(self) -> str:
        return self.title


def _goes_on(way: Sequence[int]) -> bool:
    """Whether counts go one way, and do not only change to and fro, as those of a fine encoder at rest."""
    net = abs(way[-1] - way[0])
    return net > 1 and 2 * net > sum(abs(after - before) for before, after in pairwise(way))


M = TypeVar("M", bound=Module)
Frame = TypeVar("Frame")


class DriversBase(ABC, Generic[M, Frame]):
    """Implements `rds.core.contracts.Drivers` for `modules`, in the order of their axes.

    `timeout` is how long exchange() waits for the answers, s; `lost_after` the periods without an answer after which a
    module is lost, and the run with it.
    """

    noun = "modules"  # what messages call them
    failures: tuple[type[Exception], ...] = (OSError,)  # that the medium raises
    counters: Counters
    _receive: Callable[[float], Frame | None]  # the next frame, within so many s

    def __init__(self, modules: Sequence[M], period: float, timeout: float | None, lost_after: int, bus_name: str):
        self._modules = list(modules)
        self._period = period
        self._timeout = period if timeout is None else timeout
        self._lost_after = lost_after
        self._bus_name = bus_name
        self._help = "check [bus], power and cable"
        # frames taken before a tick: more can't be under way, but from one who babbles
        self._most_waiting = max(64, 2 * len(self._modules) * lost_after)
        self._unheard: set[M] = set()  # those that have been silent since the last tick
        self._started = self._closed = False
        self.limits: list[Limits] = [(-inf, inf)] * len(self._modules)
        self.force: float | None = None  # N, of a load cell: as it was measured last
        self._count_anew()

    # --- what a dialect adds

    @abstractmethod
    def _count_anew(self) -> None:
        """Make new `counters`."""

    @abstractmethod
    def _refuse_company(self) -> None:
        """Listen to the bus; MachineError if two modules share an address, or another host commands."""

    @abstractmethod
    def _set_up(self, watch: Watch) -> None:
        """Make the modules ready, and see every one answer; nothing moves, but an axis that is homed."""

    @abstractmethod
    def _tick(self) -> None:
        """Send what write() has left as the tick."""

    @abstractmethod
    def _take(self, frame: Frame, late: bool) -> M | None:
        """What a frame says; the module if it is its answer to the last tick, or if `late`, to one before."""

    @abstractmethod
    def write(self, commands: Sequence[float], /) -> Sequence[float]:
        """As Drivers.write."""

    @abstractmethod
    def stop(self) -> None:
        """As Drivers.stop."""

    @abstractmethod
    def _shut(self) -> None:
        """Let go of the bus."""

    def _has_substitute(self, module: M) -> bool:
        """Whether something else stands in for the answer that did not come."""
        return False

    def _lost(self, modules: Sequence[M]) -> MachineError:
        """What to raise when these have been silent for too long."""
        return self._silent(modules)

    def _let_go(self) -> None:
        """Before the bus is shut, after a stop."""

    # --- start

    def start(self, watch: Watch = unwatched) -> None:
        """Refuse other hosts, set the modules up, wait until all axes stand, and take the origins.

        Raises MachineError naming the modules that don't answer, the ones that share an address, the axes that do not
        come to rest, and if another host commands the bus. `watch(axis, position)` hears of an axis that is homed.
        """
        self._started = False
        for module in self._modules:
            module.seen, module.missed = False, 0
        with self._failing():
            self._refuse_company()
            self._set_up(watch)
            self._wait_for_standstill()
        for module in self._modules:
            module.stand()
        self._count_anew()
        self._started = True

    @property
    def standing(self) -> list[float]:
        """Where the axes stood at start() by their modules' own counters, axis units: the zero of exchange()."""
        return [module.standing for module in self._modules]

    def _wait_for_standstill(self) -> None:
        """An earlier run may have left an axis coasting. MachineError for one that goes on moving without a command."""
        most = ceil(_LONGEST_COAST / self._period)  # ticks, not s: while a computer stands still nobody looks
        wanted = min(_STANDSTILL, most)
        looks: deque[list[int]] = deque(maxlen=wanted + 1)
        for _ in range(most + wanted):
            self._paced_exchange()
            if any(module.missed for module in self._modules):
                continue  # one that says nothing may move
            looks.append([module.counts for module in self._modules])
            if len(looks) > wanted and all(max(way) - min(way) <= 1 for way in zip(*looks, strict=True)):
                return
        ways = zip(self._modules, zip(*looks, strict=True), strict=False)
        if moving := [module for module, way in ways if not module.absolute and _goes_on(way)]:
            raise MachineError(
                f"{', '.join(map(str, moving))} on bus {self._bus_name} did not come to rest in {_LONGEST_COAST:g} s "
                "without a command: see what moves it (its weight, a hand, an amplifier's offset), then start again"
            )

    def _paced_exchange(self) -> None:
        due = time.monotonic() + self._period
        self.exchange()
        time.sleep(max(0.0, due - time.monotonic()))

    # --- the cycle

    def exchange(self) -> list[float]:
        """Send the waiting commands as the tick; return the measured positions at the tick, in axis units.

        An answer that doesn't come in time repeats the last position, and is counted. MachineError when a module has
        been silent for too long, or has something wrong, or when the bus fails.
        """
        deadline = time.monotonic() + self._timeout
        try:
            self._drain()
            self._tick()
            self.counters.ticks += 1
            self._collect(deadline)
        except self.failures as error:
            raise self._failed(error) from error
        return [((m.counts - m.origin + _HALF) % _TURN - _HALF) * m.per_count for m in self._modules]

    def _drain(self) -> None:
        """Take what came before this tick is sent: frames that arrived then do not count as answers to it.

        Otherwise a module whose answers were late for a while would count as one that lost a tick, and every later
        answer of it as the answer to the tick before.
        """
        receive, take = self._receive, self._take
        for _ in range(self._most_waiting):
            frame = receive(0.0)
            if frame is None:
                break
            module = take(frame, True)
            if module is not None:
                self._unheard.discard(module)
                self.counters.late += 1
        if self._unheard:
            self.counters.silent += 1
            self._unheard.clear()

    def _collect(self, deadline: float) -> None:
        """Take answers until all are here or the deadline has passed."""
        receive, take, clock = self._receive, self._take, time.monotonic
        awaited = set(self._modules)
        while awaited:
            left = deadline - clock()
            frame = receive(left if left > 0.0 else 0.0)
            if frame is None:
                if left <= 0.0 or clock() >= deadline:
                    self._note_missing(awaited)
                    return
                continue
            module = take(frame, False)
            if module is not None:
                module.missed = 0
                module.seen = True
                awaited.discard(module)

    def _note_missing(self, awaited: set[M]) -> None:
        lost = []
        for module in self._modules:
            if module not in awaited:
                continue
            self.counters.missing += 1
            if self._has_substitute(module):
                module.missed = 0
                continue
            self._unheard.add(module)
            module.missed += 1
            if module.missed >= self._lost_after and module.seen:
                lost.append(module)
        if lost:
            raise self._lost(lost)

    def confirm(self) -> None:
        """After the last sample: nothing to confirm where a module that was silent has ended the run already."""

    # --- the end

    def close(self) -> None:
        """Stop, then let go of the bus (a bus that was handed in stays open)."""
        if self._closed:
            return
        self._closed = True
        self.stop()
        with contextlib.suppress(MachineError, *self.failures):
            self._let_go()
        self._shut()

    # --- errors

    def _silent(self, modules: Sequence[M]) -> MachineError:
        names = ", ".join(map(str, modules))
        return MachineError(f"no answer from {names} on bus {self._bus_name}; {self._help}")

    def _company(self, what: str) -> MachineError:
        return MachineError(
            f"another host commands the {self.noun} on bus {self._bus_name} ({what}); stop one of them (`rds estop` "
            "stops the machine): two hosts never drive the same axes"
        )

    def _failed(self, error: Exception) -> MachineError:
        return bus_failed(self._bus_name, error)

    @contextlib.contextmanager
    def _failing(self) -> Iterator[Any]:
        """What the medium raises inside becomes a MachineError."""
        try:
            yield
        except self.failures as error:
            raise self._failed(error) from error
