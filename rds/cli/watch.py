"""`rds scan --watch`: modules as they come and go, and when the machine can be used again."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import typer

from rds.cli.common import print_json, until_ctrl_c

_INTERVAL = 0.1  # s between two looks; what is gone is noticed at the third


def watch(bus: Any, json: bool, events: Path | None, modules: int | None, seconds: float | None, force: bool) -> None:
    """Watch the modules on an open bus until Ctrl-C, or for `seconds`; say and write down what happens."""
    from rds.bus.modules.oacs.events import EventFile, Reconfigurations

    with ExitStack() as stack:
        watching = Reconfigurations(bus, modules)
        file = EventFile(events, force) if events is not None else None
        if file is not None:
            stack.callback(file.close)
        stop = stack.enter_context(until_ctrl_c())
        ends = None if seconds is None else time.monotonic() + seconds
        rows: list[dict[str, Any]] = []
        while not stop.is_set() and (ends is None or time.monotonic() < ends):
            for happened in watching.look():
                if file is not None:
                    file.add(happened)
                rows.append({"time_s": round(happened.time, 3), "event": happened.event, "module": happened.module})
                if not json:
                    typer.echo(f"{happened.time:9.3f} s  {happened.event:8} {happened.module}")
            stop.wait(_INTERVAL)
    if json:
        print_json({"expected": watching.expected, "events": rows})
