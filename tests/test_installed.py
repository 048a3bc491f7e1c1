"""What an installed package needs beyond a checkout: its documents once each, extras named where they are missing."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from documents import ROOT
from typer.testing import CliRunner

import rds.cli.fit as fit_command
import rds.core.compiling as compiling
import rds.panels.help.build as build
from rds.cli.main import app
from rds.identification.structures.structures import structure
from rds.panels.app import serve


def test_the_documents_of_a_wheel_are_there_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = shutil.copytree(ROOT / "docs", tmp_path / "help" / "docs")
    for name in ("README.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, installed)
    checkout = set(build.sources())
    monkeypatch.setattr(build, "_HERE", installed.parent)
    assert set(build.sources()) == checkout
    assert all(path.is_file() and installed in path.parents for path in build.sources().values())


def test_a_page_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def without(*_: object, **__: object) -> None:
        raise ModuleNotFoundError("No module named 'ipywidgets'", name="ipywidgets")

    monkeypatch.setattr(serve, "serve", without)
    done = CliRunner().invoke(app, ["app", "--no-browser"])
    assert done.exit_code == 2
    assert "the page needs ipywidgets, which is not installed: pip install 'rds[lab]'" in done.stderr


def test_a_fit_that_is_not_compiled_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(compiling, "COMPILED", True)
    fit_command._say_if_slow(structure("axis"))
    assert not capsys.readouterr().err
    monkeypatch.setattr(compiling, "COMPILED", False)
    fit_command._say_if_slow(structure("axis"))
    assert "pip install 'rds[fast]'" in capsys.readouterr().err
