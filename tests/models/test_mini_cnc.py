"""The virtual mini CNC behind the bus against the paper's measured table 3."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

from rds import load_machine

SCRIPT = Path(__file__).resolve().parents[2] / "examples" / "paper" / "identify_mini_cnc.py"


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location("identify_mini_cnc", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_it_measures_what_the_paper_measured(script: Any, axis: str) -> None:
    """Mean and deviation of |e| within 3 %; the model that students know is table 1's, and measures something else."""
    own = load_machine("mini-cnc").axis(axis)
    assert script.measured(axis, own.machine) == pytest.approx(script.TABLE_3[axis], rel=0.03)
    of_table_1 = {key: value for key, value in own.model.items() if key != "name"} | {"delay": 0.0}
    assert script.measured(axis, of_table_1) != pytest.approx(script.TABLE_3[axis], rel=0.10)
