"""Simulated CiA 402 drives for a machine's axes, all in one process.

`python -m rds.bus.cia402.server MACHINE [--axes X,Y,Z] [--interface I] [--channel C]` writes one line, "ready ...", on
stdout when all drives have sent their boot-up messages, and reports on stderr. It ends on SIGTERM, SIGINT, or, with
--exit-with-stdin, when its starter has gone and no SYNC has come for a while.
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
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import can

from rds.bus.cia402.drive import Drive
from rds.bus.cia402.node import DriveNode
from rds.bus.link import BUILTIN, bus_name, open_bus, pair
from rds.bus.poller import READ, make_poller
from rds.bus.server import AFTERLIFE, PRIORITY, default_channel
from rds.core.errors import InputError, RdsError
from rds.machines import Machine, load_machine
from rds.machines.machine import Axis
from rds.runtime.scheduling import lock_memory, raise_priority

LOG = logging.getLogger(__name__)

_LONGEST_SLEEP = 0.2  # s, so that a stop is noticed


def serve(
    machine: Machine,
    interface: str = BUILTIN,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    orphaned: threading.Event | None = None,
    afterlife: float = AFTERLIFE,
    nodes: list[DriveNode] | None = None,
    **options: Any,
) -> None:
    """Serve a drive for each of the `axes` (names; default all) of `machine` until `stop` is set.

    A drive's node-ID is its axis's node, its full voltage the converter's range. `channel` defaults to the machine's
    name on the built-in bus; `options` go to the python-can interface. `ready` is called when all have booted. The
    drives are appended to `nodes`, for whoever wants to look at them or to inject faults. Once `orphaned` is set, the
    drives also end when no SYNC has come for `afterlife` s. A bus that fails later is opened again. In a process's main
    thread it takes real-time priority where permitted, and ends on SIGTERM and SIGINT.

    Raises MachineError if the bus can't be opened at the start, InputError for an unknown axis.
    """
    channel = default_channel(machine, interface, channel)
    stop = stop or threading.Event()
    used = [machine.axis(name) for name in (machine.axes if axes is None else axes)]
    nodes = [] if nodes is None else nodes
    try:
        for axis in used:
            make = partial(_make_drive, axis, machine.converter.range)
            nodes.append(DriveNode(make, partial(open_bus, interface, channel, node=axis.name, **options)))
        _be_on_time(stop)
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


def _make_drive(axis: Axis, volts: float, start: float) -> Drive:
    return Drive(axis, start, volts)


def _be_on_time(stop: threading.Event) -> None:
    """Where the whole process is the machine's: priority, and an end when told."""
    if threading.current_thread() is not threading.main_thread():
        return
    LOG.info("%s; memory locked: %s", raise_priority(PRIORITY), lock_memory())
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    logging.getLogger("canopen").setLevel(logging.WARNING)  # it reports every SDO transfer
    gc.collect()
    gc.freeze()


def _until(
    stop: threading.Event, orphaned: threading.Event | None, afterlife: float, nodes: Sequence[DriveNode]
) -> Callable[[], bool]:
    """A function that says whether to keep on serving."""
    heard = (-1, time.monotonic())

    def keep_on() -> bool:
        nonlocal heard
        if orphaned is not None and orphaned.is_set():
            syncs = sum(node.drive.syncs for node in nodes)
            if syncs != heard[0]:
                heard = (syncs, time.monotonic())
            elif time.monotonic() - heard[1] > afterlife:
                LOG.warning("the starter has gone and nobody commands: end")
                return False
        return not stop.is_set()

    return keep_on


def _serve_by_descriptor(nodes: Sequence[DriveNode], keep_on: Callable[[], bool]) -> None:
    """One loop, one wait for all buses: the quickest, where the interface has descriptors to wait for."""
    poller = make_poller()
    watched: dict[int, DriveNode] = {}
    try:
        while keep_on():
            now_there = {_descriptor(node.bus): node for node in nodes if node.bus is not None}
            if now_there.keys() != watched.keys():
                # a bus that failed took its descriptor with it; one that is back has a new one
                poller.close()
                poller, watched = make_poller(), now_there
                for descriptor in watched:
                    poller.register(descriptor, READ)
            sleep = min([p for node in nodes if (p := node.patience()) is not None], default=_LONGEST_SLEEP)
            if watched:
                ready = poller.poll(min(sleep, _LONGEST_SLEEP))
            else:
                ready = []
                time.sleep(min(sleep, 0.05))
            for descriptor, _ in ready:
                watched[descriptor].step(0.0)
            for node in nodes:
                if node.bus is None:
                    node.reopen()
                if not ready or node.bus is None:
                    node.step(0.0)
    finally:
        poller.close()


def _serve_by_threads(nodes: Sequence[DriveNode], keep_on: Callable[[], bool]) -> None:
    """A thread per node, each waiting in recv(): for interfaces without descriptors."""

    def run(node: DriveNode) -> None:
        while keep_on():
            patience = node.patience()
            sleep = _LONGEST_SLEEP if patience is None else min(patience, _LONGEST_SLEEP)
            if node.bus is None:
                time.sleep(min(sleep, 0.05))
                node.reopen()
            node.step(sleep)

    threads = [threading.Thread(target=run, args=(node,), name=f"drive {node.drive.name}") for node in nodes]
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
    parser = argparse.ArgumentParser(prog="python -m rds.bus.cia402.server", description="serve simulated drives")
    parser.add_argument("machine")
    parser.add_argument("--interface", default=BUILTIN)
    parser.add_argument("--channel", default=None)
    parser.add_argument("--axes", default=None, help="names, separated by commas (default: all)")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE", help="of the interface")
    parser.add_argument(
        "--exit-with-stdin",
        action="store_true",
        help="when stdin ends (the starter has gone), end once no SYNC has come for the time of --afterlife",
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

        def ready() -> None:
            sys.stdout.write(f"ready {machine.name} on {bus}: {', '.join(axes or machine.axes)}\n")
            sys.stdout.flush()

        serve(
            machine,
            options.interface,
            options.channel,
            axes,
            ready,
            orphaned=orphaned,
            afterlife=options.afterlife,
            **bus_options,
        )
    except RdsError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, InputError) else 1
    return 0


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
