"""A test that fails while the computer is held up is void, as a verdict on timing is: it is run again, and told.

Real processes, a real bus and a real browser share a few cores. What they are to do within some time can fail because
others had the processors. So a failure of a test that waits for others (real time, a browser, a process or a thread
of its file or of one of its fixtures) counts only if it repeats, up to `AGAIN` times, or if nothing had to wait for a
processor while it ran. All other tests fail at once. Each void try is printed at the end of the run with its failure
and with the time that processes waited; a run with more of them than `--max-suite-reruns` (pyproject.toml) fails.

With tests side by side something waits nearly always: there it means that what fails once in many runs is told, and
does not fail the run. `ARGS="--force-reruns 0"` shows each failure as one.
"""

from __future__ import annotations

import os
import re
import subprocess
import threading
from collections.abc import Generator
from functools import partial, wraps
from pathlib import Path
from typing import Any

import pytest

PRESSURE = Path("/proc/pressure/cpu")  # Linux: pressure stall information
AGAIN = 2  # times that a failed test is run again, at most
LONG = 0.1  # s of waiting for a processor that can make a test fail

_waited_before = pytest.StashKey[float | None]()
_started = 0  # processes and threads of this worker
_started_before: dict[Path, int] = {}  # the first test of a file
_starters: set[str] = set()  # fixtures that start processes or threads; those of a session serve later files, too


def waited() -> float | None:
    """For how long since start-up something that could run had no processor, s; None where the system does not tell."""
    try:
        found = re.search(r"^some .*\btotal=(\d+)", PRESSURE.read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(found[1]) * 1e-6 if found else None


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Count what is started, and let workers ask less.

    Not by an audit hook, which Python calls for each import and open, too: 2 % of what the tests compute.

    Before each test, a worker of pytest-xdist would ask whether it has crashed there before, byte by byte over TCP,
    though this project's scheduler (conftest.py) never runs such a test again; after each, how many tests were run
    again, which it asks once more where it counts.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=_count)
    begin, start = subprocess.Popen.__init__, threading.Thread.start

    @wraps(begin)
    def begun(self: subprocess.Popen[Any], *arguments: Any, **options: Any) -> None:
        _count()
        begin(self, *arguments, **options)

    def counted(self: threading.Thread) -> None:
        _count()
        start(self)

    subprocess.Popen.__init__ = begun  # type: ignore[method-assign]
    threading.Thread.start = counted  # type: ignore[method-assign]
    crashes = getattr(config, "failures_db", None)
    if crashes is not None and hasattr(config, "workerinput"):
        crashes.get_test_failures = lambda test: 0
        crashes.set_test_reruns = lambda test, reruns: None
        crashes.get_suite_reruns = lambda: 0


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.add_marker(pytest.mark.flaky(reruns=AGAIN, condition=partial(_was_held_up, item)))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    _started_before.setdefault(item.path, _started)
    item.stash[_waited_before] = waited()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    add_section = getattr(report.longrepr, "addsection", None)
    if report.failed and add_section is not None:
        add_section("the computer", _how_held_up(item))
    return report


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[object]) -> Generator[None, object, object]:
    before = _started
    made = yield
    if _started > before:
        _starters.add(fixturedef.argname)
    return made


def _count() -> None:
    global _started
    _started += 1


def _waits_for_others(item: pytest.Item) -> bool:
    is_marked = item.get_closest_marker("realtime") is not None or "panels" in item.path.parts
    is_served = not _starters.isdisjoint(getattr(item, "fixturenames", ()))
    return is_marked or is_served or _started > _started_before.get(item.path, _started)


def _was_held_up(item: pytest.Item) -> bool:
    if not _waits_for_others(item):
        return False
    waiting = _waiting(item)
    return _is_loaded() if waiting is None else waiting >= LONG


def _is_loaded() -> bool:
    """By the load average, where the system says no more."""
    return hasattr(os, "getloadavg") and os.getloadavg()[0] > (os.cpu_count() or 1)


def _how_held_up(item: pytest.Item) -> str:
    if not _waits_for_others(item):
        return "this test waits for no other process and no thread"
    waiting = _waiting(item)
    if waiting is None:
        return f"no {PRESSURE} says whether processes waited for a processor; by the load average: {_is_loaded()}"
    return f"processes waited for a processor for {waiting:.2f} s while this test ran"


def _waiting(item: pytest.Item) -> float | None:
    """Of this test until now, s."""
    before, now = item.stash.get(_waited_before, None), waited()
    return None if before is None or now is None else now - before
