"""docs/validation.md is true: its code runs, and every band, option and key of the JSON is in it."""

from __future__ import annotations

import re
from dataclasses import fields

from documents import ROOT, blocks
from typer.testing import CliRunner

from rds.cli.main import app
from rds.identification.validate.validate import validate
from rds.identification.validate.verdict import Bands
from tests.validation.validation_logs import candidate, log, square

DOCUMENT = "docs/validation.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
NAMED = set(re.findall(r"`([\w-]+)", TEXT))


def test_the_code_runs() -> None:
    (code,) = [block.text for block in blocks(DOCUMENT) if block.language == "python"]
    exec(compile(code, DOCUMENT, "exec"), {})


def test_every_band_is_there_with_its_default() -> None:
    for field in fields(Bands):
        row = re.search(rf"^\| `{field.name}` \| ([\d.]+)", TEXT, re.MULTILINE)
        assert row and float(row[1]) == field.default, field.name


def test_every_key_of_the_json_is_there() -> None:
    found = validate(candidate(), log(square(4.0)), against=[candidate(name="other")]).to_json()
    ranking = found["comparison"]["log"]
    keys = {*found, *found["reasons"][0], *found["model"], *ranking, *found["logs"]["log"]}
    known = NAMED | {"source", "sha256", "samples", "sample_period"}  # of a log, said by their names
    assert keys <= known, keys - known


def test_every_option_is_there() -> None:
    told = CliRunner().invoke(app, ["validate", "--help"], env={"COLUMNS": "200", "TERM": "dumb"}).output
    options = set(re.findall(r"--[a-z][a-z-]+", told)) - {"--help"}
    assert len(options) >= 7 and all(f"`{option}" in TEXT for option in options), options
