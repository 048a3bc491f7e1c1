"""Work that is done again: the latest answer counts, once, and never two go on at a time."""

from __future__ import annotations

import threading

from rds.panels.session.latest import Latest
from rds.panels.session.task import Task


def test_only_the_latest_answer_is_given_and_only_once() -> None:
    asked, gates, going = 1, {1: threading.Event(), 2: threading.Event()}, []

    def begin() -> Task[int]:
        number = asked

        def work(task: Task[int]) -> int:
            going.append(number)
            gates[number].wait(10)
            going.remove(number)
            return number

        return Task("work", work).start()

    latest = Latest(begin)
    assert latest.tick() is None and latest.going_on
    asked = 2
    latest.again()
    assert latest.tick() is None  # the first still goes on: no second beside it
    gates[2].set()
    first = latest._task
    assert first is not None and going in ([], [1])
    gates[1].set()
    assert first.wait(10)
    assert latest.tick() is None  # the first answer does not hold any more
    second = latest._task
    assert second is not None and second is not first and second.wait(10)
    found = latest.tick()
    assert found is second and found.result == 2
    assert latest.tick() is None and not latest.going_on


def test_an_error_is_an_answer() -> None:
    def fail(task: Task[int]) -> int:
        raise ValueError("no")

    latest = Latest(lambda: Task("work", fail).start())
    latest.tick()
    task = latest._task
    assert task is not None and task.wait(10)
    found = latest.tick()
    assert found is not None and str(found.error) == "no"
