"""A part program by the nodes' own methods in a session: what can be chosen, what is refused, a run and its report."""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from rds.bus.hub.bus_settings import DEFAULT_BAUD
from rds.bus.modules.dcs.frames import Status
from rds.bus.modules.dcs.host import Host
from rds.bus.modules.dcs.port import SerialPort
from rds.bus.modules.server_process import end_server, start_server
from rds.core.errors import InputError, RdsError
from rds.machines import load_machine
from rds.modes import EMULATION
from rds.panels.page.shell import Shell
from rds.panels.program.nodes import ByNodes
from rds.panels.program.nodes_view import NodesView
from rds.panels.program.state import Program
from rds.panels.session import Session

PATIENCE = 120.0  # s, on a busy computer
EDGE = "G21 G90 G94\nG1 X1 F300\nY1\nM2\n"
LONG = "G21 G90 G94\nG1 X60 F60\nM2\n"  # a minute


@pytest.fixture(autouse=True)
def runtime_directory(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A private place for lines."""
    base = tempfile.mkdtemp(prefix="rds", dir="/tmp")
    monkeypatch.setenv("XDG_RUNTIME_DIR", base)
    yield
    shutil.rmtree(base)


def by_nodes(folder: Path, machine: str, methods: str, text: str = EDGE) -> ByNodes:
    program = Program(Session(folder, machine))
    program.edit(text)
    made = ByNodes(program)
    for name in made.methods:
        made.choices.set(name, name in methods.split(","))
    return made


def test_the_methods_are_those_that_suit_the_machine(tmp_path: Path) -> None:
    serial = by_nodes(tmp_path, "starmill", "A")
    assert serial.methods == ("A", "B", "C", "C-thesis", "B-free", "C-free")
    assert by_nodes(tmp_path, "mini-cnc", "A").methods == ("A", "B", "C", "B-free", "C-free", "moves")


def test_a_machine_whose_nodes_have_no_method_says_why(tmp_path: Path) -> None:
    text = Path(load_machine("three-axis-mill").path).read_text()
    text = re.sub(r"node = (\d)", r"node = 2\1", text).replace('"linear-axis"', '"position-drive"')
    text = re.sub(r"(?m)^(tau|K|friction_\w+) = .*$", "", text)
    (tmp_path / "drives.toml").write_text(text)
    shell = Shell(Session(tmp_path, str(tmp_path / "drives.toml")))
    view = NodesView(shell, Program(shell.session))
    assert view.by_nodes.methods == ()
    assert "No node of this machine carries programs out by itself" in view.widget.children[0].value


def test_what_cannot_run_is_refused_before_anything_begins(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="choose a method first"):
        by_nodes(tmp_path, "mini-cnc", "").run()
    with pytest.raises(InputError, match="moves is run alone"):
        by_nodes(tmp_path, "mini-cnc", "A,moves").run()
    for machine, method in (("starmill", "C-thesis"), ("mini-cnc", "moves")):
        made = by_nodes(tmp_path, machine, method)
        made.program.choices.set("mode", EMULATION)
        with pytest.raises(InputError, match="no dry run"):
            made.run()
    assert not (tmp_path / "part.ngc").exists() and not (tmp_path / "runs").exists()


def test_two_methods_are_compared_in_a_report_among_the_runs(tmp_path: Path) -> None:
    run = by_nodes(tmp_path, "starmill", "A,B").run()
    run.start()
    assert run.wait(PATIENCE) and run.error is None and run.result is not None
    assert (tmp_path / "part.ngc").read_text() == EDGE
    (table,) = run.result.report().tables
    assert [row[0][0] for row in table.rows] == ["A", "B"]
    rounded, exact = table.column("commanded, max [µm]")
    assert rounded == pytest.approx(40.0, abs=20.0) and exact == pytest.approx(0.0, abs=1e-6)  # corners, or none
    assert list((tmp_path / "runs").iterdir()) == [run.folder]
    assert {"methods.html", "path.csv", "gauges-A.csv", "gauges-B.csv"} <= {each.name for each in run.folder.iterdir()}


def test_move_commands_have_a_report_of_their_own(tmp_path: Path) -> None:
    run = by_nodes(tmp_path, "mini-cnc", "moves").run()
    run.start()
    assert run.wait(PATIENCE) and run.error is None and run.result is not None
    report = run.result.report()
    assert [row[:2] for row in report.tables[0].rows] == [[2, "X"], [3, "Y"]]
    assert list(report.figures) == ["Positions"]


def test_a_fault_of_the_program_is_said_and_the_machine_is_free_again(tmp_path: Path) -> None:
    made = by_nodes(tmp_path, "starmill", "A", "G21 G90\nG1 X900 F300\nM2\n")
    made.program.choices.set("mode", "implementation")
    run = made.run()
    run.start()
    assert run.wait(PATIENCE) and isinstance(run.error, RdsError) and "X900" in str(run.error)
    assert made.program.session.machine_user is None


def test_a_result_that_cannot_be_shown_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shell = Shell(Session(tmp_path, "starmill"))
    view = NodesView(shell, Program(shell.session))
    run = SimpleNamespace(start=lambda: None, note="", share=None, seconds_left=None, stopping=False, real_time=False)
    run.notes, run.done, run.stopped, run.error, run.result = [], False, False, None, object()
    monkeypatch.setattr(view.by_nodes, "run", lambda: run)
    view._start()
    run.done = True
    shell.ticker.tick()
    assert "showing the run failed" in view.notice.value


@pytest.mark.realtime
def test_a_run_that_no_browser_shows_any_more_is_stopped(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(LONG)
    shell = Shell(Session(tmp_path, "starmill"))
    view = NodesView(shell, Program(shell.session))
    view.by_nodes.program.choices.set("mode", "implementation")
    view.button.click()
    task = shell.session.tasks[-1]
    shell.ticker.tick()
    assert not task.stopping
    shell.still_here.until = 0.0
    shell.ticker.tick()
    assert task.stopping and task.wait(PATIENCE) and task.stopped and shell.session.machine_user is None


@pytest.mark.realtime
def test_a_run_that_is_stopped_leaves_the_units_standing(tmp_path: Path) -> None:
    """The buffers that they hold are of many seconds."""
    server = start_server("dcs", "starmill", "starmill")
    try:
        made = by_nodes(tmp_path, "starmill", "C", LONG)
        made.program.choices.set("mode", "implementation")
        run = made.run()
        run.start()
        deadline = time.monotonic() + PATIENCE
        while not (run.share or 0.0) > 0.02 and time.monotonic() < deadline:
            time.sleep(0.05)
        with pytest.raises(InputError, match="the machine is in use"):
            made.run().start()
        run.stop()
        assert run.wait(PATIENCE) and run.stopped and run.error is None
        assert made.program.session.machine_user is None and not run.folder.exists()
        port = SerialPort("starmill", DEFAULT_BAUD)
        host = Host(port, DEFAULT_BAUD, {2: "X"})
        report = host.inquire(2)
        port.close()
        assert not report.status & Status.EXECUTING and report.counts < 6000  # steps of 0.01 mm
    finally:
        end_server(server)
