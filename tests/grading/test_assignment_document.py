"""docs/assignments.md: its example is sound, and it names every key and every criterion."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.assignment_file import SELF_CHECKS
from rds.grading.assignment.late_rules import LateRules
from rds.grading.criteria import KINDS
from rds.grading.sandbox import Pool
from rds.grading.sandbox.limits import Limits
from tests.documents import ROOT, blocks, save
from tests.grading.made import HEAD, RMS, SINE, assignment_in

DOCUMENT = "docs/assignments.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
NAMED = set(re.findall(r"`\"?([\w.-]+)\"?`", TEXT)) | set(
    re.findall(r"\[{1,2}(?:case\.|criterion\.)?([\w]+)\]{1,2}", TEXT)
)
# what an experiment's keys are is told in docs/experiments.md
OF_EXPERIMENTS = {
    "mode",
    "controller",
    "bus",
    "network",
    "timing",
    "compiled",
    "signal",
    "model",
    "interface",
    "saturation",
    "error_compensation",
    "following_error",
}


def known_keys(text: str, folder: Path) -> set[str]:
    with pytest.raises(InputError) as refusal:
        read_assignment(assignment_in(folder, text))
    listed = re.search(r"known keys: ([\w, ]+)", str(refusal.value))
    assert listed, str(refusal.value)
    return set(listed[1].split(", "))


@pytest.mark.parametrize(
    "text",
    [
        "no_such_key = 1\n" + HEAD + SINE + RMS,
        HEAD + SINE.replace("duration", "no_such_key = 1\nduration") + RMS,
        HEAD + SINE + RMS + "no_such_key = 1\n",
        HEAD + SINE + RMS + "[late]\nno_such_key = 1\n",
        HEAD + SINE + RMS + "[limits]\nno_such_key = 1\n",
        HEAD + SINE + RMS + "[hidden]\nno_such_key = 1\n",
        HEAD.replace('"controller"', '"interpolator"')
        + '[[case]]\nname = "sine"\n[case.segment]\nkind = "arc"\nstart = [1.0, 0.0]\nend = [0.0, 1.0]\n'
        + "centre = [0.0, 0.0]\nfeed_rate = 1.0\nno_such_key = 1\n"
        + RMS,
    ],
)
def test_every_key_is_named(text: str, tmp_path: Path) -> None:
    assert known_keys(text, tmp_path) - OF_EXPERIMENTS <= NAMED


def test_every_criterion_option_and_limit_is_named() -> None:
    for name in KINDS.names():
        assert name in NAMED
        assert set(getattr(KINDS.module(name), "OPTIONS", {})) <= NAMED
    assert {field.name for kind in (Limits, LateRules) for field in fields(kind)} <= NAMED
    assert set(SELF_CHECKS) <= NAMED


def test_units_are_those_of_the_criteria() -> None:
    for line in TEXT.splitlines():
        found = re.match(r"\| (`[a-z`, -]+`) \| ([^|]+) \|", line)
        for name in re.findall(r"`([a-z-]+)`", found[1]) if found else ():
            if name in KINDS.names() and found is not None:
                unit = KINDS.module(name).UNIT or ("mm" if name == "contour-error" else "of the axis")
                assert found[2].split(" of the step")[0] == unit, name


def test_the_example_is_sound(tmp_path: Path, pool: Pool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save(blocks(DOCUMENT), tmp_path)
    (commands,) = (block.text for block in blocks(DOCUMENT) if block.language == "console")
    for command in commands.splitlines():
        words = command.removeprefix("$ rds ").split()
        ran = CliRunner().invoke(app, [*words, *(["--seeds", "3"] if "check" in words else [])])
        assert ran.exit_code == 0, f"{command}\n{ran.output}"
