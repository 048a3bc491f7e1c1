"""Grading: what the sandbox and five criteria add to a simulation; batches, their memory, a cluster; peers."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import rds
from benchmarks.figures import Figure, interleaved, ratios
from benchmarks.grading_peers import autograde_seconds, nbclient_seconds
from rds.grading.assignment.assignment import read_assignment
from rds.grading.batch.grade_one import grade
from rds.grading.sandbox import Pool, available

STUDENTS = 1000
SMALLER = (100, 300)  # classes whose memory is measured beside that of the whole one
GROWTH = 1.1  # of memory, from the smallest class to the largest
JOBS = 2
BATCH_LIMIT = 90.0  # s
WORKERS = 4
FEWER, FEWER_STUDENTS = 2, 300  # a smaller cluster, whose workers have a processor each here
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
# what students write beside the law: passages of which many in a class have some in common
FORMS = (
    "x = 1",
    "f(x)",
    "x += y",
    "x = [y]",
    "x = -y",
    "x = y if x else 1",
    "x = {y: 1}",
    "x = y[1]",
    "x = y.z",
    "if x:\n        y = 1",
    "for x in y:\n        x = 2",
    "x = f(y, x)",
    "x = (y, 2)",
    "x = y * x",
    "x = y < x",
)
FUNCTIONS, STATEMENTS = 7, 10  # of a submission: about 1.5 kB
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
        whole = _batch(place, students, jobs=JOBS)
        figures.append(Figure(f"{students:,} submissions, {JOBS} jobs, in all", "s", (whole.seconds,), BATCH_LIMIT))
        figures.append(Figure("of one submission", "ms", (1e3 * whole.seconds / students,)))
        figures += _memory(place, whole, students)
        figures += _clusters(place, students, whole.seconds)
        figures += _commands(place, peer_python)
        for name, measure in (("nbclient", nbclient_seconds), ("nbgrader autograde", autograde_seconds)):
            found = measure(place, peer_python)
            title = f"{name}, one submission: the same simulation in a notebook"
            note = found if isinstance(found, str) else ""
            figures.append(Figure(title, "ms", () if isinstance(found, str) else (1e3 * found,), note=note))
    return figures


class _Batch(NamedTuple):
    """A batch in a process of its own: s, the largest memory of it and of one of its workers, its processor time."""

    seconds: float
    main_mb: float
    worker_mb: float
    main_cpu_seconds: float


_PROGRAM = """
import json, re, sys, time
from pathlib import Path
from rds.grading.batch.run import run_batch

def peak(process):  # MB; of the program that runs there now
    try: found = re.search(r"VmHWM:\\s*(\\d+)", Path(f"/proc/{process}/status").read_text())
    except OSError: return 0.0
    return int(found[1]) / 1024 if found else 0.0

def look(done, of):
    for path in Path("/proc/self/task").glob("*/children"):
        for child in path.read_text().split():
            workers.append(peak(child))
    workers[:] = [max(workers, default=0.0)]

