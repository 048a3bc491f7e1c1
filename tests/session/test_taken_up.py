"""A run that another page has begun is taken up: its strip, its progress, its live values, its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from waiting import wait_for

from rds.core.errors import InputError
from rds.panels.equipment.run import EquipmentRun
from rds.panels.equipment.state import Equipment
from rds.panels.equipment.taken_up import TakenUpRun, is_driven_by
from rds.panels.session import Session
from rds.panels.session.live_values import LiveValues

pytestmark = pytest.mark.realtime


def begun(folder: Path, kind: str, **chosen: object) -> EquipmentRun:
    equipment = Equipment(Session(folder), kind)
    for name, value in {"sample_period": 0.005, "duration": 600.0, **chosen}.items():
        equipment.choices.set(name, value)
    return equipment.run().start()


def test_a_run_of_another_page_is_followed_tuned_and_stopped(tmp_path: Path) -> None:
    own = begun(tmp_path, "control", mode="emulation", controller="p")
    other = Session(tmp_path)
    wait_for(other.runs_that_go_on)
    (kept,) = other.runs_that_go_on()
    assert is_driven_by(kept) == "control"
    run = TakenUpRun(kept)
    wait_for(run.traces)
    rows = run.new_rows()
    wait_for(lambda: len(rows) or len(run.new_rows()))
    assert run.traces() == own.traces()
    assert run.share is not None and 0.0 < run.share < 0.1 and run.seconds_left is not None and run.seconds_left > 500.0
    assert not run.done and run.result is None and "begun elsewhere" in run.note
    live = LiveValues(run)
    live.set("X.Pgain", 30.0)
    wait_for(lambda: run.changes)
    assert run.changes[0][1:] == ("X.Pgain", run.live_values["X.Pgain"].value, 30.0)
    with pytest.raises(InputError, match="Pgain"):
        live.set("X.Pgain", -1.0)
    run.stop()
    wait_for(lambda: run.done)
    assert own.wait(60) and own.result is not None and run.result is not None
    assert run.result.meta["ending"] == "stopped" and len(run.result) == len(own.result)
    assert np.array_equal(run.result["X_measured"], own.result["X_measured"])
    assert run.live_values is not None and run.error is None


def test_a_signal_s_run_is_one_of_equipment_model(tmp_path: Path) -> None:
    own = begun(tmp_path, "model", mode="system-test")
    other = Session(tmp_path)
    wait_for(other.runs_that_go_on)
    run = TakenUpRun(other.runs_that_go_on()[0])
    assert is_driven_by(run.kept) == "model"
    run.stop()
    wait_for(lambda: run.done)
    assert own.wait(60)
