"""A log of a million rows described and fitted by the command line, beside pandas' reading of the same file.

X of the mini CNC for 1,000 s at 1 kHz under a multisine, as a CSV file of 24 MB. Each figure is of a whole process,
from Python's start to its end: seconds by the clock, seconds of the processors, and the most memory that it held.
"""

from __future__ import annotations

import atexit
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure
from benchmarks.identification import made_log

ROWS = 1_000_000
_SECONDS = {"describe": 2.0, "fit": 20.0, "pandas": None}
_MEGABYTES = 1000.0
_NAMES = {
    "describe": "`rds data describe`",
    "fit": "`rds fit --structure axis`",
    "pandas": "`pandas.read_csv` of the same file",
}


def run(rounds: int = 3) -> list[Figure]:
    """Everything in turn, after a first round that only warms up: compiled code, the file in the system's memory."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "million.csv"
        _write(file)
        works = {
            "describe": ["data", "describe", str(file)],
            "fit": ["fit", str(file), "--structure", "axis"],
            "pandas": ["pandas", str(file)],
        }
        found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in works}
        for number in range(rounds + 1):
            for name, words in works.items():
                measured = _process(words)
                if number:
                    found[name].append(measured)
    figures = []
    for name, measures in found.items():
        clock, processors, memory = (tuple(column) for column in zip(*measures, strict=True))
        figures += [
            Figure(f"{_NAMES[name]}, by the clock", "s", clock, limit=_SECONDS[name]),
            Figure(f"{_NAMES[name]}, of the processors", "s", processors),
            Figure(f"{_NAMES[name]}, memory's peak", "MB", memory, limit=None if name == "pandas" else _MEGABYTES),
        ]
    return figures


def _write(file: Path) -> None:
    log = made_log(ROWS)
    columns = np.column_stack([log.time, log.command, log.position])
    np.savetxt(
        file, columns, fmt=["%.3f", "%.4f", "%.3f"], delimiter=",", header="time [s],u [V],position [mm]", comments=""
    )


def _process(words: list[str]) -> tuple[float, float, float]:
    """Seconds by the clock and of the processors, and MB."""
    begun = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.million_rows", *words],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    elapsed = time.perf_counter() - begun
    processors, memory = json.loads(done.stderr.splitlines()[-1])
    return elapsed, processors, memory


def _tell() -> None:
    status = Path("/proc/self/status").read_text()  # not ru_maxrss, which a process inherits
    memory = int(status.partition("VmHWM:")[2].split()[0]) / 1024
    print(json.dumps([time.process_time(), memory]), file=sys.stderr)


def _read_by_pandas() -> None:
    import pandas as pd

    pd.read_csv(sys.argv[2])


def _work() -> Callable[[], None]:
    if sys.argv[1] == "pandas":
        return _read_by_pandas
    from rds.__main__ import main

    sys.argv[0] = "rds"
    return main


if __name__ == "__main__":
    atexit.register(_tell)
    _work()()
