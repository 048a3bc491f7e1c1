"""The machine behind the bus: all axis modules of a machine in one process.

`python -m rds.bus.server MACHINE [--interface I] [--channel C]` writes one line, "ready ...", on stdout when all
modules are on the bus, and reports on stderr. It ends on SIGTERM, SIGINT, or when its starter has gone (below).
"""

from __future__ import annotations

import argparse
import gc
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import can

from rds.bus.fault_file import read_faults
from rds.bus.fault_kinds import Fault
from rds.bus.faults import Faults
from rds.bus.link import BUILTIN, bus_name, open_bus, pair
from rds.bus.module import AxisModule
from rds.bus.module_node import LISTEN_MASK, LISTENS_TO, ModuleNode
from rds.bus.poller import READ, make_poller
from rds.core.errors import InputError, RdsError
from rds.machines import Machine, load_machine
from rds.runtime.scheduling import lock_memory, raise_priority

LOG = logging.getLogger(__name__)

PRIORITY = 60  # below the target's 80 and the hub's 70
_LONGEST_SLEEP = 0.2  # s, so that a stop is noticed
AFTERLIFE = 10.0  # s without a command until a machine ends whose starter has gone


def serve(
    machine: Machine,
    interface: str = BUILTIN,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    orphaned: threading.Event | None = None,
    afterlife: float = AFTERLIFE,
    faults: Sequence[Fault] = (),
    **options: Any,
) -> None:
    """Serve the modules of `machine` (or of its `axes`), each a node of its own, until `stop` is set.

    `channel` defaults to the machine's name on the built-in bus; `options` go to the python-can interface. `faults`
    are injected there, their times counting from when all nodes are on the bus, until the end. `ready` is called
    when all nodes are on the bus. Once `orphaned` is set, the machine also ends when nobody has commanded it for
    `afterlife` s. A bus that fails later is reported in the log and opened again; the axes go on meanwhile.
    In a process's main thread it takes real-time priority where permitted, and ends on SIGTERM and SIGINT.

    Raises MachineError if the bus can't be opened at the start, InputError for an unknown axis, and for faults on
    another bus than the built-in one.
    """
    channel = default_channel(machine, interface, channel)
    if faults and interface != BUILTIN:
        raise InputError(f"faults can be injected on the built-in bus only, not on {bus_name(interface, channel)}")
    stop = stop or threading.Event()
    for name in axes or ():
        machine.axis(name)
    opener = partial(open_bus, interface, channel, LISTENS_TO, LISTEN_MASK, **options)
    nodes: list[ModuleNode] = []
    try:
        for slot, axis in enumerate(machine.axes.values()):
            if axes is None or axis.name in axes:
                module = partial(AxisModule, axis, slot, machine.sample_period)
                nodes.append(ModuleNode(module, partial(opener, node=axis.name)))
        with _as_process(stop), _injected(channel, faults):
            if ready is not None:
                ready()
            keep_on = _until(stop, orphaned, afterlife, nodes)
            if all(_descriptor(node.bus) >= 0 for node in nodes):
                _serve_by_descriptor(nodes, keep_on)
            else:
                _serve_by_threads(nodes, keep_on)
    finally:
        for node in nodes:
            node.close()


