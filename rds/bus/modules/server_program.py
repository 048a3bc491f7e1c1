"""The program around a server, the same for every dialect: its options, its one line on stdout, its end.

It writes "ready ..." when all modules are on the bus, and reports on stderr. It ends on SIGTERM, SIGINT and
SIGHUP; with --exit-with-stdin also when its starter has gone and nobody commands.
"""

from __future__ import annotations

import argparse
import errno
import logging
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

from rds.bus.medium.fault_file import read_faults
from rds.bus.modules.serve_loop import AFTERLIFE
from rds.bus.tools.link import BUILTIN, bus_name, default_channel, pair
from rds.core.errors import InputError, RdsError
from rds.machines import load_machine

_MOST_WAITING = 20  # lines that wait to be done; whoever says more waits
_FULL = 0.02  # s until it is looked whether some are done
_LONGEST_LINE = 4096  # bytes
_BACKGROUND = 0.5  # s until a program in the background of its terminal looks for lines again


def run(
    serve: Callable[..., None],
    module: str,
    description: str,
    arguments: Sequence[str] | None = None,
    lines: queue.SimpleQueue[str] | None = None,
    interface: str = BUILTIN,
) -> int:
    """`python -m MODULE MACHINE [options]`, with the function `serve` of a dialect. Lines on stdin go to `lines`.

    Exit code 0: told to end; 1: the bus failed at the start; 2: bad input.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=description)
    parser.add_argument("machine")
    parser.add_argument("--interface", default=interface)
    parser.add_argument("--channel", default=None)
    parser.add_argument("--axes", "--modules", default=None, help="names, separated by commas (default: all)")
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
    logging.getLogger("canopen").setLevel(logging.WARNING)  # it reports every SDO transfer
    orphaned = threading.Event()
    if options.exit_with_stdin or lines is not None:
        hear_hands(lines, orphaned if options.exit_with_stdin else None)
    axes = options.axes.split(",") if options.axes else None
    try:
        machine = load_machine(options.machine)
        bus_options = dict(pair(text) for text in options.option)
        bus = bus_name(options.interface, default_channel(machine, options.interface, options.channel))
        serve(
            machine,
            options.interface,
            options.channel,
            axes,
            ready=partial(_say, f"ready {machine.name} on {bus}: {', '.join(axes or machine.axes)}\n"),
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


def hear_hands(lines: queue.SimpleQueue[str] | None, ended: threading.Event | None = None) -> None:
    """From now on hand the lines on stdin on to `lines`, and set `ended` at their end.

    A program in the background of a terminal goes on (else reading would stop it), and hears lines when it is in front.
    """
    if sys.stdin is None:  # closed from the start: its descriptor may be a bus's by now
        return
    if hasattr(signal, "SIGTTIN") and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    threading.Thread(target=_read_stdin, args=(lines, ended), name="starter", daemon=True).start()


def _read_stdin(lines: queue.SimpleQueue[str] | None, ended: threading.Event | None) -> None:
    """A thread in a read costs nothing until a line comes, on every system."""
    rest = b""
    while True:
        try:
            data = os.read(0, 4096)  # not sys.stdin: a thread in its lock would spoil the interpreter's end
        except OSError as error:
            if error.errno != errno.EIO:
                break
            time.sleep(_BACKGROUND)
            continue
        *whole, rest = (rest + (data or b"\n" * bool(rest))).split(b"\n")  # the last line may lack its end
        if lines is not None:
            for line in whole:
                while lines.qsize() >= _MOST_WAITING:
                    time.sleep(_FULL)
                lines.put(line.decode(errors="replace"))
        rest = rest[:_LONGEST_LINE]
        if not data:
            break
    if ended is not None:
        ended.set()
