"""Part programs: reading beside other readers, planning against the motion's duration, memory while streaming.

python -m benchmarks.nc read|plan FILE does that with a file in a process of its own and prints its memory's peak in MB.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from benchmarks.figures import Figure, interleaved, ratios
from benchmarks.nc_peers import PEERS, call, rs274
from benchmarks.nc_program import write_ball, write_program
from benchmarks.nc_whole import floor, whole
from rds.nc import interpret
from rds.nc.language import fast_lane
from rds.nc.language.canon_text import text

LINES = 200_000
TIP_LINES = 100_000
SHORT = 20_000  # for what is slow
MEMORY = {"read": (20_000, 200_000, 2_000_000), "plan": (200_000, 400_000)}  # lines; blocks hold up to 65,536 moves
T = 1e-3  # s
SLOWING = ("PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED")


def run(rounds: int = 5, peer_python: str = sys.executable) -> list[Figure]:
    """Everything, by turns."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        return [
            *reading(place, rounds, peer_python),
            *whole(place, rounds),
            floor(rounds),
            *planning(place, min(rounds, 3)),
            *tip_planning(place, min(rounds, 3)),
            *memory(place),
        ]


def reading(place: Path, rounds: int, peer_python: str) -> list[Figure]:
    """Lines a second, and how much longer than rs274 it takes us."""
    long, short = write_program(place / "long.ngc", LINES), write_program(place / "short.ngc", SHORT)
    compiled = fast_lane.kernel() is not None
    runs: dict[str, Callable[[], float]] = {}
    skipped: dict[str, str] = {}
    if compiled:
        first = (_seconds(lambda: _count(short)),)
        _seconds(lambda: _print(short))
        runs["ours"] = lambda: _seconds(lambda: _count(long))
        runs["text"] = lambda: _seconds(lambda: _print(long))
    _command(short, place)  # Python keeps its bytecode
    runs["command"] = lambda: _seconds(lambda: _command(long, place))
    runs["Python"] = lambda: _in_python(long)
    if rs274(short) is None:
        skipped["rs274 -g"] = "skipped: rs274 (Debian: linuxcnc-uspace) is not installed"
    else:
        runs["rs274 -g"] = lambda: rs274(long) or 0.0
    versions = {}
    for name in PEERS:
        answer = call(name, short, peer_python)
        if isinstance(answer, str):
            skipped[name] = answer
        else:
            versions[name] = str(answer["version"])
            runs[name] = _peer(name, short, peer_python)
    times = interleaved(runs, rounds)

    def rate(name: str, lines: int = LINES) -> tuple[float, ...]:
        return tuple(lines / seconds for seconds in times.get(name, ()))

    def beside(name: str) -> tuple[float, ...]:
        return ratios(times.get(name, ()), times["rs274 -g"]) if "rs274 -g" in times and name in times else ()

    none = "" if compiled else "skipped: numba is not installed"
    return [
        Figure("interpret", "lines/s", rate("ours"), note=none or f"{LINES:,} lines, {first[0]:.1f} s the first time"),
        Figure("interpret and write the calls to /dev/null", "lines/s", rate("text"), note=none),
        Figure("rds nc canon FILE > /dev/null, whole process", "lines/s", rate("command")),
        Figure("interpret in Python (without numba)", "lines/s", rate("Python")),
        Figure("rs274 -g FILE > /dev/null", "lines/s", rate("rs274 -g"), note=skipped.get("rs274 -g", "")),
        Figure("interpret / rs274", "× its time", beside("ours"), limit=1.0),
        Figure("interpret and write / rs274", "× its time", beside("text"), limit=1.0),
        Figure("whole process / rs274", "× its time", beside("command")),
        Figure("in Python / rs274", "× its time", beside("Python")),
        *(
            Figure(versions.get(name, name), "lines/s", rate(name, SHORT), note=skipped.get(name, "only words"))
            for name in PEERS
        ),
    ]


