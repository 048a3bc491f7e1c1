"""Batches on a dask cluster: the same results, workers that die are replaced, a worker without a sandbox is told."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.batch.run import run_batch
from rds.grading.sandbox import available
from tests.grading.batches import ASSIGNMENT, law, put
from tests.grading.made import assignment_in

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))

PROGRAM = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    print(cluster.scheduler_address, *(worker.pid for worker in cluster.workers.values()), flush=True)
    sys.stdin.read()
"""


@contextmanager
def cluster(**environment: str) -> Iterator[tuple[str, list[int]]]:
    """A scheduler with two workers in processes of their own: its address, their numbers."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | environment,
    ) as process:
        assert process.stdin and process.stdout
        address, *workers = process.stdout.readline().split()
        yield address, [int(number) for number in workers]
        process.stdin.close()
        process.wait(30)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The assignment in `task`, submissions in `in`."""
    folder = tmp_path_factory.mktemp("cluster")
    assignment_in(folder / "task", ASSIGNMENT, law())
    put(folder / "in", {f"s{n}.py": law(10.0 + n) for n in range(8)})
    put(folder / "in", {"exit.py": "import os\nos._exit(0)\n", "broken.py": "def control(:\n"})
    return folder


def test_the_same_scores_though_a_worker_is_killed(place: Path) -> None:
    here = run_batch(place / "task", place / "in", place / "here")
    with cluster() as (address, workers):

        def kill_one(done: int, of: int) -> None:
            if done == 1:
                os.kill(workers[0], signal.SIGKILL)

        there = run_batch(place / "task", place / "in", place / "there", scheduler=address, progress=kill_one)
    assert there.grades == here.grades and len(there.grades) == 10


def test_a_worker_without_the_sandbox_is_told(place: Path) -> None:
    said = "a worker cannot grade: bubblewrap is missing"
    with cluster(PATH=str(Path(sys.executable).parent)) as (address, _), pytest.raises(InputError, match=said):
        run_batch(place / "task", place / "in", place / "bare", scheduler=address)
    assert not (place / "bare").exists()


def test_no_scheduler_is_refused(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.core.parallel.cluster.CONNECT", 0.3)
    with pytest.raises(InputError, match="no dask scheduler answers"):
        run_batch(place / "task", place / "in", place / "nobody", scheduler="tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="give one of them"):
        run_batch(place / "task", place / "in", place / "both", scheduler="tcp://127.0.0.1:1", jobs=2)
    assert not (place / "nobody").exists() and not (place / "both").exists()
