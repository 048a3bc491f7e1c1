"""Grading: what the sandbox and five criteria add to a simulation, a batch of 1,000, here and on a cluster; peers."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import rds
from benchmarks.figures import Figure, interleaved, ratios
from benchmarks.grading_peers import autograde_seconds, nbclient_seconds
from rds.grading.assignment.assignment import read_assignment
from rds.grading.batch.grade_one import grade
from rds.grading.batch.run import run_batch
from rds.grading.sandbox import Pool, available

STUDENTS = 1000
JOBS = 2
BATCH_LIMIT = 90.0  # s
WORKERS = 4
CLUSTER_SHARE, CLUSTER_START = 1.0 / 3.0, 10.0  # of the batch's own time, and s beside it
OVER_NBGRADER = 0.2  # whole commands for one submission, in the same run
LIMITS = {"numpy": 50.0, "scipy and control": 100.0}  # ms over the simulation's own time
IMPORTS = {"numpy": "import numpy", "scipy and control": "import numpy\nimport scipy.signal\nimport control as ct"}
LAW = """
{imports}

params = {{"Kp": {gain}, "Kv": 0.567}}


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y) + params["Kv"] * r.velocity, state
"""
HEAD = """
title = "Benchmark"
kind = "controller"
files = ["controller.py"]
secret = "of the benchmark alone"
[[case]]
name = "sine"
axis = "X"
duration = 10.0
[case.reference]
kind = "sinusoid"
amplitude = 5.0
frequency = 0.2
"""
CRITERION = """
[[criterion]]
name = "{kind}"
kind = "{kind}"
case = "sine"
points = 10.0
full = {full}
none = {none}
unit = "{unit}"
"""
CRITERIA = (
    ("mean-error", 0.02, 1.0, "mm"),
    ("max-error", 0.05, 1.0, "mm"),
    ("rms-error", 0.02, 1.0, "mm"),
    ("effort", 5.0, 50.0, "V"),
    ("saturation-time", 0.1, 5.0, "s"),
)


def run(rounds: int = 7, students: int = STUDENTS, peer_python: str = sys.executable) -> list[Figure]:
    """One submission over the simulation's time; a whole batch; peers."""
    if fault := available():
        return [Figure("grading", note=f"skipped: {fault}")]
    with tempfile.TemporaryDirectory() as folder:
        place = _written(Path(folder), students)
        figures = _one(place, rounds)
        begun = perf_counter()
        run_batch(place / "task", place / "in", place / "out", jobs=JOBS)
        seconds = perf_counter() - begun
        figures.append(Figure(f"{students:,} submissions, {JOBS} jobs, in all", "s", (seconds,), BATCH_LIMIT))
        figures.append(Figure("of one submission", "ms", (1e3 * seconds / students,)))
        figures.append(_on_a_cluster(place, students, seconds))
        figures += _commands(place, peer_python)
        for name, measure in (("nbclient", nbclient_seconds), ("nbgrader autograde", autograde_seconds)):
            found = measure(place, peer_python)
            title = f"{name}, one submission: the same simulation in a notebook"
            note = found if isinstance(found, str) else ""
            figures.append(Figure(title, "ms", () if isinstance(found, str) else (1e3 * found,), note=note))
    return figures


def _on_a_cluster(place: Path, students: int, alone: float) -> Figure:
    """The same batch by workers of one thread each; as fast as they have processors of their own."""
    title = f"{students:,} submissions, dask cluster of {WORKERS} workers, in all"
    limit = CLUSTER_SHARE * alone + CLUSTER_START
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        return Figure(title, "s", limit=limit, note=f"skipped: {error}")
    with _cluster() as address:
        begun = perf_counter()
        run_batch(place / "task", place / "in", place / "there", scheduler=address)
        seconds = perf_counter() - begun
    return Figure(title, "s", (seconds,), limit, f"on {os.cpu_count()} processors")


@contextmanager
def _cluster() -> Iterator[str]:
    """A scheduler with its workers, in processes of their own; its address."""
    program = (
        "import sys\nfrom distributed import LocalCluster\nif __name__ == '__main__':\n"
        f"    cluster = LocalCluster(n_workers={WORKERS}, threads_per_worker=1, dashboard_address=None)\n"
        "    print(cluster.scheduler_address, flush=True)\n    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        yield process.stdout.readline().strip()
        process.stdin.close()
        process.wait(30)


def _commands(place: Path, peer_python: str) -> list[Figure]:
    """Whole commands for one submission: ours and nbgrader's in turn."""
    ours, theirs = [], []
    (place / "single").mkdir()
    (place / "single/ada.py").write_text((place / "numpy.py").read_text())
    for number in range(3):
        begun = perf_counter()
        words = ["grade", "run", str(place / "task"), str(place / "single"), "-o", str(place / f"single-{number}")]
        subprocess.run([sys.executable, "-m", "rds", *words], check=True, capture_output=True)
        ours.append(perf_counter() - begun)
        found = autograde_seconds(place, peer_python, 1)
        if isinstance(found, str):
            return [Figure("one submission, whole command `rds grade run`", "s", tuple(ours), note=f"nbgrader {found}")]
        theirs.append(found)
    return [
        Figure("one submission, whole command `rds grade run`", "s", tuple(ours)),
        Figure("one submission, whole command `nbgrader autograde`", "s", tuple(theirs)),
        Figure("the first over the second", "", ratios(ours, theirs), OVER_NBGRADER),
    ]


def _one(place: Path, rounds: int) -> list[Figure]:
    assignment = read_assignment(place / "task")
    experiment = rds.Experiment(
        axis="X", duration=10.0, reference=rds.sinusoid(5.0, 0.2), controller=str(place / "numpy.py")
    )
    with Pool(preload=("numpy", "scipy", "control")) as pool:

        def simulated() -> float:
            begun = perf_counter()
            experiment.run()
            return 1e3 * (perf_counter() - begun)

        def graded(name: str) -> float:
            begun = perf_counter()
            found = grade(assignment, place / f"{name}.py", "ada", pool)
            assert len(found.criteria) == len(CRITERIA) and found.score > 0.0, found
            return 1e3 * (perf_counter() - begun)

        runs = {"simulation": simulated} | {name: lambda name=name: graded(name) for name in IMPORTS}  # type: ignore[misc]
        for warm in runs.values():
            warm()
        times = interleaved(runs, rounds)
    figures = [Figure("the simulation alone, 10 s at 1 kHz", "ms", times["simulation"])]
    for name, limit in LIMITS.items():
        over = tuple(a - b for a, b in zip(times[name], times["simulation"], strict=True))
        title = f"graded in the sandbox, five criteria, imports {name}: over the simulation"
        figures.append(Figure(title, "ms", over, limit))
    return figures


def _written(place: Path, students: int) -> Path:
    """The assignment, submissions that all differ a little, and one of each kind of imports."""
    for name in ("task", "in"):
        (place / name).mkdir()
    criteria = (CRITERION.format(kind=k, full=full, none=none, unit=unit) for k, full, none, unit in CRITERIA)
    (place / "task/assignment.toml").write_text(HEAD + "".join(criteria))
    for name, imports in IMPORTS.items():
        (place / f"{name}.py").write_text(LAW.format(imports=imports, gain=30.0))
    for number in range(students):
        text = LAW.format(imports=IMPORTS["numpy"], gain=20.0 + 0.01 * number)
        (place / f"in/s{number:04}.py").write_text(text)
    return place
