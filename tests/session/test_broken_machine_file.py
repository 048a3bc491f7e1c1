"""A machine's file that was broken since the page was opened keeps nobody from stopping the machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.core.errors import MachineError
from rds.machines import load_machine
from rds.panels.session import Session


def test_the_emergency_stop_reaches_a_machine_whose_file_is_broken_by_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "own.toml"
    file.write_text(Path(load_machine("mini-cnc").path).read_text())
    asked: list[str | None] = []
    monkeypatch.setattr(Session, "_on", lambda self, channel, act: asked.append(channel) or [1])
    session = Session(tmp_path, str(file))
    file.write_text("name = 'broken\n")
    assert "1 modules are at zero volts" in session.emergency_stop()
    assert asked == ["mini-cnc"]

    late = Session(tmp_path, str(file))  # as a page's server makes one
    late.channels.add("bench")
    with pytest.raises(MachineError, match=r"own\.toml cannot be read.*cut the power, or correct the file"):
        late.emergency_stop()
    assert asked == ["mini-cnc", "bench"]  # what is known was stopped all the same
