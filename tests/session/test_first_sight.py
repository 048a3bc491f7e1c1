"""What a first visit shows before anything is pressed: the machine's own axis, simulated, and its error."""

from __future__ import annotations

import time

import numpy as np
import pytest

from rds.panels.page.first_visit import RATE, FirstVisit, first_sight
from rds.panels.session import Session


def test_one_period_of_the_first_axis_with_its_error() -> None:
    name, unit, rows = first_sight("mini-cnc")
    assert (name, unit) == ("X", "mm") and rows.shape == (2 * RATE, 4)
    assert rows[0, 0] == 0.0 and np.allclose(np.diff(rows[:, 0]), 1.0 / RATE)
    assert np.array_equal(rows[:, 3], rows[:, 1] - rows[:, 2]) and 0.01 < abs(rows[:, 3]).max() < 1.0
    assert rows[0, 1] == pytest.approx(0.0, abs=1e-9)  # a whole period: its end goes over into its beginning


def test_it_is_simulated_once_the_page_is_in_sight(tmp_path: object) -> None:
    calls: list[object] = []

    class Ticker:
        def add(self, call: object) -> object:
            calls.append(call)
            return calls.clear

    alive, sent = FirstVisit(Session(str(tmp_path)), Ticker()), []
    alive.send = lambda content, buffers=None: sent.append(buffers)
    assert alive._task is None
    alive._asked(None, {"kind": "here"}, None)
    deadline = time.monotonic() + 60.0
    while not sent and time.monotonic() < deadline:
        for call in calls:
            call()  # type: ignore[operator]
        time.sleep(0.01)
    assert alive.axis == "X" and len(np.frombuffer(sent[0][0])) == 8 * RATE and not calls
    alive._asked(None, {"kind": "here"}, None)  # shown again: not simulated again
    assert len(sent) == 2
