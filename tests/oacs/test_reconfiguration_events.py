"""Reconfigurations as `rds scan --watch` writes them down, and as the report reads them."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from typer.testing import CliRunner

from rds.bus.modules.oacs.events import EventFile, ModuleEvent, Reconfigurations
from rds.cli.main import app
from rds.core.errors import InputError
from rds.results.reports import make_report

Serve = Callable[..., subprocess.Popen[str]]


def follow(watching: Reconfigurations, word: str) -> list[ModuleEvent]:
    """What happens until that."""
    found: list[ModuleEvent] = []
    for _ in range(60):
        found += watching.look()
        if any(happened.event == word for happened in found):
            return found
    raise AssertionError(f"no {word!r} among {found}")


@pytest.mark.realtime
def test_a_module_replaced_by_another_is_a_reconfiguration_that_ends_when_it_is_described(
    serve: Serve, bus: can.BusABC, tmp_path: Path
) -> None:
    serve("X")
    old = serve("Z")
    watching = Reconfigurations(bus)
    begun = watching.look()
    assert [(happened.event, happened.module) for happened in begun] == [
        ("present", "LinrZa 2"),
        ("present", "LinrXa 4"),
    ]
    assert watching.expected == 2
    old.kill()
    old.wait()
    gone = follow(watching, "removed")
    assert [(happened.event, happened.module) for happened in gone] == [("removed", "LinrZa 2")]
    serve("A")
    back = follow(watching, "ready")
    assert [happened.event for happened in back] == ["added", "ready"] and back[0].module == "RotrAa 3"
    assert gone[0].time < back[0].time <= back[1].time
    file = EventFile(tmp_path / "events.csv")
    for happened in [*begun, *gone, *back]:
        file.add(happened)
    file.close()
    assert (tmp_path / "events.csv").read_text().splitlines()[0] == "time_s,event,module"
    report = make_report("reconfiguration", [tmp_path / "events.csv"], {})
    (row,) = report.tables[1].rows
    assert row[1] == "LinrZa 2 removed, RotrAa 3 added"
    assert row[2] == pytest.approx(back[1].time - gone[0].time, abs=0.002)
    assert row[3] == pytest.approx(back[1].time - back[0].time, abs=0.002)


@pytest.mark.realtime
def test_it_is_not_ready_while_a_number_is_used_twice_or_modules_are_missing(
    serve: Serve, bus: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.bus.modules.oacs.watch.PATIENCE", 12)  # calls: they follow each other without a pause here
    serve("X")
    watching = Reconfigurations(bus, modules=2)
    watching.look()
    double = serve("X")
    found = follow(watching, "clash") + [happened for _ in range(3) for happened in watching.look()]
    assert [happened.event for happened in found] == ["added", "clash"]
    double.kill()
    double.wait()
    follow(watching, "removed")
    assert not [happened for _ in range(3) for happened in watching.look()], "one is missing still"
    serve("drill")
    assert [happened.event for happened in follow(watching, "ready")] == ["added", "ready"]


def rds(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.realtime
def test_the_command_writes_the_file_and_one_object(serve: Serve, channel: str, tmp_path: Path) -> None:
    serve("X")
    file = tmp_path / "events.csv"
    where = ["scan", "--channel", channel, "--watch", "--seconds", 0.5]
    done = rds(*where, "--events", file, "--json")
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["expected"] == 1
    assert [(row["event"], row["module"]) for row in said["events"]] == [("present", "LinrXa 4")]
    assert file.read_text() == f"time_s,event,module\n{said['events'][0]['time_s']:.3f},present,LinrXa 4\n"
    again = rds(*where, "--events", file)
    assert again.exit_code == 2 and "events.csv: the file exists" in again.stderr
    assert "present" in rds(*where, "--events", file, "--force").stdout


@pytest.mark.parametrize(
    "words, complaint",
    [
        (["--events", "e.csv"], "--events belongs to --watch"),
        (["--modules", 2, "--seconds", 1], "--modules, --seconds belongs to --watch"),
        (["--watch", "--force"], "--force overwrites the file of --events"),
    ],
)
def test_no_word_is_ignored(words: list[Any], complaint: str) -> None:
    done = rds("scan", *words)
    assert done.exit_code == 2 and complaint in done.stderr


def test_how_many_there_should_be(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="modules = 0 must be at least 1"):
        Reconfigurations(None, modules=0)  # type: ignore[arg-type]
