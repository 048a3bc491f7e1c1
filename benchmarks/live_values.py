"""What live values and a part program cost the loop, per sample, besides the laws of the axes."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter_ns

from benchmarks.figures import Figure
from rds.interpolators.motion.segments import arc, chain, line
from rds.machines import load_machine
from rds.modes.loop.changes import LiveChanges, stop_channel
from rds.modes.loop.execution import Execution
from rds.modes.loop.laws import LiveReference
from rds.modes.loop.live_values import Channel, LiveValues
from rds.modes.loop.retimed import RetimedProgram
from rds.nc.path_block import Event, PathBlock
from rds.nc.run.prepare import planned

CHANNELS = 40
ROUNDS = 7
SAMPLES = 20_000
LIMIT = 2.0  # µs


def run() -> list[Figure]:
    """Figures in µs per sample: live values when nothing and when something changes, and a program on three axes."""
    return [
        Figure(f"a look at {CHANNELS} live values", "µs", tuple(_look() for _ in range(ROUNDS)), LIMIT),
        Figure("a sample that takes a change", "µs", tuple(_change() for _ in range(ROUNDS))),
        Figure("a program's references of three axes", "µs", tuple(_program(1.0) for _ in range(ROUNDS))),
        Figure("the same at an override of 70 %", "µs", tuple(_program(0.7) for _ in range(ROUNDS))),
    ]


def _live() -> tuple[LiveChanges, LiveValues]:
    channels = [Channel(f"value{i}", 0.0, "") for i in range(CHANNELS)]
    live_changes = LiveChanges([*channels, stop_channel()], {channel.name: lambda value: None for channel in channels})
    live_changes.live_values = LiveValues.create(None, [*channels, stop_channel()])
    return live_changes, live_changes.live_values


def _look() -> float:
    live_changes, _ = _live()
    started = perf_counter_ns()
    for k in range(SAMPLES):
        live_changes(k)
    return (perf_counter_ns() - started) / SAMPLES / 1e3


def _change() -> float:
    live_changes, live_values = _live()
    total = 0
    for k in range(2000):
        live_values.set("value7", k + 1.0)
        started = perf_counter_ns()
        live_changes(k)
        total += perf_counter_ns() - started
    return total / 2000 / 1e3


def _program(override: float) -> float:
    path = chain(line((0, 0, 0), (20, 5, -3), 10.0), arc((20, 5, -3), (20, 25, -3), (20, 15), 10.0))
    block = PathBlock(path, [Event(1, "end", 0.0, 1)])
    T = 1e-3
    program = planned([block], load_machine("mini-cnc"), T, Path("benchmark.ngc")).program
    references = [LiveReference() for _ in range(3)]
    execution = Execution(program, T, RetimedProgram(program, T), references, None, 0.0, lambda names: True)
    execution.actions()["override"](override)
    row: list[float] = []
    started = perf_counter_ns()
    k = 0
    while execution.over() is None:
        execution.law(k, (), row, [])
        k += 1
    return (perf_counter_ns() - started) / k / 1e3
