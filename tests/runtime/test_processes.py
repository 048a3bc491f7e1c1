"""Waiting for a process: no longer than it lives, and no longer than was said."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from rds.modes.process.processes import wait_for_end


@pytest.fixture(params=["told by the kernel", "looked after"])
def waiting(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[bytes]]:
    """A process that ends when its input does."""
    if request.param == "looked after":
        monkeypatch.delattr(os, "pidfd_open", raising=False)
    with subprocess.Popen([sys.executable, "-S", "-c", "input()"], stdin=-1, stderr=subprocess.DEVNULL) as process:
        yield process


def test_the_wait_is_over_when_the_process_is(waiting: subprocess.Popen[bytes]) -> None:
    assert waiting.stdin is not None
    wait_for_end(waiting, 0.01)
    assert waiting.poll() is None
    waiting.stdin.close()
    wait_for_end(waiting, 600.0)
    assert waiting.poll() is not None
    wait_for_end(waiting, 600.0)
