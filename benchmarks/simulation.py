"""Ten seconds of the demo's X axis, simulated: in Python, compiled, in C, and by others."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.axis import experiment
from benchmarks.c_program import CProgram
from benchmarks.figures import Figure, interleaved, ratios
from benchmarks.peers import PEERS, call
from rds.modes.experiment.compiled import obstacle, run_compiled
from rds.modes.process.host import run_plan

SAME = 1e-12  # mm
REPEATS = 50  # of the quick ones, in each round


def run(rounds: int = 7, peer_python: str = sys.executable) -> list[Figure]:
    """Everything side by side. RuntimeError if two programs that should give the same positions don't."""
    plan = experiment().plan()
    per_sample = 1e6 / plan.samples
    ours = run_plan(plan, None).values

    runs: dict[str, Callable[[], float]] = {"Python": lambda: _seconds(lambda: run_plan(plan, None))}
    skipped: dict[str, str] = {}
    first_call: tuple[float, ...] = ()
    if reason := obstacle(plan):
        skipped["compiled"] = f"skipped: {reason}"
    else:
        first_call = (_seconds(lambda: run_compiled(plan)),)
        _check("compiled=True", run_compiled(plan).values, ours)
        whole = experiment(compiled=True)
        runs["compiled"] = lambda: median(_seconds(lambda: run_compiled(plan)) for _ in range(REPEATS))
        runs["whole"] = lambda: median(_seconds(whole.run) for _ in range(5))
    with tempfile.TemporaryDirectory() as folder:
        try:
            program = CProgram(plan, Path(folder))
            _check("axis.c", program.run(1)[1], ours)
            runs["C"] = lambda: program.run(REPEATS)[0]
        except (OSError, subprocess.CalledProcessError) as error:
            skipped["C"] = f"skipped: no C compiler ({error})"
        for name in PEERS:
            answer = call(name, peer_python)
            if isinstance(answer, str):
                skipped[name] = answer
            else:
                _check(name, np.array(answer["measured"])[: plan.samples], ours[:, 4])
                runs[f"{name} ({answer['version']})"] = _peer(name, peer_python)
        times = interleaved(runs, rounds)

    def scaled(name: str) -> tuple[float, ...]:
        return tuple(value * per_sample for value in times.pop(name, ()))

    compiled, c = times.get("compiled", ()), times.get("C", ())
    return [
        Figure("the loop in Python", "µs/sample", scaled("Python"), limit=3.0),
        Figure("compiled=True, warm", "µs/sample", scaled("compiled"), note=skipped.get("compiled", "")),
        Figure("C", "µs/sample", scaled("C"), note=skipped.pop("C", "")),
        Figure("compiled=True / C", "×", ratios(compiled, c) if compiled and c else (), limit=1.5),
        Figure("compiled=True with set-up and metadata", "µs/sample", scaled("whole")),
        Figure("compiled=True, first call", "s", first_call),
        *(Figure(name, "µs/sample", scaled(name), note="same positions") for name in list(times)),
        *(Figure(name, note=reason) for name, reason in skipped.items() if name != "compiled"),
    ]


def _peer(name: str, python: str) -> Callable[[], float]:
    def seconds() -> float:
        answer = call(name, python)
        if isinstance(answer, str):
            raise RuntimeError(f"{name} ran once, but not again; {answer}")
        return float(answer["seconds"])

    return seconds


def _seconds(run: Callable[[], Any]) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started


def _check(name: str, theirs: np.ndarray, ours: np.ndarray) -> None:
    difference = float(np.abs(theirs - ours).max()) if theirs.shape == ours.shape else np.inf
    if not difference <= SAME:
        raise RuntimeError(f"{name} differs from our loop by {difference:g} mm (at most {SAME:g}); times mean nothing")
