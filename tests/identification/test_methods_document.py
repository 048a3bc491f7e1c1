"""docs/identification-methods.md: its Python runs, its settings are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rds.identification.fit.inverse_dynamics import OPTIONS
from rds.identification.logs.map import LogMap
from rds.identification.structures.motion_form import _FORMS

TEXT = (Path(__file__).parents[2] / "docs" / "identification-methods.md").read_text(encoding="utf-8")


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python run\n(.*?)```", TEXT, re.S)
    assert len(code) == 1
    names: dict[str, object] = {}
    exec(compile(code[0], "identification-methods.md", "exec"), names)
    assert names["estimate"].values()["K"] == pytest.approx(1.764, rel=0.002)  # type: ignore[attr-defined]
    assert (tmp_path / "bode.png").is_file()


def test_every_setting_and_structure_is_named() -> None:
    for name in OPTIONS:
        assert f"| `{name}` |" in TEXT
    for name, options in _FORMS:
        assert f"`{name}`" in TEXT
        assert all(f"`{option}`" in TEXT for option in options)


def test_the_map_of_the_emps_is_read(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "data.md").read_text(encoding="utf-8")
    path = tmp_path / "DATA_EMPS.mat.map.toml"
    path.write_text(re.findall(r"```toml file=DATA_EMPS.mat.map.toml\n(.*?)```", text, re.S)[0])
    assert "EMPS" in LogMap.read(path).axes
