"""`rds library` and docs/library.md: every part of every registry, with the facts of its declarations."""

from __future__ import annotations

import json
from typing import Any

import pytest
from documents import ROOT
from typer.testing import CliRunner

from rds.cli.library import KINDS, as_markdown
from rds.cli.main import app


def said(*words: str) -> str:
    done = CliRunner().invoke(app, ["library", *words], env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert done.exit_code == 0, done.output
    return done.output


def test_the_document_is_what_the_program_says() -> None:
    text = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    assert text == as_markdown(), "`make tables` renews docs/library.md"


def test_an_option_has_unit_range_and_the_value_that_is_tuned() -> None:
    found: dict[str, Any] = json.loads(said("controller", "pid", "--json"))["controller"]["pid"]
    gain = found["options"]["Pgain"]
    assert (gain["unit"], gain["allowed"], gain["default"]) == ("V/mm", "≥ 0", "39.8108")
    assert found["options"]["FF1"]["default"] == "0.566893"  # 1/K
    shown = said("controller", "pid")
    assert "proportional gain" in shown and "V/mm" in shown and "≥ 0" in shown


@pytest.mark.parametrize("kind", KINDS)
def test_each_part_is_described(kind: str) -> None:
    for name in KINDS[kind].names():
        part = KINDS[kind].part(name)
        assert part.about and "\n" not in part.about, name
        assert all(option.meaning for option in part.options) or kind == "structure", name


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["controler"], "no kind of parts 'controler'; known kinds: controller.*did you mean 'controller'"),
        (["signal", "sine"], "no signal 'sine'; known: square"),
        (["signal", "--markdown"], "--markdown is of all kinds"),
    ],
)
def test_what_is_unknown_is_refused_with_what_is_known(words: list[str], expected: str) -> None:
    import re

    done = CliRunner().invoke(app, ["library", *words])
    assert done.exit_code == 2
    assert re.search(expected, done.output.replace("\n", " "))
