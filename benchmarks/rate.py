"""What a path reference costs a sample, and the highest sample rate at which a loop is met, by mode and axes.

The rate is probed upwards by a quarter at a time, in runs of two seconds with the verdict of any run. A *missed* one
says that the loop cannot keep the period, and ends the search. A *void* one says nothing about the loop: something else
had the processor. It is made again, up to five times, and a rate of which all runs were void is passed over; the search
ends at two of them in a row. In implementation the built-in bus carries a command frame and an answer of each module in
every period: its rate is one over the median of that exchange, as the runs measured it. The wire's limit is what these
frames take at 1 Mbit/s.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from time import perf_counter

import rds
from benchmarks.figures import Figure, interleaved
from rds.bus.medium.bits import most_bits

ROUNDS = 7
SECONDS = 2.0
FIRST = 500.0  # Hz
STEP = 1.25
HIGHEST = 20_000.0  # Hz
TRIES = 5  # of a run that is void
VOID_RATES = 2  # in a row, after which nothing more can be learnt here
SETS = (("X",), ("X", "Y", "Z"))
COMMAND, ANSWER = 8, 8  # bytes of the frames


def run() -> list[Figure]:
    """Figures in µs and Hz."""
    found = []
    times = interleaved({"table": lambda: _cost(None), "path": lambda: _cost("tustin")}, ROUNDS)
    found.append(Figure("a sample of X and Y after a table of references, simulation", "µs", times["table"]))
    found.append(Figure("after a path, `tustin` with an s-shape filter", "µs", times["path"]))
    extra = tuple(path - table for path, table in zip(times["path"], times["table"], strict=True))
    found.append(Figure("the path's part of it", "µs", extra))
    for mode in ("emulation", "implementation"):
        for axes in SETS:
            probe = highest(mode, axes)
            name = f"highest rate that is met, {mode}, {_axes(axes)}"
            found.append(Figure(name, "Hz", (probe.met,) if probe.met else (), note=probe.ended))
            if mode == "implementation" and probe.exchanges:
                note = f"{median(probe.exchanges):.0f} µs for a command and {len(axes)} of the answers"
                rates = tuple(1e6 / took for took in probe.exchanges)
                found.append(Figure(f"the built-in bus's rate, {_axes(axes)}", "Hz", rates, note=note))
    for axes in SETS:
        bits = most_bits(COMMAND, False).total + len(axes) * most_bits(ANSWER, False).total
        found.append(Figure(f"the wire's limit at 1 Mbit/s, {_axes(axes)}", "Hz", (1e6 / bits,)))
    return found


def _axes(axes: tuple[str, ...]) -> str:
    return "one axis" if len(axes) == 1 else f"{len(axes)} axes"


def _cost(method: str | None) -> float:
    """µs per simulated sample."""
    if method is None:
        sine = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.1}
        experiment = rds.Experiment(axis=("X", "Y"), duration=12.0, reference=sine, controller={"name": "p"})
    else:
        lap = {"kind": "arc", "end": [0.0, 0.0], "centre": [5.0, 0.0]}
        reference = {
            "kind": "path",
            "interpolator": method,
            "acceleration": {"name": "s-shape", "time": 0.1},
            "start": [0.0, 0.0],
            "feed": 300,
            "segment": [lap, lap],
        }
        experiment = rds.Experiment(axis=("X", "Y"), reference=reference, controller={"name": "p"})
    plan = experiment.plan()
    from rds.modes.process.host import run_plan

    started = perf_counter()
    rows = run_plan(plan, None)
    return (perf_counter() - started) / len(rows.values) * 1e6


@dataclass
class Probe:
    """What was found: the highest rate that was met (Hz; 0: none), why the search ended there, and how long the
    exchanges with the modules took (µs, the median of each run that was met)."""

    met: float = 0.0
    ended: str = ""
    exchanges: list[float] = field(default_factory=list)


def highest(mode: str, axes: tuple[str, ...]) -> Probe:
    """Probe upwards until a run is missed, or the runs at two rates in a row are all void."""
    found, rate, void = Probe(), FIRST, list[str]()
    while rate <= HIGHEST and len(void) < VOID_RATES:
        verdict, tries, exchange = _verdict(mode, axes, rate)
        if verdict == "met":
            found.met, void = rate, []
            found.exchanges.append(exchange)
        elif verdict == "missed":
            found.ended = "; ".join([*void, f"missed at {rate:.0f} Hz"])
            return found
        else:
            void.append(f"void at {rate:.0f} Hz ({tries} runs)")
        rate *= STEP
    found.ended = "; ".join(void) or f"nothing faster than {HIGHEST:.0f} Hz was tried"
    return found


def _verdict(mode: str, axes: tuple[str, ...], rate: float) -> tuple[str, int, float]:
    """The first verdict that is not void, after how many runs, and the median of its exchanges, µs."""
    experiment = rds.Experiment(
        axis=axes,
        duration=SECONDS,
        sample_period=round(1e9 / rate) * 1e-9,
        reference={"kind": "sinusoid", "amplitude": 2.0, "frequency": 0.5},
        controller={"name": "p"},
    )
    tries, verdict = 0, "void"
    while verdict == "void" and tries < TRIES:
        tries += 1
        with tempfile.TemporaryDirectory() as folder:
            result = experiment.run(mode, out=Path(folder) / "run")
        verdict = str(result.verdict)
    return verdict, tries, float(result.meta["timing"]["io"]["p50"])
