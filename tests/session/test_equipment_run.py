"""Runs of the equipment panels: what they show, what can be changed, how they end."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from waiting import wait_for

from rds.core.errors import InputError, RdsError
from rds.modes.process.record import PROCESSES
from rds.panels.equipment.state import Equipment
from rds.panels.session import Session
from rds.panels.session.background_pictures import made_beside
from rds.panels.session.kept_runs import State
from rds.panels.session.live_values import LiveValues
from rds.panels.session.save_as import save_as
from rds.panels.session.session import MOST_UNWRITTEN
from rds.results import open_result


def test_a_simulation_leaves_its_files_and_its_traces(tmp_path: Path) -> None:
    session = Session(tmp_path)
    equipment = Equipment(session, "control")
    equipment.choices.set("duration", 0.5)
    run = equipment.run().start()
    assert run.wait(60) and run.result is not None
    rows, names = run.new_rows(), [name for name, _ in run.traces()]
    assert names == ["X_reference", "X_measured", "X_voltage", "X_error"]
    assert np.array_equal(rows[:, 0], run.result["time"]) and np.array_equal(rows[:, 2], run.result["X_measured"])
    assert np.array_equal(rows[:, 4], run.result["X_reference"] - run.result["X_measured"])
    assert len(run.new_rows()) == 0
    assert {"report", "csv", "mat", "parquet"} <= set(run.files)
    assert [kept.folder for kept in session.runs()] == [run.folder]


def test_a_run_that_is_being_saved_is_not_cut_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def save(_: object, result: object, program: object, folder: Path, title: str) -> dict[str, Path]:
        for early in folder.glob("result.*"):
            early.unlink()
        (folder / "record.rds").touch()  # as a loop against the clock leaves it
        seen.extend(kept.state for kept in Session(tmp_path).runs())
        return {}

    monkeypatch.setattr("rds.panels.equipment.run.made_beside", save)
    equipment = Equipment(Session(tmp_path), "control")
    equipment.choices.set("duration", 0.01)
    run = equipment.run().start()
    assert run.wait(60) and run.error is None
    assert seen == [State.SAVED_NOW]
    assert [kept.state for kept in Session(tmp_path).runs()] == [State.CUT_SHORT]  # nothing was saved after all


@pytest.mark.realtime
@pytest.mark.usefixtures("nothing_drawn")
def test_the_emergency_stop_reaches_a_machine_that_a_run_started_for_itself(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    equipment.choices.set("mode", "implementation")
    equipment.choices.set("duration", 60.0)
    run = equipment.run().start()
    wait_for(lambda: len(run.new_rows()) or run.done)
    said = Session(tmp_path).emergency_stop()  # of another page, or of the page's server
    assert said.startswith("emergency stop: 4 modules are at zero volts")
    assert run.wait(60) and run.result is not None
    assert run.result.meta["ending"] == "machine lost" and "emergency stop" in run.result.meta["ending_reason"]


def test_a_students_fault_is_told_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("def control(t, r, y, state, params):\n    return r.positoin, state\n")
    equipment = Equipment(Session(tmp_path), "control")
    equipment.choices.set("controller", "user")
    with pytest.raises(InputError, match="name the file of your controller"):
        equipment.run()
    equipment.choices.set("controller_file", "bad.py")
    run = equipment.run().start()
    assert run.wait(60) and run.result is None
    assert str(run.error).startswith("bad.py, line 2: ") and "positoin" in str(run.error)
    assert not (tmp_path / "runs").exists()


def test_load_says_what_is_ready(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    task = equipment.load()
    assert task.wait(60) and task.result == "loaded: 10000 samples, 1 ms each; no machine is needed"


@pytest.mark.usefixtures("nothing_drawn")
def test_a_result_is_saved_where_one_wants_it_and_replaces_nothing(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "model")
    equipment.choices.set("duration", 0.1)
    run = equipment.run().start()
    assert run.wait(60) and run.result is not None
    for kind in ("csv", "mat", "parquet"):
        path = save_as(run.result, tmp_path, f"mine/first.{kind}")
        assert np.array_equal(open_result(path)["X_measured"], run.result["X_measured"])
        with pytest.raises(InputError, match="there is such a file already"):
            save_as(run.result, tmp_path, f"mine/first.{kind}")
    for name, reason in (("", "say where to"), ("a.xls", "must end with"), ("a", "must end with")):
        with pytest.raises(InputError, match=reason):
            save_as(run.result, tmp_path, name)


@pytest.mark.realtime
@pytest.mark.usefixtures("nothing_drawn")
def test_a_gain_is_changed_while_it_runs_and_recorded_with_its_time(alone: Path) -> None:
    session = Session(alone)
    equipment = Equipment(session, "control")
    for name, value in (("mode", "emulation"), ("controller", "p"), ("duration", 60.0)):
        equipment.choices.set(name, value)
    run = equipment.run().start()
    assert not run.live_values
    with pytest.raises(InputError, match="in use on this page"):
        equipment.run().start()
    wait_for(lambda: len(run.new_rows()))
    values = LiveValues(run)
    assert run.seconds_left is not None and run.seconds_left < 60.0  # however long it took to start
    before = values["X.Pgain"]
    with pytest.raises(InputError, match=r"Pgain.* must be at least 0"):
        values.set("X.Pgain", "-1")
    assert values["X.Pgain"] == before
    values.set("X.Pgain", "7,5")
    wait_for(lambda: run.changes)
    run.stop()
    assert run.wait(60) and run.result is not None
    (when, *change), (stopped, *stop) = run.result.meta["changes"]
    assert change == ["X.Pgain", before, 7.5] and 0.0 < when <= stopped < 60.0 and stop == ["stop", 0.0, 1.0]
    assert len(run.result) < 60_000 and run.result.meta["ending"] == "stopped"
    assert not run.live_values and session.machine_user is None and run.seconds_left is None
    with pytest.raises(InputError, match="is over"):
        values.set("X.Pgain", 8.0)
    text = (run.folder / "changes.csv").read_text()
    assert "X.Pgain" in text


@pytest.mark.realtime
@pytest.mark.usefixtures("nothing_drawn")
def test_a_run_that_is_stopped_at_once_gives_the_machine_back(alone: Path) -> None:
    session = Session(alone)
    equipment = Equipment(session, "model")
    equipment.choices.set("mode", "system-test")
    run = equipment.run().start()
    run.stop()
    assert run.wait(60) and session.machine_user is None
    assert run.stopped_early or (run.result is not None and run.result.meta["ending"] == "stopped")


@pytest.mark.realtime
@pytest.mark.usefixtures("nothing_drawn")
def test_a_folder_that_is_taken_away_during_a_run_is_said_so(alone: Path) -> None:
    session = Session(alone)
    equipment = Equipment(session, "control")
    equipment.choices.set("mode", "emulation")
    equipment.choices.set("duration", 60.0)
    run = equipment.run().start()
    wait_for(lambda: run.share or run.done)

    def take_away() -> bool:  # files come and go in it
        shutil.rmtree(run.folder, ignore_errors=True)
        return not run.folder.exists()

    wait_for(take_away)
    run.stop()
    assert run.wait(30) and isinstance(run.error, InputError) and run.folder.name in str(run.error)
    assert session.machine_user is None


ORPHAN = """
import os, sys, time
from rds import open_result
from rds.modes.process.record import NAME
from rds.panels.session import Session
from rds.panels.equipment.state import Equipment

