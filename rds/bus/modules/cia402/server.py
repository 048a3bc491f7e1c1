"""Simulated CiA 402 drives for a machine's axes, all in one process.

`python -m rds.bus.modules.cia402.server MACHINE [--axes X,Y,Z] [--interface I] [--channel C]`
writes one line, "ready ...", on stdout when all drives have sent their boot-up messages, and reports on stderr.
Its options and its end are those of rds/bus/modules/server_program.py.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.bus.tools.mf4 import put_off_asammdf
    from rds.core.garbage import collect_rarely

    collect_rarely()
    put_off_asammdf()

import queue
import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rds.bus.modules import server_program
from rds.bus.modules.buttons import press_buttons
from rds.bus.modules.cia402.drive import Drive
from rds.bus.modules.cia402.node import DriveNode
from rds.bus.modules.cia402.quirks import Quirk, read_quirks
from rds.bus.modules.serve_loop import Opener, serve_nodes
from rds.bus.tools.link import BUILTIN
from rds.core.garbage import leave
from rds.core.private_files import keep_process_private
from rds.machines import Machine
from rds.machines.machine import Axis


def serve(
    machine: Machine,
    interface: str = BUILTIN,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    lines: queue.SimpleQueue[str] | None = None,
    quirks: str | Iterable[str] = (),
    eds: str | Path | None = None,
    **options: Any,
) -> None:
    """Serve a drive for each axis of `machine` (or of its `axes`). What else may be said, and errors: as `serve_nodes`.

    `quirks` are things that are wrong with the drives, as in "wrong-sign,zero-limits" (see quirks.py). With `eds`, the
    EDS of another drive, they have its objects and identity. `lines` press buttons (`press_buttons`).

    A drive's node-ID is its axis's node, its full voltage the converter's range. It counts as commanded while SYNC
    comes.
    """
    file = None if eds is None else Path(eds)
    make_drive = partial(_make_drive, volts=machine.converter.range, quirks=read_quirks(quirks), eds=file)
    make_node = partial(_make_node, make_drive)
    serve_nodes(
        *(machine, make_node, interface, channel, axes, ready, stop),
        chores=None if lines is None else partial(press_buttons, lines),
        **options,
    )


def _make_node(make_drive: Callable[..., Drive], slot: int, axis: Axis, opener: Opener) -> DriveNode:
    return DriveNode(axis.name, partial(make_drive, axis), opener)


def _make_drive(
    axis: Axis, start: float, node: int | None, volts: float, quirks: frozenset[Quirk], eds: Path | None
) -> Drive:
    return Drive(axis, start, volts, node, quirks, eds)


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the bus failed at the start; 2: bad input."""
    lines = queue.SimpleQueue[str]()
    with_buttons = partial(serve, lines=lines)
    return server_program.run(with_buttons, "rds.bus.modules.cia402.server", "serve simulated drives", arguments, lines)


if __name__ == "__main__":
    keep_process_private()
    leave(main())
