"""How long it takes until something can be typed: imports and the command line, in fresh processes."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.figures import Figure, interleaved, ratios

_RUN = "rds run of 10 s at 1 kHz, result, table and picture saved, whole process"
_ALONE = "the same in one process, which draws its picture itself"
_LIBRARIES = "import scipy.signal, matplotlib.pyplot, whole process"
_LAW = "def control(t, r, y, state, params):\n    return 30.0 * (r.position - y), state\n"
_EXPERIMENT = """
machine = "mini-cnc"
axis = "X"
mode = "simulation"
duration = 10.0
sample_period = 0.001
reference = {kind = "sinusoid", amplitude = 5.0, frequency = 0.2}
controller = {file = "law.py"}
"""
_TIMED = "import time; started = time.perf_counter(); {}; print(time.perf_counter() - started)"


def run(rounds: int = 7) -> list[Figure]:
    """Seconds of each."""
    runs: dict[str, Callable[[], float]] = {
        "import rds": lambda: _inside("import rds"),
        "from rds import Experiment": lambda: _inside("from rds import Experiment"),
        "rds --help, whole process": lambda: _command("--help"),
        _RUN: lambda: _run("-m", "rds"),
        _ALONE: lambda: _run("-c", "import os; del os.fork; from rds.__main__ import main; main()"),
        _LIBRARIES: lambda: _process("-c", "import scipy.signal, matplotlib.pyplot"),
    }
    limits = {"import rds": 0.3}
    times = interleaved(runs, rounds)
    figures = [Figure(name, "s", values, limits.get(name)) for name, values in times.items()]
    figures.append(Figure("the run / the same in one process", "×", ratios(times[_RUN], times[_ALONE])))
    return [*figures, Figure("the run / the two imports", "×", ratios(times[_RUN], times[_LIBRARIES]), 0.6)]


def _inside(statement: str) -> float:
    command = [sys.executable, "-c", _TIMED.format(statement)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def _run(*how: str) -> float:
    """The README's first experiment."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "law.py").write_text(_LAW)
        Path(folder, "first.toml").write_text(_EXPERIMENT)
        return _process(*how, "run", f"{folder}/first.toml", "--out", f"{folder}/first")


def _command(*words: str) -> float:
    return _process("-m", "rds", *words)


def _process(*words: str) -> float:
    started = time.perf_counter()
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started