workers, (task, handed_in, out, how) = [], sys.argv[1:]
begun = time.perf_counter()
run_batch(task, handed_in, out, progress=look, **json.loads(how))
print(json.dumps([time.perf_counter() - begun, peak("self"), max(workers), time.process_time()]))
"""


def _batch(place: Path, students: int, **how: int | str) -> _Batch:
    """The first `students` of the class, graded."""
    handed_in, out = place / f"in-{students}", place / f"out-{students}-{len(list(place.iterdir()))}"
    if not handed_in.exists():
        handed_in.mkdir()
        for path in sorted((place / "in").iterdir())[:students]:
            shutil.copy(path, handed_in)
    words = [sys.executable, "-c", _PROGRAM, *map(str, (place / "task", handed_in, out)), json.dumps(how)]
    done = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    shutil.rmtree(out)
    return _Batch(*json.loads(done.stdout))


def _memory(place: Path, whole: _Batch, students: int) -> list[Figure]:
    """The largest memory by the size of the class; it is to be flat."""
    found = {count: _batch(place, count, jobs=JOBS) for count in SMALLER if count < students} | {students: whole}
    figures = []
    for name, at in (("the command itself", "main_mb"), ("a worker", "worker_mb")):
        peaks = {count: getattr(batch, at) for count, batch in found.items()}
        note = "; ".join(f"{count:,}: {peak:.0f} MB" for count, peak in peaks.items())
        figures.append(Figure(f"memory of {name}, {students:,} submissions", "MB", (peaks[students],), note=note))
        growth = (peaks[students] / next(iter(peaks.values())),)
        figures.append(Figure(f"memory of {name}, over that of the smallest class", "", growth, GROWTH))
    return figures


def _clusters(place: Path, students: int, alone: float) -> list[Figure]:
    """The same batch by workers of one thread each; as fast as they have processors of their own."""
    title = f"{students:,} submissions, dask cluster of {WORKERS} workers, in all"
    limit, processors = CLUSTER_SHARE * alone + CLUSTER_START, os.cpu_count() or 1
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        return [Figure(title, "s", limit=limit, note=f"skipped: {error}")]
    with _cluster(FEWER) as cluster:
        fewer = _batch(place, min(FEWER_STUDENTS, students), scheduler=cluster.address)
    with _cluster(WORKERS) as cluster:
        start = _batch(place, WORKERS, scheduler=cluster.address).seconds
        before = cluster.cpu_seconds()
        batch = _batch(place, students, scheduler=cluster.address)
        alone_at_it = batch.main_cpu_seconds + cluster.cpu_seconds() - before
    by_four = start + (batch.seconds - start) * min(processors, WORKERS) / WORKERS
    return [
        Figure(title, "s", (batch.seconds,), limit, f"on {processors} processors"),
        Figure(f"of it start: {WORKERS} submissions, one for each worker", "s", (start,)),
        Figure("of it the command and the scheduler, processor time of one", "ms", (1e3 * alone_at_it / students,)),
        Figure(
            f"the same on {WORKERS} processors: what was busy here, shared out", "s", (by_four,), note="by the model"
        ),
        Figure(f"of one submission, dask cluster of {FEWER} workers", "ms", (1e3 * fewer.seconds / FEWER_STUDENTS,)),
    ]


class _Cluster(NamedTuple):
    address: str
    process: int  # of the scheduler

    def cpu_seconds(self) -> float:
        """Processor time of the scheduler's process so far."""
        fields = Path(f"/proc/{self.process}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _cluster(workers: int) -> Iterator[_Cluster]:
    """A scheduler with its workers, in processes of their own."""
    program = (
        "import sys\nfrom distributed import LocalCluster\nif __name__ == '__main__':\n"
        f"    cluster = LocalCluster(n_workers={workers}, threads_per_worker=1, dashboard_address=None)\n"
        "    print(cluster.scheduler_address, flush=True)\n    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        yield _Cluster(process.stdout.readline().strip(), process.pid)
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
    """The assignment, submissions of the same law and a lot beside it, and one of each kind of imports."""
    draw = random.Random(3)
    for name in ("task", "in"):
        (place / name).mkdir()
    criteria = (CRITERION.format(kind=k, full=full, none=none, unit=unit) for k, full, none, unit in CRITERIA)
    (place / "task/assignment.toml").write_text(HEAD + "".join(criteria))
    for name, imports in IMPORTS.items():
        (place / f"{name}.py").write_text(LAW.format(imports=imports, gain=30.0))
    for number in range(students):
        text = LAW.format(imports=IMPORTS["numpy"], gain=20.0 + 0.01 * number)
        for function in range(FUNCTIONS):
            body = "\n    ".join(draw.choice(FORMS) for _ in range(STATEMENTS))
            text += f"\n\ndef helper_{function}(f, x, y):\n    {body}\n    return x\n"
        (place / f"in/s{number:04}.py").write_text(text)
    return place