equipment = Equipment(Session(sys.argv[1]), "control")
equipment.choices.set("mode", "implementation")
equipment.choices.set("duration", 60.0)
run = equipment.run().start()
while not (len(run.new_rows()) and (run.folder / NAME).is_file() and len(open_result(run.folder))):
    time.sleep(0.02)  # until there are samples on the disk
os._exit(0)  # as a kernel that is killed
"""


@pytest.mark.realtime
def test_a_run_whose_page_was_killed_keeps_the_machine_until_it_ends(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", ORPHAN, str(tmp_path)], check=True, timeout=60)
    session = Session(tmp_path)
    (orphan,) = session.runs_that_go_on()
    with pytest.raises(InputError, match=f"a run that goes on without a page, {orphan.name}"):
        session.take_machine("another run", object())
    orphan.stop()
    wait_for(lambda: not session.runs_that_go_on())
    session.take_machine("another run", object())  # what refused held nothing


@pytest.mark.realtime
def test_a_run_of_which_all_processes_were_killed_goes_on_no_more(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", ORPHAN, str(tmp_path)], check=True, timeout=60)
    session = Session(tmp_path)
    (orphan,) = session.runs_that_go_on()
    processes = json.loads((orphan.folder / PROCESSES).read_text())
    for name in ("recorder", "target"):
        os.kill(processes[name], signal.SIGKILL)
    wait_for(lambda: not session.runs_that_go_on())
    for kind in (".live", ".ring"):  # nobody is left to remove what they shared
        Path(processes["live_values"]).with_suffix(kind).unlink()
    assert [run.state for run in session.runs()] == [State.CUT_SHORT]
    session.take_machine("another run", object())


def test_the_next_run_begins_while_pictures_of_the_last_one_are_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = threading.Event()

    def draw(save: object, *of: object) -> dict[str, Path]:
        assert drawn.wait(60)
        return {}

    monkeypatch.setattr("rds.panels.equipment.run.made_beside", draw)
    equipment = Equipment(Session(tmp_path), "control")
    equipment.choices.set("duration", 0.01)
    runs = [equipment.run().start() for _ in range(MOST_UNWRITTEN)]
    for run in runs:
        wait_for(lambda: run.done)  # noqa: B023  # called at once
        assert not run.written and (run.folder / "result.csv").is_file()  # the tables are there at once
    stopped, late = (equipment.run().start() for _ in range(2))  # no more of them are kept in memory
    stopped.stop()
    assert stopped.wait(60) and stopped.stopped_early
    wait_for(lambda: late.note)
    assert late.note.startswith("waiting until the reports of earlier runs") and not late.done
    drawn.set()
    assert all(run.wait(60) and run.written and run.unwritten is None for run in [*runs, late])
    assert late.result is not None


def test_what_goes_wrong_with_pictures_is_said_and_takes_no_result_away(tmp_path: Path) -> None:
    with pytest.raises(RdsError, match=r"not made: ValueError: .*tables are kept"):
        made_beside(int, "no number")
    assert made_beside(os.nice, 0) == 19
