"""What stands in a registry is what the command line, the panels and the documentation offer; nobody restates it."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner

import rds
from rds import controllers, interpolators, models
from rds.bus.modules.dialects import dialect_names
from rds.bus.tools import logs
from rds.cli.main import app
from rds.core.quantities import Quantity
from rds.core.shared_quantities import FEED_OVERRIDE, FEED_SHARE, SAMPLE_PERIOD
from rds.grading import criteria, exports
from rds.identification.fit import fit
from rds.identification.logs import tables
from rds.identification.structures import structures
from rds.interpolators import acceleration
from rds.machines import Machine, load_machine
from rds.modes import MODES, load_mode, mode_names
from rds.modes.loop.mode import Drive, Mode
from rds.modes.loop.program import OVERRIDE, program_channels
from rds.panels.data.state import _fields as data_fields
from rds.panels.equipment import fields as equipment
from rds.panels.grading.state import _fields as grading_fields
from rds.panels.interpolator import motion
from rds.panels.interpolator.fields import filter_fields
from rds.panels.machine.fields import SERVED
from rds.panels.program.state import _fields as program_fields
from rds.panels.session.fields import Choice, Field, Number, mode_choice
from rds.references import signal_kinds, signal_options
from rds.results import reports

ROOT = Path(rds.__file__).parent
DOCS = ROOT.parent / "docs"
# the method of estimation by simulation has the name of a mode
OTHER_MEANINGS = {"identification/structures/__init__.py"}


def strings(path: Path, words: set[str]) -> set[str]:
    """Those of the words that are a whole text in a file, and not a part of a sentence."""
    text = path.read_text(encoding="utf-8")
    if not any(f"{quote}{word}{quote}" in text for word in words for quote in "'\""):
        return set()
    tree = ast.parse(text)
    return words & {
        node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def test_only_the_modes_spell_their_names() -> None:
    """Elsewhere a mode is one of the registry, or a constant of `rds.modes`; what follows from it, the mode says."""
    spelled = {
        str(path.relative_to(ROOT)): names
        for path in ROOT.rglob("*.py")
        if path.relative_to(ROOT).parts[0] != "modes" and (names := strings(path, set(mode_names())))
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


# Every other table of parts: its names, and the document that has a word on each.
TABLES: dict[str, tuple[list[str], str]] = {
    "models": (models.LIBRARY.names(), "experiments.md"),
    "controllers": (controllers.LIBRARY.names(), "experiments.md"),
    "signals": (signal_kinds(), "experiments.md"),
    "interpolators": (interpolators.LIBRARY.names(), "interpolation.md"),
    "accelerations": (acceleration.LIBRARY.names(), "interpolation.md"),
    "structures": (structures.LIBRARY.names(), "identification.md"),
    "methods of estimation": (fit.METHODS.names(), "identification-methods.md"),
    "dialects": (dialect_names(), "experiments.md"),
    "bus logs": (list(logs.ENDINGS), "bus.md"),
    "logged data": ([*tables.TEXTS, *tables.MEASUREMENTS], "data.md"),
    "reports": (reports.KINDS.names(), "thesis-reports.md"),
    "criteria": (criteria.KINDS.names(), "assignments.md"),
    "gradebooks": (exports.GRADEBOOKS.names(), "grading.md"),
}


@pytest.mark.parametrize("parts", TABLES)
def test_the_documentation_names_each_part(parts: str) -> None:
    names, document = TABLES[parts]
    text = (DOCS / document).read_text(encoding="utf-8")
    missing = [name for name in names if not re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", text)]
    assert not missing, f"docs/{document} does not name {missing}"


# Where the command line lists them.
COMMANDS = {
    "structures": ["fit"],
    "methods of estimation": ["fit"],
    "dialects": ["machine", "serve"],
    "reports": ["report"],
    "gradebooks": ["grade", "export"],
}


@pytest.mark.parametrize("parts", COMMANDS)
def test_the_command_line_lists_each_part(parts: str) -> None:
    shown = CliRunner().invoke(app, [*COMMANDS[parts], "--help"], env={"COLUMNS": "300", "NO_COLOR": "1"}).output
    missing = [name for name in TABLES[parts][0] if name not in shown]
    assert not missing, f"rds {' '.join(COMMANDS[parts])} --help does not name {missing}"


# The field of a panel that offers them, made by the panel's own function.
FIELDS: dict[str, Callable[[Machine], Iterable[Field]]] = {
    "controllers": lambda machine: [equipment.controllers(machine, machine.axes["X"])],
    "signals": lambda machine: [equipment.shapes("control", ["X"])],
    "interpolators": lambda machine: [field for field in motion.motion_fields() if field.name == "interpolator"],
    "accelerations": lambda machine: [field for field in filter_fields("", 0.1) if field.name == "acceleration"],
    "structures": lambda machine: [field for field in data_fields() if field.name == "structure"],
    "methods of estimation": lambda machine: [field for field in data_fields() if field.name == "method"],
    "dialects": lambda machine: [SERVED],
    "gradebooks": lambda machine: [field for field in grading_fields() if field.name == "to"],
}


@pytest.mark.parametrize("parts", FIELDS)
def test_the_panels_offer_each_part(parts: str) -> None:
    (field,) = FIELDS[parts](load_machine("mini-cnc"))
    assert isinstance(field, Choice)
    assert set(TABLES[parts][0]) <= set(field.options)


@pytest.mark.parametrize("kind", [kind for kind in signal_kinds() if kind != "user"])
def test_the_panel_asks_for_all_that_a_signal_needs(kind: str) -> None:
    asked = {field.name.removeprefix(equipment.OF_SIGNAL) for field in equipment.signal_fields(kind, "mm")}
    assert {*signal_options(kind).needed} <= asked | {*equipment.sizes_of(kind)}


@pytest.mark.parametrize("name", controllers.LIBRARY.names())
def test_the_panel_asks_for_the_options_of_a_controller(name: str) -> None:
    asked = {field.name for field in equipment.parameter_fields(name, load_machine("mini-cnc").axes["X"])}
    wanted = {f"{equipment.PREFIX}{option}" for option in controllers.controller_module(name).OPTIONS}
    assert asked == wanted or name == "tracking"  # a pair of poles, two numbers


@pytest.mark.parametrize(
    ("command", "option", "quantity"),
    [
        (["nc", "time"], "--sample-period", SAMPLE_PERIOD),
        (["nc", "run"], "--override", FEED_OVERRIDE),
        (["nc", "operate"], "--override", FEED_OVERRIDE),
    ],
)
def test_an_option_has_the_range_of_its_declaration(command: list[str], option: str, quantity: Quantity) -> None:
    group: Any = get_command(app)
    for word in command:
        group = group.commands[word]
    (found,) = [each for each in group.params if option in each.opts]
    bounds = found if hasattr(found, "min") else found.type  # by the release of typer
    assert (bounds.min, bounds.max) == (quantity.low, quantity.high)
    assert quantity.meaning.lower() in found.help.lower() and quantity.unit in found.help


def test_the_override_has_one_range_at_every_door() -> None:
    (channel,) = [each for each in program_channels() if each.name == OVERRIDE]
    (field,) = [each for each in program_fields(ROOT, "pid") if each.name == "override"]
    assert isinstance(field, Number)
    assert (channel.low, channel.high) == (FEED_SHARE.low, FEED_SHARE.high)
    assert (field.low, field.high, field.default) == (FEED_OVERRIDE.low, FEED_OVERRIDE.high, FEED_OVERRIDE.default)
