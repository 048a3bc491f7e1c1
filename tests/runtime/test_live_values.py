"""Live values between host and target, the notes of their changes, and runs that do not block."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lost_machines import unless_lost
from misbehaviour import send
from waiting import wait_for

import rds
from rds.core.types import Ending
from rds.modes.loop.changes import LiveChanges, as_text, plan_changes, read_changes, stop_channel, timed
from rds.modes.loop.live_values import NOTES, Channel, LiveValues, Note
from rds.modes.process.ring import Ring

Maker = Callable[..., rds.Experiment]

GAIN = Channel("X.Pgain", 10.0, "proportional gain, V/mm", "V/mm", low=0.0)
OVERRIDE = Channel("override", 1.0, "feed override", "", low=0.0, high=2.0)
PID = {"name": "pid", "Pgain": 20.0}
CHANGES = [(0.4, "X.Pgain", 35.0), (0.4, "X.Igain", 3.0), (0.7215, "X.FF1", 0.0), (1.1, "X.Pgain", 12.5)]


# --- the shared memory --------------------------------------------------------------------------------------------


@given(values=st.lists(st.tuples(st.sampled_from(["X.Pgain", "override"]), st.floats(0.0, 2.0)), max_size=30))
def test_a_reader_sees_what_was_set_last(values: list[tuple[str, float]]) -> None:
    live_values = LiveValues.create(None, [GAIN, OVERRIDE])
    assert not live_values.news()
    expected = {"X.Pgain": 10.0, "override": 1.0}
    for name, value in values:
        live_values.set(name, value)
        expected[name] = value
        assert live_values.news()
        assert live_values.take() == tuple(expected.values())
        assert not live_values.news()
    assert live_values.values() == expected


def test_two_processes_share_live_values(tmp_path: Path) -> None:
    live_values = LiveValues.create(tmp_path / "a.live", [GAIN, OVERRIDE])
    opened_there = f"LiveValues.open({str(tmp_path / 'a.live')!r})"
    other = f"from rds.modes.loop.live_values import LiveValues; {opened_there}.set('override', 0.25)"
    subprocess.run([sys.executable, "-c", other], check=True)
    assert live_values.take() == (10.0, 0.25)
    live_values.note(Note(3, "override", 1.0, 0.25))
    opened = LiveValues.open(tmp_path / "a.live")
    assert opened.channels == live_values.channels
    assert opened.notes() == (0, [Note(3, "override", 1.0, 0.25)])


def test_values_that_belong_together_are_never_seen_apart() -> None:
    """A writer sets both channels to the same value all the time; whoever reads sees equal values or none."""
    live_values = LiveValues.create(None, [OVERRIDE, Channel("hold", 1.0, "", low=0.0, high=2.0)])
    stop = threading.Event()

    def write() -> None:
        i = 0
        while not stop.is_set():
            i += 1
            live_values.set_all({"override": i % 200 / 100, "hold": i % 200 / 100})

    writer = threading.Thread(target=write)
    writer.start()
    seen = []
    while len(seen) < 100:
        if live_values.news() and (values := live_values.take()):
            seen.append(values)
    stop.set()
    writer.join()
    assert all(a == b for a, b in seen)
    assert len(set(seen)) > 1


def test_a_writer_that_died_in_the_middle_blocks_nobody() -> None:
    live_values = LiveValues.create(None, [GAIN])
    live_values._memory[8:16] = (7).to_bytes(8, "little")  # odd, as a killed process leaves it
    assert live_values.take() == ()
    live_values.set("X.Pgain", 3.0)
    assert live_values.take() == (3.0,)


def test_notes_that_nobody_copied_in_time_are_counted() -> None:
    live_values = LiveValues.create(None, [GAIN])
    for k in range(NOTES + 10):
        live_values.note(Note(k, "X.Pgain", float(k), float(k + 1)))
    first, notes = live_values.notes(5)
    assert (first, len(notes), notes[0].sample, notes[-1].sample) == (10, NOTES, 10, NOTES + 9)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("X.Pgian", 1.0, r"no live value 'X.Pgian'; this run has X.Pgain, override; did you mean 'X.Pgain'\?"),
        ("X.Pgain", -1.0, r"X.Pgain = -1.0 must be at least 0 V/mm \(proportional gain"),
        ("X.Pgain", "much", r"X.Pgain = 'much' must be a number in V/mm, without quotes"),
        ("override", 2.5, r"override = 2.5 must be from 0 to 2 \(feed override\)"),
        ("override", float("nan"), r"override = nan must be a finite number"),
    ],
)
def test_what_cannot_be_set_is_refused(name: str, value: Any, said: str) -> None:
    live_values = LiveValues.create(None, [GAIN, OVERRIDE])
    with pytest.raises(rds.InputError, match=said):
        live_values.set_all({"override": 0.5, name: value})
    assert live_values.values() == {"X.Pgain": 10.0, "override": 1.0}
    assert not live_values.news()


# --- when changes are taken ---------------------------------------------------------------------------------------


def test_a_change_is_taken_at_the_sample_of_its_time() -> None:
    said: list[tuple[int, float]] = []
    k = 0
    planned = plan_changes([(0.0, "X.Pgain", 1.0), (0.0101, "X.Pgain", 2.0)], {"X.Pgain": GAIN}, 0.001)
    live_changes = LiveChanges([GAIN, stop_channel()], {"X.Pgain": lambda value: said.append((k, value))}, planned)
    for k in range(30):
        assert live_changes(k) is None
    assert said == [(0, 1.0), (11, 2.0)]
    assert live_changes.taken == [Note(0, "X.Pgain", 10.0, 1.0), Note(11, "X.Pgain", 1.0, 2.0)]
    assert not live_changes.expects(["X.Pgain"])


@given(sample=st.integers(0, 10**9), T=st.sampled_from([0.001, 0.002, 1e-4, 0.0123, 1 / 3000]))
def test_the_time_of_a_sample_is_that_sample(sample: int, T: float) -> None:
    note = Note(sample, "X.Pgain", 10.0, 1.0)
    assert plan_changes(timed([note], T), {"X.Pgain": GAIN}, T) == ((sample, "X.Pgain", 1.0),)


@given(
    changes=st.lists(st.tuples(st.integers(0, 10**7), st.floats(0.0, 1e6), st.floats(0.0, 1e6)), max_size=8),
    cut=st.integers(0, 20),
)
def test_changes_come_back_from_their_file(
    changes: list[tuple[int, float, float]], cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    written = timed([Note(k, "X.Pgain", old, new) for k, old, new in changes], 0.001)
    folder = tmp_path_factory.mktemp("changes")
    text = as_text(written)
    (folder / "changes.csv").write_text(text)
    assert read_changes(folder) == written
    (folder / "changes.csv").write_text(text[: len(text) - cut])  # a writer that was killed
    assert read_changes(folder) == written[: max(0, text[: len(text) - cut].count("\n") - 1)]


# --- simulations --------------------------------------------------------------------------------------------------


def test_a_changed_gain_acts_from_its_sample_on(experiment: Maker) -> None:
    plain = experiment(PID).run()
    changed = experiment(PID).run(changes=CHANGES)
    differs = np.flatnonzero(plain["X_command"] != changed["X_command"])
    assert differs[0] == 400
    assert changed.meta["changes"] == [
        [0.4, "X.Pgain", 20.0, 35.0],
        [0.4, "X.Igain", pytest.approx(plain.meta["controller"]["X"]["params"]["Igain"]), 3.0],
        [0.722, "X.FF1", pytest.approx(1 / 1.764), 0.0],
        [1.1, "X.Pgain", 35.0, 12.5],
    ]


def test_a_run_with_its_gains_from_the_start_is_the_same(experiment: Maker) -> None:
    """What a change makes of a law is what the law would have been made of."""
    gains = {"Pgain": 31.0, "Igain": 2.0, "derivative_filter": 0.002, "maxoutput": 4.0}
    wanted = experiment({"name": "pid"} | gains).run()
    changed = experiment({"name": "pid"}).run(changes=[(0.0, f"X.{name}", value) for name, value in gains.items()])
    assert (wanted["X_command"] == changed["X_command"]).all()
    wanted = experiment({"name": "tracking", "gains": [900.0, -50.0]}).run()
    changed = experiment({"name": "tracking", "gains": [1600.0, -36.6]}).run(
        changes=[(0.0, "X.g1", 900.0), (0.0, "X.g2", -50.0)]
    )
    assert (wanted["X_command"] == changed["X_command"]).all()


def test_a_student_s_parameters_are_live_values(experiment: Maker) -> None:
    def control(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        return params["gain"] * (r.position - y), state

    own = experiment({"control": control, "params": {"gain": 10, "name": "mine", "on": True}})
    assert [channel.name for channel in own.plan().channels()] == ["X.gain", "stop"]
    result = own.run(changes=[(0.5, "X.gain", 25.0)])
    error = result["X_reference"] - result["X_measured"]
    assert np.allclose(result["X_command"], np.where(result["time"] < 0.4999, 10, 25.0) * error)
    assert own.run()["X_command"][-1] != result["X_command"][-1]  # the student's own params are as they were


def test_coupled_controllers_have_live_values_too() -> None:
    def contour(t: float, r: Any, y: Any, state: Any, params: Any) -> Any:
        return params["k"] * (r.position - y), state

    both = rds.Experiment(
        axis=("X", "Y"),
        duration=0.2,
        reference=rds.sinusoid(1.0, 5.0),
        controller=rds.Controller(contour, params={"k": 30.0}, coupled=True),
    )
    result = both.run(changes=[(0.1, "controller.k", 0.0)])
    late = result["time"] > 0.0999
    assert result["X_command"][~late].any() and not result["X_command"][late].any()
    assert not result["Y_command"][late].any()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((0.1, "X.Kp", 1.0), "no live value 'X.Kp'; this run has X.Pgain, "),
        ((0.1, "X.Pgain", -1.0), "X.Pgain = -1.0 must be at least 0 V/mm"),
        ((-0.1, "X.Pgain", 1.0), r"its time must be from 0 to 1e\+09 s"),
        ((1e308, "X.Pgain", 1.0), r"its time must be from 0 to 1e\+09 s"),
        ((10**400, "X.Pgain", 1.0), "its time must be a finite number in s"),
        ((2.0, "X.Pgain", 1.0), "the change of X.Pgain at 2 s comes after the run, which lasts 2 s; make it earlier"),
        (("X.Pgain", 1.0), r"must be \(time in s, name, value\)"),
    ],
)
def test_changes_that_will_not_do_are_refused(experiment: Maker, change: Any, said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        experiment(PID).run(changes=[change])


def test_a_planned_stop_ends_a_simulation_and_keeps_its_samples(experiment: Maker) -> None:
    whole = experiment(PID).run()
    stopped = experiment(PID).run(changes=[(0.25, "stop", 1)])
    assert stopped.meta["ending"] == Ending.STOPPED
    assert len(stopped) == 250
    assert (stopped["X_measured"] == whole["X_measured"][:250]).all()


def test_compiled_simulations_do_not_ignore_changes(experiment: Maker) -> None:
    pytest.importorskip("numba")
    fast = experiment(PID, compiled=True).run(changes=CHANGES)
    assert "not compiled: live values change while it runs" in fast.meta["notes"]
    assert (fast["X_command"] == experiment(PID).run(changes=CHANGES)["X_command"]).all()


# --- runs that do not block ---------------------------------------------------------------------------------------


def test_a_simulation_is_stopped_and_keeps_what_it_has(experiment: Maker) -> None:
    run = experiment(PID, duration=2000.0).start()
    assert run.ready(10)
    run.live_values.set("X.Pgain", 5.0)
    wait_for(lambda: run.progress[0] >= 1000, every=0.001)
    assert not run.done
    assert "goes on" in repr(run)
    rows = run.rows
    assert rows is not None and len(rows) >= 1000
    run.stop()
    result = run.wait()
    assert run.done
    assert result.meta["ending"] == "stopped"
    assert len(result) == run.progress[0] >= len(rows)
    assert (result["X_measured"][: len(rows)] == rows["X_measured"]).all()
    assert [change.name for change in run.changes] == ["X.Pgain", "stop"]
    again = experiment(PID, duration=2000.0).run(changes=result.meta["changes"])
    assert all((again[name] == result[name]).all() for name in result.columns)
    with pytest.raises(rds.InputError, match="no live value can be read or set: the run is over"):
        run.live_values.set("X.Pgain", 1.0)


def test_an_error_of_the_run_comes_from_wait(experiment: Maker) -> None:
    run = experiment(lambda t, r, y, state, params: (float("nan") if t > 0.01 else 0.0, state)).start()
    with pytest.raises(rds.ContractError, match="returned the voltage nan"):
        run.wait()
    with pytest.raises(rds.ContractError):
        run.wait()


def test_what_is_wrong_is_said_before_anything_starts(experiment: Maker) -> None:
    with pytest.raises(rds.InputError, match="no live value"):
        experiment(PID).start("emulation", changes=[(0.0, "Y.Pgain", 1.0)])


@pytest.mark.realtime
def test_emulation_with_planned_changes_is_the_simulation(experiment: Maker) -> None:
    simulated = experiment(PID, duration=1.2).run(changes=CHANGES)
    emulated = unless_lost(lambda: experiment(PID, duration=1.2).run("emulation", changes=CHANGES))
    assert all((emulated[name] == simulated[name]).all() for name in simulated.columns)
    assert emulated.meta["changes"] == simulated.meta["changes"]


@pytest.mark.realtime
def test_an_emulation_changed_by_hand_is_repeated_by_a_simulation(experiment: Maker, alone: Path) -> None:
    run = experiment(PID, duration=1.0).start("emulation", out=alone / "run")
    assert run.ready(30)
    for gain in (30.0, 5.0, 42.0):
        seen = run.progress[0]
        wait_for(lambda: run.progress[0] >= seen + 100)  # noqa: B023  # called at once
        run.live_values.set_all({"X.Pgain": gain, "X.Igain": gain / 10})
    with pytest.raises(rds.InputError, match=r"X.Pgain = -3 must be at least 0 V/mm"):
        run.live_values.set("X.Pgain", -3)
    assert run.live_values["X.Pgain"] == 42.0
    emulated = run.wait()
    changes = emulated.meta["changes"]
    assert [(name, new) for _, name, _, new in changes] == [
        (name, gain / part) for gain in (30.0, 5.0, 42.0) for name, part in (("X.Pgain", 1), ("X.Igain", 10))
    ]
    assert [list(change) for change in read_changes(alone / "run")] == changes
    assert rds.open_result(alone / "run").meta["changes"] == changes
    simulated = experiment(PID, duration=1.0).run(changes=changes)
    assert all((emulated[name] == simulated[name]).all() for name in simulated.columns)


@pytest.mark.realtime
def test_an_implementation_is_changed_and_stopped(experiment: Maker, alone: Path) -> None:
    run = experiment({"name": "p", "Pgain": 20.0}, duration=20.0).start("implementation", out=alone / "run")
    assert run.ready(30)
    wait_for(lambda: run.progress[0] >= 300)
    run.live_values.set("X.Pgain", 1.0)
    wait_for(lambda: run.progress[0] >= 600)
    rows = run.rows
    assert rows is not None and len(rows) >= 600
    assert "X_measured" in rows and rows.units["lateness"] == "µs"
    run.stop()
    result = run.wait()
    assert result.meta["ending"] == "stopped"
    (when, name, _, _), (stopped, stop, _, _) = result.meta["changes"]
    assert (name, stop) == ("X.Pgain", "stop")
    assert stopped == pytest.approx(result["time"][-1] + 0.001, abs=0.1)
    error = result["X_reference"] - result["X_measured"]
    gain = np.where(result["time"] < when - 1e-9, 20.0, 1.0)
    assert np.allclose(result["X_command"], gain * error)
    assert (result["X_simulated"] != 0).any()


@pytest.mark.realtime
def test_changes_of_a_run_that_was_killed_are_kept(experiment: Maker, alone: Path) -> None:
    run = experiment(PID, duration=20.0).start("emulation", out=alone / "run")
    assert run.ready(30)
    wait_for(lambda: run.progress[0] >= 100)
    run.live_values.set("X.Pgain", 11.0)
    wait_for(lambda: run.progress[0] >= 300)
    send(alone / "run", "recorder")
    result = run.wait()
    assert result.meta["ending"] == "killed"
    assert [change[1:] for change in result.meta["changes"]] == [["X.Pgain", 20.0, 11.0]]
    for path in alone.glob("run/result.*"):
        path.unlink()
    assert rds.open_result(alone / "run").meta["changes"] == result.meta["changes"]


# --- words that processes share -----------------------------------------------------------------------------------

APPEND = """
import sys
from rds.modes.process.ring import Ring
ring = Ring.open(sys.argv[1])
while not ring.stop_asked():
    ring.append([0.0])
