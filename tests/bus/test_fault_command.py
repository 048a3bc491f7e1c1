"""`rds bus fault` and `rds machine serve`: no word is passed over, and too much at once is refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import can
import pytest
from typer.testing import CliRunner

from rds.bus.hub.faults import Faults
from rds.cli.main import app
from rds.core.errors import InputError

SCHEDULE = '[[fault]]\nkind = "unplug"\nnode = "X"\nat = 100.0\n'


def run(*words: str) -> tuple[int, str]:
    ran = CliRunner().invoke(app, list(words))
    return ran.exit_code, ran.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["clear", "X"], "leave node away"),
        (["clear", "--count", "3", "--id", "0x10"], "leave count, id away"),
        (["--file", "faults.toml", "--for", "2"], "leave for away"),
        (["--file", "faults.toml", "--at", "1"], "leave at away"),
    ],
)
def test_words_that_change_nothing_are_refused(
    words: list[str], said: str, open_bus: Callable[..., can.BusABC], tmp_path: Path
) -> None:
    open_bus("test", bitrate=1_000_000, name="X")
    (tmp_path / "faults.toml").write_text(SCHEDULE)
    words = [str(tmp_path / word) if word.endswith(".toml") else word for word in words]
    code, error = run("bus", "fault", *words, "--channel", "test")
    assert code == 2 and said in error
    assert run("bus", "fault", "--file", str(tmp_path / "faults.toml"), "--channel", "test")[0] == 0
    assert run("bus", "fault", "clear", "--channel", "test")[0] == 0


def test_a_schedule_that_is_too_long_is_refused_and_the_bus_goes_on(
    open_bus: Callable[..., can.BusABC], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RDS_FILE_LIMITS", "2")  # the file may be longer than what the hub is asked at once
    one, other = open_bus("test", bitrate=1_000_000, name="X"), open_bus("test", name="Y")
    path = tmp_path / "faults.toml"
    path.write_text(SCHEDULE * 30_000)
    code, error = run("bus", "fault", "--file", str(path), "--channel", "test")
    assert code == 2 and "give the schedule in parts" in error
    one.send(can.Message(arbitration_id=1, is_extended_id=False, data=b"on"), 1.0)
    message = other.recv(10.0)
    assert message is not None and bytes(message.data) == b"on"


def test_after_a_question_that_was_too_long_the_line_still_serves(open_bus: Callable[..., can.BusABC]) -> None:
    open_bus("test", name="X")
    with Faults("test") as faults:
        with pytest.raises(InputError, match="too much at once"):
            faults._ask("inject", faults=["x" * (1 << 21)])
        assert [node["name"] for node in faults.nodes()] == ["X"]


@pytest.mark.parametrize("words", [["--bitrate", "0"], ["--channel", ""]])
def test_a_machine_is_not_served_elsewhere_than_asked(words: list[str]) -> None:
    code, error = run("machine", "serve", "mini-cnc", *words)
    assert code == 2 and words[0].strip("-") in error


@pytest.mark.parametrize("command", [["monitor", "--seconds", "0.1"], ["record", "x.log", "--seconds", "0.1"]])
def test_an_empty_channel_is_none(command: list[str]) -> None:
    code, error = run("bus", *command, "--channel", "")
    assert code == 2 and "channel ''" in error
