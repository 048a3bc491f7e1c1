"""docs/robustness.md is true: its files and commands work, its code runs, and every option and key is in it."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import fields
from pathlib import Path

import pytest
from documents import ROOT, blocks, save
from typer.testing import CliRunner

from rds.cli.main import app
from rds.identification.fit.model_file import ModelFile, read_model
from rds.identification.robustness.figures import FIGURES

DOCUMENT = "docs/robustness.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
BLOCKS = blocks(DOCUMENT)
NAMED = set(re.findall(r"`([\w.-]+)", TEXT))


def test_files_commands_and_code_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save(BLOCKS, tmp_path)
    commands = 0
    for block in BLOCKS:
        if block.language == "console":
            for line in block.text.splitlines():
                words = shlex.split(line.removeprefix("$ rds "))
                words = ["100" if word == "1000" else word for word in words]  # runs
                done = CliRunner().invoke(app, words)
                assert done.exit_code == 0, done.output
                commands += 1
        elif block.language == "python":
            assert block.words == "run"
            exec(compile(block.text, DOCUMENT, "exec"), {})
    assert commands == 4
    assert {path.name for path in tmp_path.iterdir()} >= {"my_cnc.toml", "my_controller.py", "robustness"}


def test_the_keys_of_a_model_file_are_there(tmp_path: Path) -> None:
    save(BLOCKS, tmp_path)
    assert read_model(tmp_path / "fitted.toml").unidentifiable == ()
    of_file = {"path", "sha256", "text", "covariance", "parameters"}  # what is not a key, or has an entry of its own
    assert {field.name for field in fields(ModelFile)} - of_file <= NAMED
    assert {"parameters.NAME", "covariance", "free_run", "ahead", "initial_state", "command", "velocity"} <= NAMED


def test_every_option_and_key_of_the_json_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = CliRunner().invoke(app, ["robustness", "--help"], env={"COLUMNS": "200", "TERM": "dumb"}).output
    options = set(re.findall(r"--[a-z][a-z-]+", told)) - {"--help", "--install-completion", "--show-completion"}
    assert len(options) >= 9 and all(f"`{option}" in TEXT for option in options), options
    monkeypatch.chdir(tmp_path)
    save(BLOCKS, tmp_path)
    said = json.loads(CliRunner().invoke(app, ["robustness", "tracking.toml", "--runs", "3", "--json"]).stdout)
    axis = said["axes"]["X"]
    keys = {*said, *axis, *axis["figures"]["max_error"], *axis["parameters"]["K"]} - {"files"}
    assert keys <= NAMED, keys - NAMED
    assert set(axis["figures"]) == set(FIGURES)
