"""What tests do to runs, and controllers that behave in known ways."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rds
from rds.modes.process.recorder import PROCESSES


def process(folder: Path, name: str) -> int:
    """The number of the run's process with this name."""
    return int(json.loads((folder / PROCESSES).read_text())[name])


def send(folder: Path, name: str, number: int = signal.SIGKILL) -> None:
    """Send a signal to the run's process with this name."""
    os.kill(process(folder, name), number)


def busy(seconds: float) -> None:
    """Compute for so long: time on a processor, as work takes, and not on the wall."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def every(samples: int, what: Callable[[], Any]) -> rds.Controller:
    """A proportional controller that does something at every so many samples."""

    def control(t: float, r: Any, y: float, state: int, params: Any) -> tuple[float, int]:
        if state % samples == samples - 1:
            what()
        return 10.0 * (r.position - y), state + 1

    return rds.Controller(control, 0)