def planning(place: Path, rounds: int) -> list[Figure]:
    """From the file to samples at 1 ms of the mini-CNC's axes: computing time per time of motion."""
    from rds.core.compiling import compile_tiered

    compile_tiered()  # the short program is over before the planner would be compiled
    file = write_program(place / "planned.ngc", LINES)
    _plan(write_program(place / "short.ngc", SHORT // 10))  # compiles
    results = [_plan(file) for _ in range(rounds)]
    duration = results[0][1]
    return [
        Figure("interpret and plan / duration of the motion", "", tuple(a / b for a, b in results), limit=0.02),
        Figure(
            "duration of the motion / interpret and plan",
            "×",
            tuple(b / a for a, b in results),
            note=f"{LINES:,} lines, {duration:,.0f} s of motion in samples of {1e3 * T:g} ms",
        ),
    ]


def tip_planning(place: Path, rounds: int) -> list[Figure]:
    """The same of a program for the tool's tip on a 5-axis machine: to joints, and to samples within their limits."""
    from rds.machines import load_machine
    from rds.nc.check import motion
    from rds.nc.cycle_time import cycle_time
    from rds.nc.setup import Setup

    file, machine = write_ball(place / "ball.ngc", TIP_LINES), load_machine("xyzac")
    _ = cycle_time(motion(write_ball(place / "small.ngc", 2000), machine, Setup()), machine)  # compiles
    to_joints, whole, seconds = [], [], 0.0
    for _ in range(rounds):
        to_joints.append(TIP_LINES / _seconds(lambda: sum(map(len, motion(file, machine, Setup())))))
        started = time.perf_counter()
        seconds = cycle_time(motion(file, machine, Setup()), machine, T).total
        whole.append(TIP_LINES / (time.perf_counter() - started))
    note = f"{TIP_LINES:,} lines of X Y Z A C under G43.4, {seconds:,.0f} s of motion in samples of {1e3 * T:g} ms"
    return [
        Figure("five axes: interpret, check and make moves of the joints", "lines/s", tuple(to_joints)),
        Figure("five axes: the same and plan", "lines/s", tuple(whole), note=note),
    ]


def _plan(file: Path) -> tuple[float, float]:
    """Seconds that it takes, and seconds of motion."""
    from rds.interpolators.motion import Limits, plan
    from rds.machines import load_machine
    from rds.nc.toolpath import toolpath

    limits = Limits.of(load_machine("mini-cnc"))
    started = time.perf_counter()
    samples = sum(len(block) for block in plan(toolpath(interpret(file)), limits, T))
    return time.perf_counter() - started, samples * T


def memory(place: Path) -> list[Figure]:
    """The peak of a process that reads programs of several lengths, or plans their motion: it should not grow."""
    figures = []
    for work, lengths in MEMORY.items():
        peaks = []
        for lines in lengths:
            file = write_program(place / "memory.ngc", lines)
            words = [sys.executable, "-m", "benchmarks.nc", work, str(file)]
            done = subprocess.run(words, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=True)
            peaks.append(float(done.stdout))
            figures.append(Figure(f"memory's peak, {work}, {lines:,} lines", "MB", (peaks[-1],)))
        name = f"memory's peak, {work}, {lengths[-1]:,} / {lengths[0]:,} lines"
        figures.append(Figure(name, "×", (peaks[-1] / peaks[0],), limit=1.05))
    return figures


def _seconds(run: Callable[[], object]) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started


def _count(file: Path) -> int:
    return sum(1 for _ in interpret(file))


def _print(file: Path) -> None:
    with Path("/dev/null").open("w", encoding="utf-8") as out:
        out.writelines(f"{line}\n" for line in text(interpret(file)))


def _command(file: Path, bytecode: Path) -> None:
    """With Python's bytecode at hand, as it is in any installation but where that is switched off."""
    words = [sys.executable, "-m", "rds", "nc", "canon", str(file)]
    settings = {name: value for name, value in os.environ.items() if name not in SLOWING}
    subprocess.run(words, env=settings | {"PYTHONPYCACHEPREFIX": str(bytecode)}, stdout=subprocess.DEVNULL, check=True)


def _in_python(file: Path) -> float:
    with _closed_lane():
        return _seconds(lambda: _count(file))


@contextmanager
def _closed_lane() -> Iterator[None]:
    with (
        patch.object(fast_lane, "kernel", lambda: None),
        patch.object(fast_lane, "stored", lambda: None),
        patch.object(fast_lane, "is_loaded", lambda: False),
    ):
        yield


def _peer(name: str, file: Path, python: str) -> Callable[[], float]:
    def seconds() -> float:
        answer = call(name, file, python)
        if isinstance(answer, str):
            raise RuntimeError(f"{name} ran once, but not again; {answer}")
        return float(answer["seconds"])

    return seconds


def _peak() -> float:
    """MB that this process has had at most (Linux; not ru_maxrss, which a process inherits)."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


if __name__ == "__main__":
    fast_lane.kernel()  # loaded whatever the length
    {"read": _count, "plan": _plan}[sys.argv[1]](Path(sys.argv[2]))
    print(_peak())
