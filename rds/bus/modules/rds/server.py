"""The machine behind the bus: all axis modules of a machine in one process.

`python -m rds.bus.modules.rds.server MACHINE [--interface I] [--channel C]` writes one line, "ready ...", on stdout
when all modules are on the bus, and reports on stderr. Its options and its end are those of server_program.py.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.bus.tools.mf4 import put_off_asammdf
    from rds.core.garbage import collect_rarely

    collect_rarely()
    put_off_asammdf()

import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rds.bus.modules import server_program
from rds.bus.modules.buttons import press_buttons
from rds.bus.modules.drift import drift_by_axis
from rds.bus.modules.rds.load_cell import fit_load_cell
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.module_node import ModuleNode
from rds.bus.modules.serve_loop import Opener, serve_nodes
from rds.bus.tools.link import BUILTIN
from rds.core.garbage import leave
from rds.core.private_files import keep_process_private, write_private
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
    drift: Any = (),
    trace: str | None = None,
    cut: str | None = None,
    **options: Any,
) -> None:
    """Serve the modules of `machine` (or of its `axes`). What else may be said, and errors: as `serve_nodes`.

    `drift` is how much too fast their clocks go, ppm by axis, as in "X:50,Y:-30", beside what the machine file says:
    what they tell, and by which they move in methods B and C. At the end the file `trace` (CSV) gets where the
    carriages really were at each step of such a motion. `lines` press buttons (`press_buttons`). `cut` is a file
    (`rds.machines.forces.cut_file`) of what the machine cuts, for the load cell in its cutting head.
    """
    drifting = drift_by_axis(drift, machine)
    served: list[ModuleNode] = []

    def make_node(slot: int, axis: Axis, opener: Opener) -> ModuleNode:
        off, volts = drifting[axis.name] * 1e-6, machine.converter.range
        node = ModuleNode(
            axis.name, partial(AxisModule, axis, slot, machine.sample_period, drift=off, range=volts), opener
        )
        node.module.by_itself.gauge = None if trace is None else []
        served.append(node)
        return node

    def begin() -> None:
        if cut is not None:
            fit_load_cell(machine, {node.name: node.module for node in served}, cut)
        if ready is not None:
            ready()

    try:
        serve_nodes(
            *(machine, make_node, interface, channel, axes, begin, stop),
            chores=None if lines is None else partial(press_buttons, lines),
            **options,
        )
    finally:
        if trace is not None:
            write_private(Path(trace), gauge_rows({node.name: node.module for node in served}).encode())


def gauge_rows(modules: Mapping[str, AxisModule]) -> str:
    """A row for each step of each module: axis, instant of the bus (s), position of the carriage."""
    rows = ((name, *row) for name, module in modules.items() for row in module.by_itself.gauge or ())
    return "".join(f"{name},{at:.7f},{position:.6f}\n" for name, at, position in rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the bus failed at the start; 2: bad input."""
    lines = queue.SimpleQueue[str]()
    with_buttons = partial(serve, lines=lines)
    return server_program.run(
        with_buttons, "rds.bus.modules.rds.server", "serve a machine's axis modules", arguments, lines
    )


if __name__ == "__main__":
    keep_process_private()
    leave(main())
