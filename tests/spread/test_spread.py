"""Items on processes and on a cluster: the same outcomes, in order, whatever dies."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import spread_functions

from rds.core.errors import InputError
from rds.spread import spread
from rds.spread.outcome import Failure

HERE = str(Path(__file__).parent)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """A dask scheduler with two workers, in processes of its own."""
    program = (
        "import sys\nfrom distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)\n"
        "    print(cluster.scheduler_address, flush=True)\n    sys.stdin.read()\n"
    )
    environment = os.environ | {"PYTHONPATH": HERE, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdin and process.stdout
        yield process.stdout.readline().strip()
        process.stdin.close()
        process.wait(20)


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


def test_a_time_limit_ends_what_takes_too_long() -> None:
    found = list(spread(spread_functions.slow, range(3), jobs=2, retries=0, time_limit=1.5))
    assert [o.ok for o in found] == [True, False, True]
    assert (found[1].failure, found[1].reason) == (Failure.OVERDUE, "it took longer than 1.5 s")


def test_what_a_function_prints_does_not_disturb(capfd: pytest.CaptureFixture[str]) -> None:
    assert [o.value for o in spread(spread_functions.loud, range(3), jobs=1)] == [0, 1, 2]
    out, err = capfd.readouterr()
    assert out == "" and err.count("noise 2") == 1


def test_each_of_the_processes_works() -> None:
    assert len({o.value for o in spread(spread_functions.process, range(12), jobs=3)}) == 3


def test_closing_it_early_leaves_no_process() -> None:
    found = spread(spread_functions.process, range(100), jobs=2)
    worker = next(iter(found)).value
    found.close()  # type: ignore[attr-defined]
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_ctrl_c_ends_it_and_its_processes() -> None:
    program = (
        f"import sys; sys.path.append({HERE!r})\nimport spread_functions\nfrom rds.spread import spread\n"
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
        ({"scheduler": "tcp://127.0.0.1:1"}, "no dask scheduler answers within 5 s"),
        ({"scheduler": "nowhere at all"}, "no dask scheduler answers"),
        ({"scheduler": "tcp://127.0.0.1:1", "time_limit": 1.0}, "for local processes"),
    ],
)
def test_what_will_not_do_is_said_at_once(options: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        spread(spread_functions.square, [1], **options)


def test_as_they_come_nothing_waits_for_the_slowest(where: dict[str, object], tmp_path: Path) -> None:
    work = [(number, str(tmp_path)) for number in range(20)]
    found = [outcome.index for outcome in spread(spread_functions.slow_first, work, in_order=False, **where)]
    assert sorted(found) == list(range(20))
    assert found[0] != 0


def test_local_workers_know_their_number() -> None:
    assert {o.value for o in spread(spread_functions.number_of_worker, range(20), jobs=2)} == {0, 1}