"""


def test_a_count_is_never_seen_half_written(tmp_path: Path) -> None:
    """Another process appends as fast as it can; `struct.pack_into` would show zero for a moment several times."""
    ring = Ring.create(tmp_path / "a.ring", ["a"], 1000)
    writer = subprocess.Popen([sys.executable, "-c", APPEND, str(ring.path)])
    try:
        wait_for(lambda: ring.head)
        heads = [ring.head for _ in range(1_000_000)]
    finally:
        ring.ask_to_stop()
        writer.wait(30)
    assert (np.diff(heads) >= 0).all()
    assert heads[-1] > heads[0]


def test_a_planned_change_is_not_undone_by_a_process_that_did_not_know_of_it() -> None:
    live_values = LiveValues.create(None, [GAIN, OVERRIDE])
    live_changes = LiveChanges(
        [GAIN, OVERRIDE], dict.fromkeys(("X.Pgain", "override"), lambda value: None), [(0, "override", 0.5)]
    )
    live_changes.live_values = live_values
    live_changes(0)
    assert live_values["override"] == 0.5
    live_values.set("X.Pgain", 3.0)
    live_changes(1)
    assert live_changes.values == {"X.Pgain": 3.0, "override": 0.5}
    assert [note.name for note in live_changes.taken] == ["override", "X.Pgain"]
