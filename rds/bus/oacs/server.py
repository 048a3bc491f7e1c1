"""The distributed modules behind the bus: those of a machine in one process, or each in its own.

`python -m rds.bus.oacs.server MACHINE [--modules X,Z]` writes one line, "ready ...", on stdout when all modules are on
the bus, and reports on stderr. Lines on stdin press buttons and cut wires (bench.py). It ends on SIGTERM and SIGINT,
and with --exit-with-stdin when stdin ends.
"""

from __future__ import annotations

import argparse
import gc
import logging
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import can

from rds.bus.link import BUILTIN, bus_name, open_bus, pair
from rds.bus.oacs import messages
from rds.bus.oacs.bench import handle
from rds.bus.oacs.module import HEARTBEAT, OacsModule
from rds.bus.oacs.module_data import read_modules
from rds.bus.oacs.node import OacsNode
from rds.bus.poller import READ, SelectPoller
from rds.bus.server import PRIORITY, default_channel
from rds.core.errors import InputError, RdsError
from rds.machines import Machine, load_machine
from rds.runtime.scheduling import lock_memory, raise_priority

LOG = logging.getLogger(__name__)

_LONGEST_SLEEP = 0.1  # s, so that a stop, a line or a lost bus is noticed
_NO_DESCRIPTOR_SLEEP = 0.002  # s, where an interface can't be waited for together with others


def serve_oacs(
    machine: Machine,
    interface: str = BUILTIN,
    channel: str | None = None,
    modules: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    lines: queue.SimpleQueue[str] | None = None,
    serials: dict[str, int] | None = None,
    **options: Any,
) -> None:
    """Serve the modules of `machine` (or those named), each a node of its own, until `stop` is set.

    `channel` defaults to the machine's name on the built-in bus; `options` go to the python-can interface. `ready` is
    called when all are on the bus. `lines` are what hands do at the machine (bench.py); `serials` are the modules'
    serial numbers, by name, random where not given. In a process's main thread it takes real-time priority where
    permitted, and ends on SIGTERM and SIGINT.

    Raises MachineError if the bus can't be opened at the start, InputError for an unknown module.
    """
    channel = default_channel(machine, interface, channel)
    stop = stop or threading.Event()
    for name in modules or ():
        machine.axis(name)
    data = read_modules(machine)
    messages.load()  # half a second, which must not fall between two cycles

    def opener(identifiers: list[int]) -> can.BusABC:
        return open_bus(interface, channel, identifiers, **options)

    nodes: list[OacsNode] = []
    try:
        for slot, axis in enumerate(machine.axes.values()):
            if modules is None or axis.name in modules:
                serial = (serials or {}).get(axis.name)
                make = partial(OacsModule, axis, data[axis.name], slot, machine.sample_period, serial=serial)
                nodes.append(OacsNode(lambda start, make=make: make(start=start), opener))  # type: ignore[misc]
        _be_on_time(stop)
        if ready is not None:
            ready()
        _serve(nodes, stop, lines or queue.SimpleQueue())
    finally:
        for node in nodes:
            node.close()


def _be_on_time(stop: threading.Event) -> None:
    """Where the whole process is the machine's: priority, and an end when told."""
    if threading.current_thread() is not threading.main_thread():
        return
    LOG.info("%s; memory locked: %s", raise_priority(PRIORITY), lock_memory())
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    gc.collect()
    gc.freeze()


def _serve(nodes: Sequence[OacsNode], stop: threading.Event, lines: queue.SimpleQueue[str]) -> None:
    """One loop, one wait for all buses. While frames come, they come first: the rest is looked after in between."""
    poller, watched = SelectPoller(), dict[int, OacsNode]()  # exact to the µs, as response times are; epoll to the ms
    sleep, look_at = 0.0, 0.0
    try:
        while not stop.is_set():
            ready = poller.poll(sleep)
            for descriptor, _ in ready:
                watched[descriptor].step()
            now = time.monotonic()
            if ready and now < look_at:
                sleep = 0.0
                continue
            look_at = now + HEARTBEAT
            for node in nodes:
                if node.bus is None or node.patience() == 0.0 or _descriptor(node.bus) < 0:
                    node.step()
            _do_lines(nodes, lines)
            if {_descriptor(node.bus) for node in nodes} - {-1} != set(watched):
                poller.close()
                poller = SelectPoller()
                watched = {d: node for node in nodes if (d := _descriptor(node.bus)) >= 0}
                for descriptor in watched:
                    poller.register(descriptor, READ)
            longest = _LONGEST_SLEEP if len(watched) == len(nodes) else _NO_DESCRIPTOR_SLEEP
            patience = min((p for node in nodes if (p := node.patience()) is not None), default=longest)
            sleep = min(patience, longest)
    finally:
        poller.close()


def _do_lines(nodes: Sequence[OacsNode], lines: queue.SimpleQueue[str]) -> None:
    while not lines.empty():
        try:
            handle(lines.get(), nodes)
        except InputError as error:
            LOG.error("%s", error)


def _descriptor(bus: can.BusABC | None) -> int:
    try:
        return -1 if bus is None else bus.fileno()
    except NotImplementedError:
        return -1


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the bus failed at the start; 2: bad input."""
    parser = argparse.ArgumentParser(prog="python -m rds.bus.oacs.server", description="serve distributed modules")
    parser.add_argument("machine")
    parser.add_argument("--interface", default=BUILTIN)
    parser.add_argument("--channel", default=None)
    parser.add_argument("--modules", default=None, help="names, separated by commas (default: all)")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE", help="of the interface")
    parser.add_argument("--exit-with-stdin", action="store_true", help="end when stdin does")
    options = parser.parse_args(arguments)
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s")
    stop, lines = threading.Event(), queue.SimpleQueue[str]()
    threading.Thread(target=_read_stdin, args=(lines, stop if options.exit_with_stdin else None), daemon=True).start()
    modules = options.modules.split(",") if options.modules else None
    try:
        machine = load_machine(options.machine)
        bus = bus_name(options.interface, default_channel(machine, options.interface, options.channel))
        ready = partial(_say, f"ready {machine.name} on {bus}: {', '.join(modules or machine.axes)}\n")
        bus_options = dict(pair(text) for text in options.option)
        serve_oacs(machine, options.interface, options.channel, modules, ready, stop, lines, **bus_options)
    except RdsError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, InputError) else 1
    return 0


def _say(line: str) -> None:
    sys.stdout.write(line)
    sys.stdout.flush()


def _read_stdin(lines: queue.SimpleQueue[str], stop: threading.Event | None) -> None:
    rest = b""
    while data := os.read(0, 4096):  # not sys.stdin: a thread in its lock would spoil the interpreter's end
        *whole, rest = (rest + data).split(b"\n")
        for line in whole:
            lines.put(line.decode(errors="replace"))
    if stop is not None:
        stop.set()


if __name__ == "__main__":
    sys.exit(main())
