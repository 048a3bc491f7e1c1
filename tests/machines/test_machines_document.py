"""docs/machines.md is true: its code runs, its script and links are read, its tables have all keys and machines."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from documents import ROOT, blocks
from machines.machine_text import machine

from rds.machines import load_machine, machine_names
from rds.machines.configuration import verdict
from rds.machines.link_table import LINK
from rds.machines.ncc import machine_of_script, read_script

TEXT = (ROOT / "docs" / "machines.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`(\w[\w-]*)`", TEXT))


@pytest.mark.parametrize("block", [b for b in blocks("docs/machines.md") if b.language == "python"])
def test_its_code_runs(block) -> None:
    names: dict = {}
    exec(block.text, names)
    np.testing.assert_allclose(names["kinematics"].inverse(names["pose"]), [10.0, 0.0, 0.0, 30.0, 45.0], atol=1e-6)


def test_its_links_are_read(tmp_path: Path) -> None:
    table, arm = (block.text for block in blocks("docs/machines.md") if block.language == "toml")
    kinematics = machine(tmp_path, "XZ", table).kinematics
    np.testing.assert_allclose(kinematics.forward({"X": 5.0, "Z": 7.0})[:3, 3], [5.0, 0.0, 7.0 - 50.0])
    pose, angle = machine(tmp_path, "A", arm).kinematics.forward({"A": 10.0}), np.radians(30.0)
    np.testing.assert_allclose(pose[:3, 3], [150.0 * np.cos(angle), 150.0 * np.sin(angle), 40.0])


def test_its_script_is_the_paper_s_as_printed() -> None:
    script, _ = (block.text for block in blocks("docs/machines.md") if block.language == "ncc")
    for printed, text in ((0, script), (1, script.replace("YA90", "YA-90"))):
        matrix = machine_of_script(read_script(text)).kinematics.forward({"C": 0.0})
        matrix[2, 3] += 140.0 + 370.0  # of LN1 alone
        rows = [cells[printed + 1] for cells in re.findall(r"\| (\w+) row \| ([^|]*) \| ([^|]*) \|", TEXT)]
        assert [[float(n) for n in row.split()] for row in rows] == (matrix[:3].round(9) + 0.0).tolist()


def test_its_job_changes_the_mill() -> None:
    _, job = (block.text for block in blocks("docs/machines.md") if block.language == "ncc")
    changed = machine_of_script(read_script(job), "job", load_machine("mrm-mill")).kinematics
    assert changed.limits.tolist() == [[-50.0, 50.0], [-100.0, 100.0], [-100.0, 100.0]]
    moved = changed.forward({})[:3, 3] - load_machine("mrm-mill").kinematics.forward({})[:3, 3]
    np.testing.assert_allclose(moved, [0.02, 0.0, -0.15], atol=1e-12)


def test_keys_checks_and_machines_are_named() -> None:
    assert set(LINK.keys) <= NAMED
    assert set(machine_names()) <= NAMED
    checks = {check.name for check in verdict(load_machine("mrmt-oacs")).checks}
    assert checks == set(re.findall(r"(?m)^\| (\w+) \|", TEXT.split("## The verdict")[1].split("\n## ")[0])) - {"check"}
