"""The JSON Schemas that are shipped are those of the declarations, and the files that are shipped keep them."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from documents import ROOT, blocks

from rds.cli.schema import KINDS, schema_text, shipped

MADE = "`python -m rds schema --out rds/cli/schemas` renews them"


def validator_of(schema: str) -> Any:
    from jsonschema import Draft7Validator  # here, because it takes seconds that each worker would spend as it collects

    Draft7Validator.check_schema(json.loads(schema))
    return Draft7Validator(json.loads(schema))


def files_of(kind: str) -> list[Path]:
    """The files of this kind in the repository."""
    toml = [*ROOT.glob("examples/**/*.toml"), *ROOT.glob("rds/**/*.toml")]
    texts = {path: path.read_text(encoding="utf-8") for path in toml}
    belongs = {
        "experiment": lambda path, text: "\nduration = " in f"\n{text}" and "[[case]]" not in text,
        "machine": lambda path, text: "[converter]" in text,
        "assignment": lambda path, text: path.name == "assignment.toml",
        "map": lambda path, text: path.name.endswith(".map.toml"),
        "path": lambda path, text: "[[segment]]" in text,
        "faults": lambda path, text: "[[fault]]" in text,
        "model": lambda path, text: "[parameters." in text,
    }
    return [path for path, text in texts.items() if belongs[kind](path, text)]


@pytest.mark.parametrize("kind", KINDS)
def test_the_shipped_schema_is_that_of_the_declarations(kind: str) -> None:
    assert shipped(kind).read_text(encoding="utf-8") == schema_text(kind), MADE
    validator_of(schema_text(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_shipped_files_keep_their_schema(kind: str) -> None:
    validator = validator_of(shipped(kind).read_text(encoding="utf-8"))
    found = files_of(kind)
    assert found or kind in ("map", "path", "faults", "model"), kind
    for path in found:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        assert not [f"{path}: {error.json_path} {error.message}" for error in validator.iter_errors(plain(table))]


def plain(value: Any) -> Any:
    """TOML as JSON has it: a date is a text there."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return value if isinstance(value, bool | int | float | str) else str(value)


@pytest.mark.parametrize(("kind", "file"), [("experiment", "everything.toml"), ("machine", "my_machine.toml")])
def test_the_files_of_the_document_keep_their_schema(kind: str, file: str) -> None:
    validator = validator_of(schema_text(kind))
    (block,) = [block for block in blocks("docs/experiments.md") if block.file == file]
    assert not list(validator.iter_errors(tomllib.loads(block.text)))


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        ("machine", "[converter]\nbits = 2000"),
        ("machine", "sample_period = -1.0"),
        ("machine", "[axis.X]\nnode = 300\ntravel = [0, 1]\nresolution = 1"),
        ("experiment", "duratoin = 1.0"),
        ("experiment", "duration = 1.0\n[controller]\nname = 'pid'\nPgian = 1.0"),
        ("experiment", "duration = 1.0\n[timing]\npriority = 100"),
        ("faults", "[[fault]]\nkind = 'die'"),
        ("map", "gaps = 'ignore'"),
    ],
)
def test_what_the_reader_refuses_the_schema_refuses(kind: str, wrong: str) -> None:
    assert list(validator_of(schema_text(kind)).iter_errors(tomllib.loads(wrong)))
