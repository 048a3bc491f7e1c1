"""Serving the modules of a machine, whatever they speak: each a node with a bus of its own, all in one loop.

A dialect brings its nodes (`Node`); opening and reopening of buses, waiting, priority, faults and the end are here.
"""

from __future__ import annotations

import gc
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Protocol, TypeVar

import can

from rds.bus.hub.faults import Faults
from rds.bus.hub.poller import READ, Poller, SelectPoller, make_poller
from rds.bus.medium.fault_kinds import Fault
from rds.bus.modules.shared_bus import opener_of
from rds.bus.tools.link import BUILTIN, bus_name, default_channel
from rds.core.errors import InputError
from rds.core.interrupt import SignalEvent, set_by_signals
from rds.core.scheduling import lock_memory, raise_priority
from rds.machines import Machine
from rds.machines.machine import Axis

LOG = logging.getLogger(__name__)

PRIORITY = 60  # below the target's 80 and the hub's 70
AFTERLIFE = 10.0  # s without a command until a machine ends whose starter has gone
_LONGEST_SLEEP = 0.1  # s, so that a stop, a line on stdin or a lost bus is noticed
_NO_DESCRIPTOR_SLEEP = 0.002  # s, where an interface can't be waited for together with others
_LOOK = 5e-3  # s between two looks at what is not in a hurry, while frames come


class Node(Protocol):
    """A module, or a drive, with a bus of its own."""

    bus: can.BusABC | None  # None after a failure

    @property
    def name(self) -> str:
        """Its axis."""

    @property
    def heard(self) -> float:
        """A number that changes when the host commands."""

    def patience(self) -> float | None:
        """How long it may sleep if no frame comes, s; None: as long as it likes."""

    def step(self, timeout: float) -> bool:
        """Take one frame, waiting for it at most `timeout` s, or else do what is due; whether one came."""

    def reopen(self) -> bool:
        """Open the bus again if it failed and it is time to; whether it did."""

    def close(self) -> None:
        """Leave the bus."""


N = TypeVar("N", bound=Node)
Opener = Callable[..., can.BusABC]  # takes the identifiers to listen to, and a mask
NodeMaker = Callable[[int, Axis, Opener], N]  # of the axis whose voltage has this slot in a cyclic command


def serve_nodes(
    machine: Machine,
    make_node: NodeMaker[N],
    interface: str = BUILTIN,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    orphaned: threading.Event | None = None,
    afterlife: float = AFTERLIFE,
    faults: Sequence[Fault] = (),
    nodes: list[N] | None = None,
    chores: Callable[[Sequence[N]], None] | None = None,
    exact: bool = False,
    **options: Any,
) -> None:
    """Serve a node for each axis of `machine` (or each of `axes`) until `stop` is set.

    `channel` defaults to the machine's name on the built-in bus; `options` go to the python-can interface. `faults`
    are injected there, their times counting from when all nodes are on the bus, until the end. `ready` is called
    when all nodes are on the bus. Once `orphaned` is set, the machine also ends when nobody has commanded it for
    `afterlife` s. A bus that fails later is reported in the log and opened again; the axes go on meanwhile.
    The nodes are appended to `nodes`; `chores` is called with them now and then (where an interface can't be
    waited for together with others, at the price of asking it every 2 ms); `exact` is for nodes whose instants
    matter to less than 1 ms. In a process's main thread it takes real-time priority where permitted, and ends on
    SIGTERM, SIGINT and SIGHUP.

    Raises MachineError if the bus can't be opened at the start, InputError for an unknown axis, and for faults on
    another bus than the built-in one.
    """
    channel = default_channel(machine, interface, channel)
    if faults and interface != BUILTIN:
        raise InputError(f"faults can be injected on the built-in bus only, not on {bus_name(interface, channel)}")
    stop = stop or SignalEvent()
    for name in axes or ():
        machine.axis(name)
    nodes = [] if nodes is None else nodes
    opener = opener_of(interface, channel, **options)
    try:
        for axis in machine.axes.values():
            if axes is None or axis.name in axes:
                slot = machine.slots[axis.name]
                nodes.append(make_node(slot, axis, partial(opener, node=axis.name)))
        with as_process(stop), _injected(channel, faults):
            if ready is not None:
                ready()
            keep_on = _until(stop, orphaned, afterlife, nodes)
            if chores is None and any(_descriptor(node) < 0 for node in nodes):
                _serve_by_threads(nodes, keep_on)
            else:
                _serve_by_descriptor(nodes, keep_on, SelectPoller if exact else make_poller, chores)
    finally:
        for node in nodes:
            node.close()


