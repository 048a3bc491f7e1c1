"""An event that a signal's handler sets is no trap for the thread that waits for it."""

from __future__ import annotations

import signal
import threading
import time

from rds.cli.common import until_ctrl_c
from rds.core.interrupt import SignalEvent


def test_it_can_be_set_in_the_middle_of_a_wait_of_the_same_thread() -> None:
    """With `threading.Event`, replaying and watching a bus could hang for ever at Ctrl-C, and hear no second one."""
    stop = SignalEvent()

    def interrupted() -> None:
        with stop._cond:  # as in the middle of wait(), and of a set() that a second signal interrupts
            stop.set()

    thread = threading.Thread(target=interrupted, daemon=True)
    thread.start()
    thread.join(10.0)
    assert not thread.is_alive() and stop.is_set()


def test_ctrl_c_sets_such_a_one_and_ends_its_wait() -> None:
    with until_ctrl_c() as stop:
        assert isinstance(stop, SignalEvent)
        assert not stop.wait(0.01)
        signal.raise_signal(signal.SIGINT)
        assert stop.wait(30.0) and stop.is_set()
        stop.clear()
        assert not stop.is_set()


def test_another_thread_ends_a_wait_without_a_limit() -> None:
    stop = SignalEvent()
    threading.Timer(0.02, stop.set).start()
    assert stop.wait()
    before = time.monotonic()
    assert stop.wait(60.0) and time.monotonic() - before < 30.0
