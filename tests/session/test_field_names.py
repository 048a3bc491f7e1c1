"""Messages of the library on the page: options are named by the panels' fields, and no flag is left over."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import rds
from rds.panels.kit.field_names import DIALECT, FIELDS, in_fields
from rds.panels.kit.notice import Notice
from rds.panels.program.check import Mark
from rds.panels.program.state import OPTIONS

ROOT = Path(rds.__file__).parent
# the library that panels call; commands, and what only they and other programs start, are not among it
FLAG = re.compile(r"(^|[ (`])--[a-z]")
ROOMS = ("identification", "nc", "machines", "checks", "interpolators", "results", "modes", "models", "controllers")


def messages() -> list[str]:
    """Every text of the library, outside of docstrings, that names an option."""
    found = []
    for room in ROOMS:
        for file in (ROOT / room).rglob("*.py"):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            texts = [node for node in ast.walk(tree) if isinstance(node, ast.Constant) and id(node) not in docs]
            found += [node.value for node in texts if isinstance(node.value, str) and FLAG.search(node.value)]
    return found


def test_no_message_of_the_library_leaves_a_flag_on_the_page() -> None:
    said = messages()
    assert len(said) > 20
    # whole commands, which are for a terminal, apart
    left = [put for each in said if FLAG.search(put := re.sub(r"\brds [^`;,)]*", "", in_fields(each)))]
    assert not left


@pytest.mark.parametrize(
    ("message", "put"),
    [
        ("take --method simulation, which uses times", "take “Method: simulation”, which uses times"),
        ("it is empty; give one with --tools", "it is empty; give one with “Tool table”"),
        ("switch it on (`--with program-numbers`)", "switch it on (“Program numbers”)"),
        ("hold one of them (--fix K=1.5)", "hold one of them (option fix K=1.5 of the command in a terminal)"),
        ("`rds fit LOG --structure axis -o M.toml` makes one", "`rds fit LOG --structure axis -o M.toml` makes one"),
        ("a value -- as it is", "a value -- as it is"),
    ],
)
def test_an_option_is_named_by_its_field(message: str, put: str) -> None:
    assert in_fields(message) == put


def test_what_a_panel_says_and_marks_goes_through_it() -> None:
    notice = Notice()
    notice.say("take --method simulation", "error", "or --structure axis")
    assert "--" not in notice.value and "“Method: simulation”" in notice.value and "“Structure: axis”" in notice.value
    assert Mark(1, 0, 0, "give one with --tools").to_json()["text"] == "give one with “Tool table”"
    assert set(DIALECT.values()) <= {label for label, _ in OPTIONS.values()} and "Tool table" in FIELDS.values()
