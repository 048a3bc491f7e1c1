"""Long work, the claim to the machine, and the runs of a folder."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.modes.process.record import NAME
from rds.panels.session import Session
from rds.panels.session.fields import Number
from rds.panels.session.kept_runs import State
from rds.panels.session.task import Task


def test_a_task_says_how_far_it_is_and_keeps_its_result(tmp_path: Path) -> None:
    half, on = threading.Event(), threading.Event()

    def work(task: Task[int]) -> int:
        task.advance(5, 10, "fitting")
        half.set()
        on.wait(10)
        return 42

    task = Session(tmp_path).work("fit", work)
    assert half.wait(10) and task.share == 0.5 and task.note == "fitting" and not task.done
    assert task.seconds_left is not None and task.seconds_left >= 0.0
    on.set()
    assert task.wait(10) and task.result == 42 and task.share == 1.0


def test_a_stopped_task_ends_at_its_next_word() -> None:
    begun = threading.Event()

    def work(task: Task[None]) -> None:
        for step in range(10**9):
            task.advance(step, 10**9)
            begun.set()

    task = Task("endless", work).start()
    assert begun.wait(10)
    task.stop()
    assert task.wait(10) and task.stopped and task.result is None


def test_a_task_keeps_its_error() -> None:
    def work(task: Task[None]) -> None:
        raise InputError("no data")

    task = Task("bad", work).start()
    assert task.wait(10) and isinstance(task.error, InputError) and not task.stopped


def test_what_another_page_has_chosen_in_several_panels_is_taken_over(tmp_path: Path) -> None:
    pages = [Session(tmp_path), Session(tmp_path)]
    for page in pages:
        for panel in ("one", "two"):
            page.choices(panel, [Number("x", "X", "", 0.0)])
    here, other = pages
    for panel in ("one", "two"):
        other.choices(panel, []).set("x", 2.0)
    here.refresh()
    assert [here.choices(panel, [])["x"] for panel in ("one", "two")] == [2.0, 2.0]
    again = Session(tmp_path)
    assert [again.kept(panel, "x") for panel in ("one", "two")] == [2.0, 2.0]


def test_what_another_page_has_kept_of_other_panels_is_not_written_over(tmp_path: Path) -> None:
    def choose(page: Session, panel: str, value: float) -> None:
        page.choices(panel, [Number("x", "X", "", 0.0)]).set("x", value)

    choose(Session(tmp_path), "two", 1.0)
    here, other = Session(tmp_path), Session(tmp_path)
    choose(other, "two", 3.0)
    choose(here, "one", 2.0)
    again = Session(tmp_path)
    assert [again.kept(panel, "x") for panel in ("one", "two")] == [2.0, 3.0]
    here.refresh()
    assert here.choices("two", [Number("x", "X", "", 0.0)])["x"] == 3.0


class User:
    """Something that uses the machine."""

    stopped = False

    def stop(self) -> None:
        self.stopped = True


def test_the_machine_has_one_user_on_a_page(tmp_path: Path) -> None:
    session, user = Session(tmp_path), User()
    session.take_machine("a run of X", user)
    with pytest.raises(InputError, match="in use on this page: a run of X; stop"):
        session.take_machine("another", User())
    session.give_machine_back(User())  # of somebody who has it not: no change
    assert session.machine_user is user
    session.give_machine_back(user)
    session.take_machine("another", User())


def test_another_page_of_the_folder_is_told_who_has_the_machine(tmp_path: Path) -> None:
    code = (
        "import sys; from rds.panels.session import Session\n"
        "session = Session(sys.argv[1]); session.take_machine('a run of X', object()); print('has', flush=True)\n"
        "sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert other.stdin is not None and other.stdout is not None
    try:
        assert other.stdout.readline() == "has\n"
        here = Session(tmp_path)
        with pytest.raises(InputError, match="in use by another page: a run of X, since"):
            here.take_machine("mine", User())
        other.kill()
        other.wait(10)
        here.take_machine("mine", User())  # a page that is gone holds nothing
    finally:
        other.kill()
        other.communicate()


def test_runs_of_the_folder_and_what_became_of_them(tmp_path: Path) -> None:
    import rds

    session = Session(tmp_path)
    assert session.runs() == []
    experiment = rds.Experiment(axis="X", duration=0.1, reference=rds.sinusoid(1.0, 5.0), controller="p")
    experiment.run(out=tmp_path / "runs" / "first")
    (tmp_path / "runs" / "second").mkdir()
    (tmp_path / "runs" / "second" / NAME).write_bytes(b"RDS record 1\n")
    (tmp_path / "runs" / "empty").mkdir()
    found = {run.name: run.state for run in session.runs()}
    assert found == {"first": State.WHOLE, "second": State.CUT_SHORT}
    assert len(next(run for run in session.runs() if run.name == "first").open()) == 100


def test_of_many_runs_only_the_latest_are_looked_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(50):
        folder = tmp_path / "runs" / f"run-{number}"
        folder.mkdir(parents=True)
        (folder / "result.csv").touch()
        os.utime(folder, (number, number))
    looked: list[Path] = []

    def state(folder: Path) -> State:
        looked.append(folder)
        return State.WHOLE

    monkeypatch.setattr("rds.panels.session.kept_runs.state_of", state)
    assert [run.name for run in Session(tmp_path).runs(2)] == ["run-49", "run-48"]
    assert len(looked) == 2


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe\x00", b"[" * 100_000, b"\xef\xbb\xbf{}"])
def test_kept_choices_that_cannot_be_read_are_said_to_whoever_opens_the_page(content: bytes, tmp_path: Path) -> None:
    from rds.panels.page.shell import Shell

    (tmp_path / "session.json").write_bytes(content)
    shell = Shell(Session(tmp_path))
    shell.ticker.tick()
    assert any("panels begin with their defaults" in getattr(each, "value", "") for each in shell.widget.children)


def test_a_folder_that_is_full_or_gone_refuses_in_words_and_holds_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise InputError("No space left on device")

    folder = tmp_path / "files"
    folder.mkdir()
    session, user = Session(folder), object()
    with monkeypatch.context() as patched:
        patched.setattr("rds.panels.session.claim.write_whole", full)
        session.take_machine("a run", user)  # what it is for is not told to others: no reason not to run
    session.give_machine_back(user)
    session.take_machine("another", user)
    session.give_machine_back(user)
    for each in folder.iterdir():
        each.unlink()
    folder.rmdir()
    with pytest.raises(InputError, match="cannot be written"):
        session.take_machine("a run", user)
    assert session.machine_user is None


def test_a_release_where_the_machine_has_ended_says_why_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # a built-in bus on which nobody is
    session = Session(tmp_path)
    said = session.release_emergency_stop()
    assert said.startswith("no module is on the bus") and "a machine that a run or Jog starts ends with it" in said
    said = session.emergency_stop()  # silence is no proof that nothing moves
    assert "no module is on the bus that acknowledges it. If something moves, cut the power" in said
