"""What draws for a page, once for all tests: each run would start Python and import matplotlib anew."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import pytest

from rds.panels.session import beside


@pytest.fixture(scope="session", autouse=True)
def drawing_process() -> Iterator[None]:
    """As a page has it (`begin_beside()`), but started fresh: this process may have threads, which no fork survives.

    It imports what it needs when it is first asked. Where a test kills it, the later runs have one each, as ever.
    """
    command = [sys.executable, "-P", "-m", "rds.core.parallel.worker"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
    with pytest.MonkeyPatch.context() as patch:
        forked = beside._Forked()
        forked.process = process  # type: ignore[assignment]  # what is used of both is the same
        patch.setattr(beside, "_FORKED", forked)
        yield
    process.kill()
    process.wait()


@pytest.fixture
def nothing_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of a run's numbers: its tables are written as ever, without pictures and reports."""
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda *_: {})
