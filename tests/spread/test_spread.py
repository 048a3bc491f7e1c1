"""Items on processes and on a cluster: the same outcomes, in order, whatever dies."""

from __future__ import annotations

import gc
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import types
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import spread_functions
from distributed import Client

from rds.core.errors import InputError, MachineError
from rds.core.parallel import spread
from rds.core.parallel.outcome import Failure

HERE = str(Path(__file__).parent)


@contextmanager
def cluster(words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A dask scheduler and workers, made by these arguments in a process of its own: its address, and that process."""
    program = (
        "import sys\nfrom distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        f"    cluster = LocalCluster({words}, dashboard_address=None)\n"
        "    print(cluster.scheduler_address, flush=True)\n    sys.stdin.read()\n"
    )
    environment = os.environ | {"PYTHONPATH": HERE, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdin and process.stdout
        yield process.stdout.readline().strip(), process
        process.stdin.close()
        process.wait(60)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Two workers of two threads; what lay on a worker that died is never tried again by dask itself."""
    with cluster("n_workers=2, threads_per_worker=2") as (address, _):
        yield address


@pytest.fixture(params=["processes", "cluster"])
def where(request: pytest.FixtureRequest) -> dict[str, object]:
    """Each way of spreading."""
    return {"jobs": 2} if request.param == "processes" else {"scheduler": request.getfixturevalue("scheduler")}


def test_values_in_the_order_of_the_items(where: dict[str, object]) -> None:
    seen: list[tuple[int, int]] = []
    found = list(spread(spread_functions.square, range(40), progress=lambda done, of: seen.append((done, of)), **where))
    assert [(o.index, o.value, o.ok, o.attempts) for o in found] == [(i, i * i, True, 1) for i in range(40)]
    assert seen == [(i, 40) for i in range(1, 41)]


def test_functions_of_a_notebook_travel(where: dict[str, object]) -> None:
    shift = 7
    assert [o.value for o in spread(lambda x: x + shift, [1, 2], **where)] == [8, 9]


def test_an_exception_is_an_outcome(where: dict[str, object]) -> None:
    found = list(spread(spread_functions.picky, range(5), **where))
    assert [o.ok for o in found] == [True, True, True, False, True]
    assert (found[3].failure, found[3].reason) == (Failure.RAISED, "ValueError: three will not do")


def test_a_worker_that_dies_is_replaced_and_its_item_tried_again(where: dict[str, object], tmp_path: Path) -> None:
    found = list(spread(spread_functions.deadly_once, [(i, str(tmp_path)) for i in range(12)], **where))
    assert [o.value for o in found] == list(range(12)) and (tmp_path / "died").exists()


def test_an_item_that_always_kills_its_worker_is_given_up(where: dict[str, object]) -> None:
    found = list(spread(spread_functions.deadly, range(6), **where))
    assert [o.ok for o in found] == [True, True, False, True, True, True]
    assert found[2].failure is Failure.DIED and "2 times" in found[2].reason and found[2].attempts == 2


def test_an_item_that_kills_its_process_takes_none_with_it(scheduler: str) -> None:
    function, items = spread_functions.deadly_among_many, range(24)
    there = list(spread(function, items, scheduler=scheduler))
    assert [o.index for o in there if not o.ok] == [7]
    assert there == list(spread(function, items, jobs=2))


def test_a_time_limit_ends_what_takes_too_long(where: dict[str, object]) -> None:
    found = list(spread(spread_functions.slow, range(3), retries=0, time_limit=1.5, **where))
    assert [o.ok for o in found] == [True, False, True]
    assert (found[1].failure, found[1].reason) == (Failure.OVERDUE, "it took longer than 1.5 s")


def test_a_function_that_a_worker_cannot_load_is_told(
    where: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    here_only = types.ModuleType("here_only")
    exec("def function(x):\n    return x\n", vars(here_only))
    monkeypatch.setitem(sys.modules, "here_only", here_only)
    (found,) = spread(here_only.function, [1], **where)
    assert (found.failure, found.attempts) == (Failure.RAISED, 1)
    assert found.reason == (
        "the function cannot be loaded in a worker process: ModuleNotFoundError: No module named 'here_only'"
    )


def test_what_a_function_prints_does_not_disturb(capfd: pytest.CaptureFixture[str]) -> None:
    assert [o.value for o in spread(spread_functions.loud, range(3), jobs=1)] == [0, 1, 2]
    out, err = capfd.readouterr()
    assert out == "" and err.count("noise 2") == 1


def test_each_of_the_processes_works(tmp_path: Path) -> None:
    found = list(spread(spread_functions.meeting, [(str(tmp_path), 3)] * 3, jobs=3))
    assert sorted(o.value for o in found) == [0, 1, 2], "each item waits for the two others, in processes of their own"
    assert len(list(tmp_path.iterdir())) == 3


def test_closing_it_early_leaves_no_process(where: dict[str, object]) -> None:
    found = spread(spread_functions.process, range(100), **where)
    worker = next(iter(found)).value
    found.close()  # type: ignore[attr-defined]
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the kernel's own doing")
def test_killing_it_ends_its_processes_in_the_middle_of_an_item() -> None:
    program = (
        f"import sys; sys.path.append({HERE!r})\nimport spread_functions\nfrom rds.core.parallel import spread\n"
        "list(spread(spread_functions.process_of_a_long_item, [1], jobs=1))\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE) as process:
        assert process.stderr
        worker = int(process.stderr.readline())
        process.kill()
        try:
            process.communicate(timeout=60)  # to the end of stderr: nobody is left who could write there
        except subprocess.TimeoutExpired:
            os.kill(worker, signal.SIGKILL)
            raise


def test_ctrl_c_ends_it_and_its_processes() -> None:
    program = (
        f"import sys; sys.path.append({HERE!r})\nimport spread_functions\nfrom rds.core.parallel import spread\n"
        "for o in spread(spread_functions.process, range(10000), jobs=2): print(o.value, flush=True)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout and process.stderr
        worker = int(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        said = process.stderr.read().decode()
        process.wait(20)
    assert said.rstrip().endswith("KeyboardInterrupt")
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_nothing_to_do() -> None:
    assert list(spread(spread_functions.square, [])) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"jobs": 0}, "jobs = 0 must be at least 1"),
        ({"retries": -1}, "retries = -1"),
        ({"jobs": 1, "scheduler": "tcp://127.0.0.1:1"}, "give one of them"),
        ({"scheduler": "tcp://127.0.0.1:1"}, "no dask scheduler answers within 0.3 s"),
        ({"scheduler": "nowhere at all"}, "is no address of a dask scheduler; give tls://HOST:PORT"),
    ],
)
def test_what_will_not_do_is_said_at_once(
    options: dict[str, object], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.core.parallel.cluster.CONNECT", 0.3)
    with pytest.raises(InputError, match=re.escape(said)):
        spread(spread_functions.square, [1], **options)


def test_a_scheduler_that_is_lost_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.core.parallel.cluster.CONNECT", 2.0)  # dask looks for it so long before it lets go
    with cluster("n_workers=1, threads_per_worker=1, processes=False, protocol='tcp'") as (address, process):
        found = spread(spread_functions.slow, range(3), scheduler=address)
        assert next(iter(found)).value == 0
        process.kill()
        with pytest.raises(MachineError, match="is gone, and with it what was at work there; start it again"):
            next(iter(found))


def test_what_is_no_scheduler_is_refused_whatever_it_answers() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:

        def answer() -> None:
            connection, _ = other.accept()
            with connection:
                connection.recv(1000)
                connection.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n")  # a length of 3 EiB, to dask

        threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(InputError, match="no dask scheduler answers"):
            spread(spread_functions.square, [1], scheduler=f"tcp://127.0.0.1:{other.getsockname()[1]}")


def test_a_scheduler_that_was_refused_leaves_nothing_behind() -> None:
    def left() -> list[object]:
        found = [each for each in gc.get_objects() if issubclass(type(each), Client) and each.status != "closed"]
        return [*found, *(each for each in threading.enumerate() if "loop" in each.name or "cluster" in each.name)]

    before = left()
    with pytest.raises(InputError, match="no dask scheduler answers"):
        spread(spread_functions.square, [1], scheduler="tcp://127.0.0.1:1")
    assert left() == before


def test_as_they_come_nothing_waits_for_the_slowest(where: dict[str, object], tmp_path: Path) -> None:
    work = [(number, str(tmp_path)) for number in range(20)]
    found = [outcome.index for outcome in spread(spread_functions.slow_first, work, in_order=False, **where)]
    assert sorted(found) == list(range(20))
    assert found[0] != 0


# The last one on this cluster: dask does not replace a worker that dies in the moment in which it has just begun.
def test_what_lay_on_a_worker_of_the_cluster_that_died_is_done_again(scheduler: str) -> None:
    found = list(spread(spread_functions.deadly_to_its_parent, range(24), scheduler=scheduler, retries=0))
    assert [o.index for o in found if not o.ok] == [7]
    assert found[7].failure is Failure.DIED and found[7].attempts == 1
    assert "the cluster's worker that had it ended" in found[7].reason
