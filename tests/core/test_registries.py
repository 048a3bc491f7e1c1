"""What stands in a registry is what the command line, the panels and the documentation offer; nobody restates it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.modes import MODES, load_mode, mode_names
from rds.modes.loop.mode import Drive, Mode
from rds.panels.session.fields import mode_choice

ROOT = Path(rds.__file__).parent
DOCS = ROOT.parent / "docs"
# the method of estimation by simulation has the name of a mode
OTHER_MEANINGS = {"identification/structures/__init__.py"}


def strings(path: Path) -> set[str]:
    """The texts in a file that are a whole word of data, no sentence."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def test_only_the_modes_spell_their_names() -> None:
    """Elsewhere a mode is one of the registry, or a constant of `rds.modes`; what follows from it, the mode says."""
    spelled = {
        str(path.relative_to(ROOT)): names
        for path in ROOT.rglob("*.py")
        if path.relative_to(ROOT).parts[0] != "modes" and (names := strings(path) & set(mode_names()))
    }
    assert set(spelled) == OTHER_MEANINGS, spelled


@pytest.mark.parametrize("name", MODES.names())
def test_a_mode_says_what_others_must_know(name: str) -> None:
    mode = load_mode(name)
    assert isinstance(mode, Mode) and mode.name == name
    assert mode.label and mode.about and mode.drives
    assert mode.real_time or not mode.moves_machine
    assert mode.followed is None or mode.modelled


@pytest.mark.parametrize("name", MODES.names())
@pytest.mark.parametrize("command", [["run"], ["nc", "run"]])
def test_the_command_line_offers_each_mode(command: list[str], name: str) -> None:
    shown = CliRunner().invoke(app, [*command, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"}).output
    assert name in shown


@pytest.mark.parametrize("drives", ["controller", "signal"])
def test_the_panels_offer_each_mode(drives: Drive) -> None:
    choice = mode_choice(drives)
    assert [*choice.options] == [name for name in mode_names() if drives in load_mode(name).drives]
    assert all(load_mode(name).about in choice.tooltip for name in choice.options)


@pytest.mark.parametrize("name", MODES.names())
def test_the_documentation_has_a_row_for_each_mode(name: str) -> None:
    text = (DOCS / "experiments.md").read_text(encoding="utf-8")
    assert re.search(rf"^\| `{name}` \|", text, re.MULTILINE)
