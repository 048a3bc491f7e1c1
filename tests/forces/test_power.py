"""The power budget of the modules: section 10.1.3 and tables Q39 to Q43 of oacs-thesis."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.power import power_budget


def test_the_thesis_supply_bears_its_modules_and_two_more():
    budget = power_budget(load_machine("mrmt-oacs"))
    axes = sum(module.peak for module in budget.modules if module.name != "drill")
    assert axes == pytest.approx(15.21)  # tables Q39 to Q41; section 10.1.3 has 15.3
    assert budget.peak == pytest.approx(15.3 + 4.0, abs=0.2)  # with the drill of table Q43
    assert (budget.voltage, budget.current) == (12.0, 29.0)
    assert budget.ok and budget.further == 2  # as the thesis says
    assert budget.verdict() == (
        "ok: the modules draw at most 19.11 A of the supply's 29 A at 12 V; it bears 2 more of their kind"
    )


def test_a_supply_that_is_too_small_is_said():
    machine = load_machine("mrmt-oacs")
    small = power_budget(replace(machine, power=replace(machine.power, current=15.0)))
    assert not small.ok and small.further == 0
    assert small.verdict().startswith("overloaded: the modules draw at most 19.11 A of the supply's 15 A")


def test_a_machine_without_a_supply_is_refused():
    with pytest.raises(InputError, match=r"says no supply; add \[power\]"):
        power_budget(load_machine("mini-cnc"))
    machine = load_machine("mini-cnc")
    with pytest.raises(InputError, match="none of its modules says a current"):
        power_budget(replace(machine, power=load_machine("mrmt-oacs").power))


def test_the_supply_is_read_strictly(tmp_path):
    text = Path(load_machine("mini-cnc").path).read_text() + "\n[power]\nvoltage = 12.0\n"
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(InputError, match="current is missing"):
        load_machine(str(tmp_path / "mine.toml"))


def test_the_command():
    told = CliRunner().invoke(app, ["machine", "power", "mrmt-oacs", "--json"])
    assert told.exit_code == 0 and json.loads(told.stdout)["further_modules"] == 2
    assert "ok: the modules draw at most 19.11 A" in CliRunner().invoke(app, ["machine", "power"]).stdout
