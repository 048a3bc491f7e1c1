"""How near planned motion is to the least time of its path, beside toppra, an optimum with jerk, and LinuxCNC.

The times are of the motion and the same on every computer; LinuxCNC's are counted in its servo periods.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import linuxcnc_simulator
from benchmarks.figures import Figure
from benchmarks.jerk_bound import least_with_jerk
from benchmarks.motion_programs import DENSE, LINES_AND_ARCS, program
from rds.interpolators.motion import Limits, plan
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.least_time import WAY, LeastTime, intervals
from rds.interpolators.motion.pieces import KIND, LENGTH, STRAIGHT
from rds.machines import load_machine
from rds.nc import interpret
from rds.nc.path_block import PathBlock
from rds.nc.toolpath import toolpath

T = 1e-3  # s
JERKLESS = 1e3  # times the jerk of the axes: as good as without a limit
GROUPS = ((LINES_AND_ARCS, 1.05), (DENSE, 1.15))  # programs, and what is asked of their ratio
SLOWER = 1.003  # toppra's least time over ours may differ by so much


class _Kept(LeastTime):
    """Keeps the pieces as well."""

    def __init__(self, limits: Limits, T: float):
        super().__init__(limits, T)
        self.pieces: list[tuple[np.ndarray, np.ndarray]] = []

    def extend(self, f: np.ndarray, u: np.ndarray) -> None:
        self.pieces.append((f.copy(), u.copy()))
        super().extend(f, u)


def run(peer_python: str = sys.executable) -> list[Figure]:
    """Each program: the plan over its least time; that by toppra over ours; and the times of LinuxCNC and ours."""
    limits = Limits.of(load_machine("mini-cnc"))
    texts = {name: program(make()) for group, _ in GROUPS for name, make in group.items()}
    asked = {name: ratio for group, ratio in GROUPS for name in group}
    figures, planned = [], {}
    for name, text in texts.items():
        blocks = list(toolpath(interpret(text)))
        seconds, certificate, kept = _planned(blocks, limits)
        without, _, _ = _planned(blocks, replace(limits, jerk=JERKLESS * limits.jerk))
        planned[name] = (seconds, without)
        ratio = seconds / kept.seconds
        peaks = ", ".join(f"{kind} {100 * worst:.1f} %" for kind, worst in _peaks(certificate))
        figures.append(Figure(f"{name}: planned / least time", "", (ratio,), asked[name], f"peaks {peaks}"))
        f, u = (np.concatenate(column) for column in zip(*kept.pieces, strict=True))
        on_lines, in_blends = (seconds / least_with_jerk(f, u, limits, T, corners) for corners in (False, True))
        figures.append(Figure(f"{name}: planned / least time, with jerk on its lines", "", (on_lines,)))
        figures.append(Figure(f"{name}: planned / the same, blends at constant speed", "", (in_blends,)))
        optimum = _peer("jerk_optimum_peer", kept, limits, peer_python)
        note = optimum if isinstance(optimum, str) else f"{optimum:.3f} s"
        runs = () if isinstance(optimum, str) else (seconds / optimum,)
        figures.append(Figure(f"{name}: planned / optimum with jerk, by collocation", "", runs, note=note))
        theirs = _peer("toppra_peer", kept, limits, peer_python)
        note = theirs if isinstance(theirs, str) else f"{theirs:.3f} s"
        runs = () if isinstance(theirs, str) else (max(theirs / kept.seconds, kept.seconds / theirs),)
        figures.append(Figure(f"{name}: toppra's least time and ours, apart", "×", runs, SLOWER, note))
    allowed = 60.0 + 2.0 * sum(seconds for seconds, _ in planned.values())
    found = linuxcnc_simulator.positions(texts, limits, allowed)
    for name, (seconds, without) in planned.items():
        figures.append(Figure(f"{name}: ours", "s", (seconds,)))
        figures.append(Figure(f"{name}: ours with {JERKLESS:g} times the jerk", "s", (without,)))
        if isinstance(found, str):
            figures.append(Figure(f"{name}: LinuxCNC", note=found))
            continue
        steps = np.diff(found[name], axis=0)
        jerk = np.abs(np.diff(steps, 2, axis=0)).max() / T**3
        note = f"its jerk is {jerk / limits.jerk[0]:.0f} times the axes'"
        figures.append(Figure(f"{name}: LinuxCNC", "s", (len(steps) * T,), note=note))
    return figures


def _planned(blocks: list[PathBlock], limits: Limits) -> tuple[float, Certificate, _Kept]:
    kept = _Kept(limits, T)
    certificate = Certificate(limits, least_time=kept)
    motion = plan(blocks, limits, T, start=np.zeros(6), least_time=kept)
    samples = sum(len(block) for block in certified(motion, certificate))
    certificate.require("benchmark")
    return (samples - 1) * T, certificate, kept


def _peaks(certificate: Certificate) -> list[tuple[str, float]]:
    shares: dict[str, float] = {}
    for (kind, axis), worst in certificate.worst.items():
        if axis:
            shares[kind] = max(shares.get(kind, 0.0), worst.share)
    return list(shares.items())


def _peer(module: str, kept: _Kept, limits: Limits, python: str) -> float | str:
    """Seconds on the same path by a module of benchmarks in its own process, or why there are none."""
    f, u = (np.concatenate(column) for column in zip(*kept.pieces, strict=True))
    rows, counts = intervals(f, u, limits.velocity, limits.acceleration, T)
    edges: list[np.ndarray] = []
    for k, part in enumerate(np.split(rows[:, WAY], np.cumsum(counts)[:-1])):
        edges.append(_divided(f[k, LENGTH]) if u[k, KIND] == STRAIGHT else part)
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "pieces.npz"
        np.savez(
            file,
            f=f,
            u=u,
            edges=np.concatenate(edges),
            counts=np.array(list(map(len, edges))),
            axes=limits.present,
            velocity=limits.velocity,
            acceleration=limits.acceleration,
            jerk=limits.jerk,
        )
        words = [python, "-m", f"benchmarks.{module}", str(file)]
        done = subprocess.run(words, cwd=Path(__file__).parents[1], capture_output=True, text=True)
    if done.returncode:
        return f"skipped: {(done.stderr.strip().splitlines() or ['ended without a word'])[-1]}"
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return float(answer["seconds"])


def _divided(length: float) -> np.ndarray:
    """Intervals of a line, which toppra passes with one acceleration each: short at both ends."""
    half = 1.2 ** np.arange(24)
    parts = np.concatenate((half, half[::-1]))
    return parts / parts.sum() * length
