"""The live values of a run that goes on, found by the folder that it is recorded in."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rds.core.errors import InputError
from rds.modes.loop.live_values import LiveValues
from rds.modes.process.processes import is_alive
from rds.modes.process.record import PROCESSES


@contextmanager
def live_values_of(directory: str | Path) -> Iterator[LiveValues]:
    """The live values of the run in `directory`, for whoever is not its host. InputError if no run goes on there."""
    try:
        told = json.loads((Path(directory) / PROCESSES).read_text())
        path = Path(told["live_values"])
        # all of them may have been killed: the file and the memory are there then, and nobody takes from it
        if not any(is_alive(int(told[name]), path.stem) for name in ("target", "recorder")):
            raise ValueError("no process of the run is alive")
        live_values = LiveValues.open(path)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError("no run goes on there; give the folder of one that does", str(directory)) from error
    try:
        yield live_values
    finally:
        live_values.close()