def default_channel(machine: Machine, interface: str, channel: str | None) -> str | None:
    """The channel that was asked for, else the machine's name on the built-in bus, else the interface's own default."""
    return channel if channel is not None or interface != BUILTIN else machine.name


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
def _as_process(stop: threading.Event) -> Iterator[None]:
    """Where the whole process is the machine's: be on time, and end when told."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    LOG.info("%s; memory locked: %s", raise_priority(PRIORITY), lock_memory())
    before = [(number, signal.signal(number, lambda *_: stop.set())) for number in (signal.SIGTERM, signal.SIGINT)]
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        for number, handler in before:
            signal.signal(number, handler)


def _until(
    stop: threading.Event, orphaned: threading.Event | None, afterlife: float, nodes: Sequence[ModuleNode]
) -> Callable[[], bool]:
    """A function that says whether to keep on serving."""
    heard = (-1, time.monotonic())

    def keep_on() -> bool:
        nonlocal heard
        if orphaned is not None and orphaned.is_set():
            ticks = sum(node.module.ticks for node in nodes)
            if ticks != heard[0]:
                heard = (ticks, time.monotonic())
            elif time.monotonic() - heard[1] > afterlife:
                LOG.warning("the starter has gone and nobody commands: end")
                return False
        return not stop.is_set()

    return keep_on


def _serve_by_descriptor(nodes: Sequence[ModuleNode], keep_on: Callable[[], bool]) -> None:
    """One loop, one wait for all buses: the quickest, where the interface has descriptors to wait for."""
    poller = make_poller()
    watched = {_descriptor(node.bus): node for node in nodes}
    for descriptor in watched:
        poller.register(descriptor, READ)
    try:
        while keep_on():
            sleep = min((p for node in nodes if (p := node.patience()) is not None), default=_LONGEST_SLEEP)
            ready = poller.poll(min(sleep, _LONGEST_SLEEP))
            for descriptor, _ in ready:
                watched[descriptor].step(0.0)
            if ready and all(node.bus is not None for node in nodes):
                continue  # the quick way while ticks come: each looks after its node's watchdog
            for node in nodes:
                if node.bus is not None or node.module.expires is not None:
                    node.step(0.0)
            # a bus that failed took its descriptor with it; one that is back has a new one
            if any(node.bus is None for node in nodes):
                for node in nodes:
                    node.reopen()
                poller.close()
                poller = make_poller()
                watched = {_descriptor(node.bus): node for node in nodes if node.bus is not None}
                for descriptor in watched:
                    poller.register(descriptor, READ)
                if not watched:
                    time.sleep(0.05)
    finally:
        poller.close()


def _serve_by_threads(nodes: Sequence[ModuleNode], keep_on: Callable[[], bool]) -> None:
    """A thread per node, each waiting in recv(): for interfaces without descriptors."""

    def run(node: ModuleNode) -> None:
        while keep_on():
            patience = node.patience()
            sleep = _LONGEST_SLEEP if patience is None else min(patience, _LONGEST_SLEEP)
            if node.bus is None:
                time.sleep(min(sleep, 0.05))
                node.reopen()
            node.step(sleep)

    threads = [threading.Thread(target=run, args=(node,), name=f"module {node.module.name}") for node in nodes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _descriptor(bus: can.BusABC | None) -> int:
    try:
        return -1 if bus is None else bus.fileno()
    except NotImplementedError:
        return -1


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the bus failed at the start; 2: bad input."""
    parser = argparse.ArgumentParser(prog="python -m rds.bus.server", description="serve a machine's axis modules")
    parser.add_argument("machine")
    parser.add_argument("--interface", default=BUILTIN)
    parser.add_argument("--channel", default=None)
    parser.add_argument("--axes", default=None, help="names, separated by commas (default: all)")
    parser.add_argument("--faults", default=None, metavar="FILE", help="schedule of faults, TOML")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE", help="of the interface")
    parser.add_argument(
        "--exit-with-stdin",
        action="store_true",
        help="when stdin ends (the starter has gone), end once nobody has commanded for the time of --afterlife",
    )
    parser.add_argument("--afterlife", type=float, default=AFTERLIFE, metavar="SECONDS")
    options = parser.parse_args(arguments)
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s")
    orphaned = _watch_stdin() if options.exit_with_stdin else None
    axes = options.axes.split(",") if options.axes else None
    try:
        machine = load_machine(options.machine)
        bus_options = dict(pair(text) for text in options.option)
        bus = bus_name(options.interface, default_channel(machine, options.interface, options.channel))
        ready = partial(_say, f"ready {machine.name} on {bus}: {', '.join(axes or machine.axes)}\n")
        serve(
            machine,
            options.interface,
            options.channel,
            axes,
            ready,
            orphaned=orphaned,
            afterlife=options.afterlife,
            faults=read_faults(options.faults) if options.faults else (),
            **bus_options,
        )
    except RdsError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, InputError) else 1
    return 0


def _say(line: str) -> None:
    sys.stdout.write(line)
    sys.stdout.flush()


def _watch_stdin() -> threading.Event:
    """An event that is set when stdin ends. A thread in a read costs nothing until then, on every system."""
    ended = threading.Event()

    def read_to_end() -> None:
        while os.read(0, 4096):  # not sys.stdin: a thread in its lock would spoil the interpreter's end
            pass
        ended.set()

    threading.Thread(target=read_to_end, name="starter", daemon=True).start()
    return ended


if __name__ == "__main__":
    sys.exit(main())
