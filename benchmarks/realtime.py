"""The real-time loop at 1 kHz beside cyclictest, on the same machine at the same time; quiet, and with a busy host."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from benchmarks.axis import experiment
from benchmarks.cyclictest import Cyclictest
from benchmarks.figures import Figure, ratios
from rds.results import Result

NOISE = 1.0  # µs: what nobody would call a change, however alike the quiet runs are


@dataclass(frozen=True)
class Run:
    """Lateness of our loop and of cyclictest, µs, and the result."""

    ours: dict[str, float]
    theirs: dict[str, float]
    result: Result


def run(rounds: int = 3, seconds: float = 30.0) -> list[Figure]:
    """Emulations of the X axis, in turn with a quiet and a busy host."""
    cyclictest = Cyclictest()
    quiet, busy = [], []
    for _ in range(rounds):
        quiet.append(_emulate(seconds, cyclictest))
        with busy_thread():
            busy.append(_emulate(seconds, cyclictest))
    return [*_beside(quiet, cyclictest.obstacle), *_changes(quiet, busy), *_verdicts(quiet, busy)]


@contextmanager
def busy_thread() -> Iterator[None]:
    """A thread of this process that computes all the time."""
    going_on = True

    def compute() -> None:
        while going_on:
            sum(range(1000))

    thread = threading.Thread(target=compute, daemon=True)
    thread.start()
    try:
        yield
    finally:
        going_on = False
        thread.join()


def _emulate(seconds: float, cyclictest: Cyclictest) -> Run:
    def progress(taken: int, samples: int) -> None:
        if 0 < taken < samples:
            cyclictest.start()  # with the first samples, so that both meet the same disturbances

    with tempfile.TemporaryDirectory() as folder:
        try:
            result = experiment(seconds).run("emulation", out=folder, progress=progress)
        finally:
            theirs = cyclictest.stop()
    lateness: dict[str, Any] = result.meta["timing"]["lateness"]
    return Run({name: lateness[name] for name in ("p50", "p99", "max")}, theirs, result)


def _beside(quiet: list[Run], obstacle: str) -> list[Figure]:
    figures = [
        Figure("lateness p50", "µs", _of(quiet, "ours", "p50"), limit=5.0),
        Figure("lateness p99", "µs", _of(quiet, "ours", "p99")),
        Figure("lateness max", "µs", _of(quiet, "ours", "max")),
    ]
    if obstacle:
        return [*figures, Figure("cyclictest", note=obstacle)]
    ours, theirs = _of(quiet, "ours", "p99"), _of(quiet, "theirs", "p99")
    return [
        *figures,
        *(Figure(f"cyclictest {name}", "µs", _of(quiet, "theirs", name)) for name in ("p50", "p99", "max")),
        Figure("lateness p99 / cyclictest's p99", "×", ratios(ours, [max(value, 1.0) for value in theirs]), limit=1.0),
    ]


def _changes(quiet: list[Run], busy: list[Run]) -> list[Figure]:
    figures = []
    for name in ("p50", "p99", "max"):
        before, after = _of(quiet, "ours", name), _of(busy, "ours", name)
        figures.append(Figure(f"lateness {name}, busy thread in the host", "µs", after))
        if name != "max":
            noise = max(NOISE, max(before) - min(before))
            change = tuple(b - a for a, b in zip(before, after, strict=True))
            note = f"noise: {noise:.2g} µs, the quiet runs' spread or {NOISE:g}"
            figures.append(Figure(f"change of {name} by the busy thread", "µs", change, limit=noise, note=note))
    if all(run.theirs for run in busy):
        figures += [Figure(f"cyclictest {name}, busy host", "µs", _of(busy, "theirs", name)) for name in ("p99", "max")]
    return figures


def _verdicts(quiet: list[Run], busy: list[Run]) -> list[Figure]:
    figures = []
    for title, runs in (("quiet", quiet), ("busy", busy)):
        late = tuple(float(run.result.meta["timing"]["late"]) for run in runs)
        verdicts = ", ".join(str(run.result.verdict) for run in runs)
        figures.append(Figure(f"late samples, {title}", f"of {quiet[0].result.meta['timing']['samples']}", late))
        figures.append(Figure(f"verdicts, {title}", note=verdicts))
    return [*figures, Figure("environment", note=quiet[0].result.meta["environment"]["sentence"])]


def _of(runs: list[Run], whose: str, name: str) -> tuple[float, ...]:
    return tuple(getattr(run, whose)[name] for run in runs if getattr(run, whose))
