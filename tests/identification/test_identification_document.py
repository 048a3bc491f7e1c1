"""docs/identification.md: its example is run, its numbers are found, its options are those of the code."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.identification.structures.axis_structure import OPTIONS

TEXT = (Path(__file__).parents[2] / "docs" / "identification.md").read_text(encoding="utf-8")


def test_the_example_finds_the_numbers_of_its_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (experiment,) = re.findall(r"```toml file=excite.toml\n(.*?)```", TEXT, re.S)
    Path("excite.toml").write_text(experiment)
    commands = re.findall(r"^\$ rds (.*)$", TEXT, re.M)[:2]
    for command in commands:
        done = CliRunner().invoke(app, command.split() + (["--json"] if command.startswith("fit") else []))
        assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert not any("closed-loop" in warning for warning in found["warnings"])
    rows = re.findall(r"^\| (\w+) \| (-?[\d.]+) \| ([\d.e-]+) \| (-?[\d.]+) to (-?[\d.]+) \| (-?[\d.]+) \|", TEXT, re.M)
    assert [row[0] for row in rows] == list(found["parameters"])
    for name, value, error, low, high, simulated in rows:
        parameter = found["parameters"][name]
        assert parameter["value"] == pytest.approx(float(value), abs=0.2 * float(error))
        assert parameter["std_error"] == pytest.approx(float(error), rel=0.2)
        assert float(low) <= float(simulated) <= float(high)
    (python,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    names: dict[str, object] = {}
    exec(compile(python, "identification.md", "exec"), names)
    assert names["estimate"].values()["tau"] == 0.01  # type: ignore[attr-defined]


def test_every_option_is_named() -> None:
    for option in OPTIONS:
        assert f"| `{option}` |" in TEXT
