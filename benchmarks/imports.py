"""How long it takes until something can be typed: imports and the command line, in fresh processes."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable

from benchmarks.figures import Figure, interleaved

_TIMED = "import time; started = time.perf_counter(); {}; print(time.perf_counter() - started)"


def run(rounds: int = 7) -> list[Figure]:
    """Seconds of each."""
    runs: dict[str, Callable[[], float]] = {
        "import rds": lambda: _inside("import rds"),
        "from rds import Experiment": lambda: _inside("from rds import Experiment"),
        "rds --help, whole process": _help,
    }
    limits = {"import rds": 0.3}
    return [Figure(name, "s", values, limits.get(name)) for name, values in interleaved(runs, rounds).items()]


def _inside(statement: str) -> float:
    command = [sys.executable, "-c", _TIMED.format(statement)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def _help() -> float:
    command = [sys.executable, "-c", "import sys; from rds.cli.main import main; sys.argv = ['rds', '--help']; main()"]
    started = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started
