"""Code without an end: it has a limit, and the line where it hangs is named."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

import rds
from rds.core import interrupt
from rds.core.interrupt import Endless, limited

LAW = "def control(t, r, y, state, params):\n    return 0.0, state\n"


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupt, "LIMIT", 0.3)


def test_what_is_quick_is_left_alone() -> None:
    for _ in range(100):
        with limited(seconds=0.25):
            pass
    time.sleep(0.3)


def test_a_limit_that_is_over_as_the_code_ends_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    class Late(threading.Event):
        was_set = False

        def set(self) -> None:
            if not self.was_set:
                self.was_set = True
                raise Endless(0.05)  # as from the watcher, just then
            super().set()

    monkeypatch.setattr(interrupt, "threading", SimpleNamespace(**{**vars(threading), "Event": Late}))
    with pytest.raises(Endless), limited(seconds=0.05):
        pass
    for watcher in threading.enumerate():
        if watcher.name == "rds limit":
            watcher.join(5.0)
            assert not watcher.is_alive()


def test_steps_keep_it_going() -> None:
    with limited(time.monotonic_ns, 0.1):
        end = time.monotonic() + 0.3
        while time.monotonic() < end:
            pass


def test_what_catches_everything_ends_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupt, "PATIENCE", 0.1)
    caught = 0
    with pytest.raises(Endless, match=r"after 0\.1 s"), limited(seconds=0.1):
        while True:
            try:
                while True:
                    pass
            except BaseException:
                caught += 1
                if caught == 2:
                    raise


def test_debuggers_and_profilers_see_what_comes_after_it() -> None:
    """Each call looked for the withdrawn error for ever, in CPython 3.11, as soon as calls were watched."""
    with limited():
        pass
    with pytest.raises(Endless), limited(seconds=0.01):
        while True:
            pass
    watched = []
    sys.setprofile(lambda frame, event, _: watched.append((frame.f_code.co_name, event)))
    try:
        _called()
    finally:
        sys.setprofile(None)
    assert watched[:2] == [("_called", "call"), ("_called", "return")]


def _called() -> None:
    pass


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("while True:\n    pass\n" + LAW, "line [12]"),
        ("class C:\n    def __init__(self):\n        while True: pass\nc = C()\n" + LAW, "line 3, in __init__"),
        ("def control(t, r, y, state, params):\n    while True: pass\n", "line 2, in control"),
        (
            "initial_state = 0\ndef control(t, r, y, state, params):\n    while t > 0.1: pass\n    return 0.0, 0\n",
            "line 3",
        ),
    ],
    ids=["top level", "constructor", "first call", "in the middle"],
)
def test_the_line_is_named(text: str, where: str, tmp_path: Path) -> None:
    (tmp_path / "endless.py").write_text(text)
    began = time.monotonic()
    with pytest.raises(rds.RdsError, match=rf"endless\.py, {where}.* after 0\.3 s; look for a loop without an end"):
        rds.Experiment(
            duration=0.5, reference=rds.sinusoid(2.0, 1.0), controller={"file": str(tmp_path / "endless.py")}
        ).run("simulation")
    assert time.monotonic() - began < 10.0


def test_so_it_is_of_a_model_that_is_tried_for_its_states(tmp_path: Path) -> None:
    (tmp_path / "endless.py").write_text("def derivatives(t, x, u, params):\n    while True: pass\n")
    with pytest.raises(
        rds.ContractError, match=r"endless\.py, line 2, in derivatives.* look for a loop without an end"
    ):
        rds.Experiment(reference=rds.sinusoid(2.0, 1.0), controller="p", model=tmp_path / "endless.py")
