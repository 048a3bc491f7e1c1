"""A module exchanged in the running session: lost, another one found, judged, accepted, and it moves."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from typer.testing import CliRunner
from waiting import wait_for

import rds
from rds.bus.modules.oacs.events import ModuleEvent
from rds.bus.modules.oacs.offers import Offer, Offers
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.modes.experiment import Experiment
from rds.modes.experiment.exchange import ExchangeCalls, run_through_exchanges
from rds.modes.experiment.run import Run
from rds.nc.run.run import PartProgram
from rds.results import Result
from rds.results.reports import make_report

_CONTROLS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")  # of a terminal: colours, the cursor
Serve = Callable[..., subprocess.Popen[str]]


def follow(offers: Offers, events: list[str], module: str = "") -> Offer:
    """The next offer; what happens until then is added to `events`."""
    for _ in range(80):
        happened, offer = offers.look()
        events += [f"{each.event} {each.module}".strip() for each in happened]
        if offer is not None:
            return offer
    raise AssertionError(f"no offer after {events}")


def end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()


@pytest.mark.realtime
def test_a_module_is_exchanged_and_the_session_goes_on(serve: Serve, bus: can.BusABC, tmp_path: Path) -> None:
    serve("drill")
    serve("Z")
    slide = serve("X")
    own = load_machine("mrmt-oacs")
    offers = Offers(bus, own)
    assert offers.look()[1] is None, "nothing has changed"
    events: list[str] = []
    end(slide)
    less = follow(offers, events)
    assert events == ["removed LinrXa 4", "offered"]
    assert less.order == [5, "oacs-range-arm", 2] and less.verdict.ok
    table = serve("A")
    wrong = follow(offers, events)
    assert events[2:] == ["added RotrAa 3", "refused"]
    assert "does not fit on 'A'" in str(wrong.verdict)
    with pytest.raises(InputError, match="does not fit on 'A'"):
        offers.accept(wrong, tmp_path / "wrong.toml")
    assert not (tmp_path / "wrong.toml").exists()
    end(table)
    follow(offers, events)
    serve("X")
    right = follow(offers, events)
    assert right.order == [5, "oacs-range-arm", 2, 4] and right.verdict.ok
    machine, ready = offers.accept(right, tmp_path / "own.toml")
    assert list(machine.axes) == ["T", "Z", "X"]
    assert machine.axis("X").model == own.axis("X").model and machine.axis("Z").limits == own.axis("Z").limits
    moving = offers.move("X", 0.5)
    assert moving.event == "moving" and moving.time >= ready.time
    with pytest.raises(InputError, match="no axis 'A' to move; it has T, Z, X"):
        offers.move("A", 1.0)


@pytest.mark.realtime
def test_the_command_says_writes_and_measures(serve: Serve, bus: can.BusABC, channel: str, tmp_path: Path) -> None:
    """Watched by a process of its own, which is told when to end by its own acceptance."""
    serve("drill")
    serve("Z")
    out, events = tmp_path / "own.toml", tmp_path / "events.csv"
    command = [sys.executable, "-m", "rds", "machine", "watch", "mrmt-oacs", "-c", channel, "-o", str(out)]
    command += ["--yes", "--once", "--move", "X=0.5", "--events", str(events), "--seconds", "60"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None
        assert "there is" in watching.stdout.readline()
        serve("X")
        said = watching.stdout.read()
    assert watching.returncode == 0
    assert "found LinrXa 4" in said and "is a machine" in said and f"accepted {out}" in said and "moves X" in said
    report: Any = make_report("reconfiguration", [events], {})
    times = {row[0]: row[2] for row in report.tables[0].rows}
    assert 0.0 < times["last module plugged in until moving"] < 60.0
    assert times["last change until ready"] <= times["last module plugged in until moving"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--json"], "--json cannot ask; add --yes"),
        (["--yes", "--move", "X"], "--move 'X' must be AXIS=DISTANCE"),
    ],
)
def test_what_is_wrong_is_said(options: list[str], says: str, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["machine", "watch", "mrmt-oacs", "-o", str(tmp_path / "own.toml"), *options])
    assert told.exit_code == 2 and says in told.stderr


@pytest.mark.realtime
def test_a_run_ends_is_offered_a_machine_and_goes_on_by_itself(serve: Serve, channel: str, tmp_path: Path) -> None:
    """The slide is pulled out in the run; a new one, plugged in afterwards, is in a file whose axes stand otherwise."""
    serve("drill,Z")
    slide = serve("X")
    experiment = Experiment(
        machine="mrmt-oacs",
        axis=("X", "Z"),
        mode="implementation",
        duration=1.5,
        sample_period=0.01,
        reference=rds.sinusoid(1.0, 0.5),
        controller={"name": "pid"},
        bus={"dialect": "oacs", "channel": channel},
    )
    events: list[str] = []
    refused: list[str] = []

    def go(of: Experiment, run: Run) -> Result:
        wait_for(lambda: run.progress[0] >= 20 or run.done)
        if not events.count("ready"):
            end(slide)
        return run.wait()

    def tell(happened: ModuleEvent) -> None:
        events.append(happened.event)

    def refuse(offer: Offer, why: str) -> None:
        refused.append(why)
        if len(refused) == 1:
            serve("X")

    hands = ExchangeCalls(lambda offer: True, refuse, tell)
    first, *others, last = run_through_exchanges(experiment, tmp_path / "own.toml", hands, out=tmp_path / "out", go=go)
    assert first.meta["ending"] == "machine lost" and first.meta["machine"] == "mrmt-oacs"
    assert "X" in first.meta["ending_reason"]
    assert (
        "this run cannot go on with it" in refused[0] and "names 'X', which machine 'own' does not have" in refused[0]
    )
    kept = [event for event in events if event in ("removed", "added", "ready", "moving")]
    assert kept[:4] == ["removed", "added", "ready", "moving"]
    assert last.meta["machine"] == "own" and (tmp_path / f"out-{2 + len(others)}").is_dir()
    own = load_machine(str(tmp_path / "own.toml"))
    assert list(own.axes) == ["T", "Z", "X"] and own.slots == {"T": 3, "Z": 1, "X": 0}, "as the modules know them"
    for axis in ("X", "Z"):
        assert np.ptp(last[f"{axis}_measured"]) > 0.8, "each takes its own voltage"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"mode": "simulation", "bus": {"dialect": "oacs"}}, "in mode simulation there is none"),
        ({"bus": {"dialect": "rds"}}, "modules of dialect rds do not say what they are"),
        ({"bus": {"dialect": "oacs"}, "file": "own.txt"}, "must end with .toml"),
        ({"bus": {"dialect": "oacs"}, "file": "there.toml"}, "there is such a file already"),
    ],
)
def test_an_exchange_is_refused_where_none_can_be(words: dict[str, Any], says: str, tmp_path: Path) -> None:
    (tmp_path / "there.toml").write_text("")
    file = tmp_path / words.pop("file", "own.toml")
    given = {"mode": "implementation", "reference": rds.sinusoid(1.0, 0.5), "controller": {"name": "pid"}}
    with pytest.raises(InputError, match=says):
        run_through_exchanges(Experiment(machine="mrmt-oacs", **given | words), file, ExchangeCalls(lambda offer: True))


@pytest.mark.realtime
def test_a_slide_is_exchanged_in_a_part_program_and_accepted_at_the_prompt(
    serve: Serve, channel: str, tmp_path: Path
) -> None:
    """All of it in processes of their own: the command in a terminal, the modules; the slide's is killed."""
    serve("drill,Z,A")
    slide = serve("X")
    (tmp_path / "part.ngc").write_text("G21 G90 G94 G61\nG1 X2 Z-1 F60\nX0 Z0\nM2\n")
    bus = f'[bus]\ndialect = "oacs"\nchannel = "{channel}"\n'
    (tmp_path / "bus.toml").write_text(f'machine = "mrmt-oacs"\nsample_period = 0.01\ncontroller = "pid"\n{bus}')
    command = [sys.executable, "-m", "rds", "nc", "run", "part.ngc", "--controller", "bus.toml", "-m", "implementation"]
    command += ["--exchange", "own.toml", "--events", "events.csv", "-o", "out"]
    terminal, inner = pty.openpty()
    said = ""

    def until(text: str, seconds: float = 60.0) -> None:
        nonlocal said
        ends = time.monotonic() + seconds
        while text not in said:
            assert time.monotonic() < ends, f"no {text!r} in {said}"
            if select.select([terminal], [], [], 0.1)[0]:
                said += _CONTROLS.sub("", os.read(terminal, 65536).decode(errors="replace"))

    running = subprocess.Popen(command, stdin=inner, stdout=inner, stderr=inner, cwd=tmp_path)
    try:
        until("% of")
        end(slide)
        until("lost LinrXa 4")
        until("does not fit on 'A'")
        serve("X")
        until("accept it, and run again on it?")
        assert "own" not in {path.stem for path in tmp_path.iterdir()}, "nothing is written before it is accepted"
        os.write(terminal, b"y\n")
        until("accepted own.toml")
        until("csv: out-2")
        assert running.wait(60.0) == 0
    finally:
        end(running)  # else it would be waited for without end when one of these does not hold
        os.close(inner)
        os.close(terminal)
    assert "the run ended early (machine lost): no answer from X" in said
    first, second = (rds.open_result(tmp_path / folder) for folder in ("out", "out-2"))
    assert first.meta["machine"] == "mrmt-oacs" and first.meta["program"]["completed"] is False
    assert second.meta["machine"] == "own" and second.meta["program"]["completed"] is True
    assert second["X_measured"].max() == pytest.approx(2.0, abs=0.1), "from its first line, on the new slide"
    report: Any = make_report("reconfiguration", [tmp_path / "events.csv"], {})
    times = {row[0]: row[2] for row in report.tables[0].rows}
    assert 0.0 < times["last module plugged in until moving"] < 60.0


def test_a_part_program_goes_on_on_another_machine(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nG1 X2 Z-1 F60\nG1 X0 Z0\nM2\n")
    before = PartProgram(tmp_path / "part.ngc", "mrm-mill-4")
    after = before.with_machine("mrm-mill", channel="there")
    assert after.plan().machine.name == "mrm-mill" and after.plan().bus["channel"] == "there"
    assert before.plan().machine.name == "mrm-mill-4" and before.plan().names != after.plan().names
    assert after.run()["X_measured"].max() == pytest.approx(2.0, abs=0.05)
