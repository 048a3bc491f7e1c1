"""What `rds app` tells the pages that it serves."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path
from typing import Any

import pytest

from rds.machines import load_machine
from rds.panels.app import page, serve


def test_a_machine_is_found_from_the_folder_of_the_page_and_a_date_is_a_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "files").mkdir()
    (tmp_path / "own.toml").write_text(Path(load_machine("mini-cnc").path).read_text())
    told: dict[str, str] = {}

    class NoKernels:
        def close(self) -> None:
            """Nothing was begun."""

    def server(_: Any) -> Any:
        return lambda argv: told.update(os.environ)

    for name in ("JUPYTER_PATH", page.FOLDER, page.MACHINE, page.PANEL, page.BUS, page.WHEREABOUTS):
        monkeypatch.setenv(name, "")  # put back afterwards
    monkeypatch.setattr(serve, "ReadyKernels", NoKernels)
    monkeypatch.setattr(serve, "_server", server)
    monkeypatch.chdir(tmp_path)
    bus = {"interface": "pcan", "since": datetime.date(2020, 1, 1)}
    serve.serve(Path("files"), "own.toml", "menu", None, False, bus=bus)
    assert told[page.MACHINE] == str(tmp_path / "own.toml")
    assert json.loads(told[page.BUS]) == {"interface": "pcan", "since": "2020-01-01"}
    serve.serve(Path("files"), "mini-cnc", "menu", None, False)
    assert (told[page.MACHINE], told[page.BUS]) == ("mini-cnc", "{}")