@contextmanager
def _injected(channel: str | None, faults: Sequence[Fault]) -> Iterator[None]:
    """Inject the faults for as long as the context lasts."""
    if not faults:
        yield
        return
    with Faults(str(channel)) as line:
        line.play(faults)
        yield


@contextmanager
def as_process(stop: threading.Event) -> Iterator[None]:
    """Where the whole process is the machine's: be on time, and end when told."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    LOG.info("%s; memory locked: %s", raise_priority(PRIORITY), lock_memory())
    with set_by_signals(stop):
        gc.collect()
        gc.freeze()
        try:
            yield
        finally:
            gc.unfreeze()


def _until(
    stop: threading.Event, orphaned: threading.Event | None, afterlife: float, nodes: Sequence[N]
) -> Callable[[], bool]:
    """A function that says whether to keep on serving."""
    heard = ([-1.0], time.monotonic())

    def keep_on() -> bool:
        nonlocal heard
        if orphaned is not None and orphaned.is_set():
            now = [node.heard for node in nodes]
            if now != heard[0]:
                heard = (now, time.monotonic())
            elif time.monotonic() - heard[1] > afterlife:
                LOG.warning("the starter has gone and nobody commands: end")
                return False
        return not stop.is_set()

    return keep_on


def _serve_by_descriptor(
    nodes: Sequence[N],
    keep_on: Callable[[], bool],
    make: Callable[[], Poller],
    chores: Callable[[Sequence[N]], None] | None,
) -> None:
    """One loop, one wait for all buses. While frames come, they come first: the rest is looked after in between."""
    poller, watched = make(), dict[int, N]()
    sleep, look_at = 0.0, 0.0
    try:
        while keep_on():
            ready = poller.poll(sleep)
            lost = False
            for descriptor, _ in ready:
                node = watched[descriptor]
                node.step(0.0)
                lost = lost or node.bus is None
            if not ready or lost or time.monotonic() >= look_at:
                look_at = time.monotonic() + _LOOK
                _look_after(nodes)
                if chores is not None:
                    chores(nodes)
                # a bus that failed took its descriptor with it; one that is back has a new one
                there = {descriptor: node for node in nodes if (descriptor := _descriptor(node)) >= 0}
                if lost or there != watched:
                    poller.close()
                    poller, watched = make(), there
                    for descriptor in watched:
                        poller.register(descriptor, READ)
            longest = _LONGEST_SLEEP if len(watched) == len(nodes) else _NO_DESCRIPTOR_SLEEP
            sleep = min(min([p for node in nodes if (p := node.patience()) is not None], default=longest), longest)
    finally:
        poller.close()


def _look_after(nodes: Sequence[N]) -> None:
    """Do what is due, whether frames come or not."""
    for node in nodes:
        if node.bus is None:
            node.reopen()
        if node.bus is None or node.patience() == 0.0 or _descriptor(node) < 0:
            node.step(0.0)


def _serve_by_threads(nodes: Sequence[N], keep_on: Callable[[], bool]) -> None:
    """A thread per node, each waiting in recv(): for interfaces without descriptors."""

    def run(node: N) -> None:
        while keep_on():
            patience = node.patience()
            sleep = _LONGEST_SLEEP if patience is None else min(patience, _LONGEST_SLEEP)
            if node.bus is None:
                time.sleep(min(sleep, 0.05))
                node.reopen()
            node.step(sleep)

    threads = [threading.Thread(target=run, args=(node,), name=f"node {node.name}") for node in nodes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _descriptor(node: Node) -> int:
    try:
        return -1 if node.bus is None else node.bus.fileno()
    except NotImplementedError:
        return -1
