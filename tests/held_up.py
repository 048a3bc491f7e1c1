"""A test that fails while the computer is held up is void, as a verdict on timing is: it is run again, and told.

Real processes, a real bus and a real browser share a few cores. What they are to do within some time can fail because
others had the processors. So a failure counts only if it repeats, up to `AGAIN` times, or if nothing had to wait for a
processor while the test ran. Each void try is printed at the end of the run with its failure and with the time that
processes waited; a run with more of them than `--max-suite-reruns` (pyproject.toml) fails.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Generator
from functools import partial
from pathlib import Path

import pytest

PRESSURE = Path("/proc/pressure/cpu")  # Linux: pressure stall information
AGAIN = 2  # times that a failed test is run again, at most
LONG = 0.1  # s of waiting for a processor that can make a test fail

_waited_before = pytest.StashKey[float | None]()


def waited() -> float | None:
    """For how long since start-up something that could run had no processor, s; None where the system does not tell."""
    try:
        found = re.search(r"^some .*\btotal=(\d+)", PRESSURE.read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(found[1]) * 1e-6 if found else None


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Before each test, a worker of pytest-xdist asks over TCP whether it has crashed there before, in two small words.
    TCP keeps the second one back for 40 ms unless it is told not to: 150 s of this project's tests.
    """
    line = getattr(getattr(config, "failures_db", None), "sock", None)
    if line is not None:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.add_marker(pytest.mark.flaky(reruns=AGAIN, condition=partial(_was_held_up, item)))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[_waited_before] = waited()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    add_section = getattr(report.longrepr, "addsection", None)
    if report.failed and add_section is not None:
        add_section("the computer", _how_held_up(item))
    return report


def _was_held_up(item: pytest.Item) -> bool:
    waiting = _waiting(item)
    return waiting is None or waiting >= LONG


def _how_held_up(item: pytest.Item) -> str:
    waiting = _waiting(item)
    if waiting is None:
        return f"whether processes waited for a processor is not known: no {PRESSURE}"
    return f"processes waited for a processor for {waiting:.2f} s while this test ran"


def _waiting(item: pytest.Item) -> float | None:
    """Of this test until now, s."""
    before, now = item.stash.get(_waited_before, None), waited()
    return None if before is None or now is None else now - before
