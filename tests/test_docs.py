"""docs/experiments.md names every key that the code accepts, and its files work."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from math import isfinite
from pathlib import Path
from typing import Any

import pytest
from documents import ROOT, Block, blocks, save

import rds
from rds.bus.modules.rds import frames
from rds.checks import check_file
from rds.controllers import controller_module, controller_names
from rds.core.quantities import Quantity, Table
from rds.core.toml_table import TomlTable
from rds.core.types import Ending, Verdict
from rds.machines import load_machine
from rds.machines.machine import AXIS, MACHINE
from rds.models import model_module, model_names
from rds.models.machine_axis import PARAMETERS, MachineParameters
from rds.modes import mode_names
from rds.modes.experiment.experiment_file import BUS, EXPERIMENT, TIMING
from rds.modes.experiment.resolve import resolve
from rds.network.network_file import NETWORK
from rds.references import make_signal, signal_kinds
from rds.references import user as user_signal
from rds.results.metrics import ERROR_METRICS

DOCUMENT = "docs/experiments.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
BLOCKS = blocks(DOCUMENT)
NAMED = set(re.findall(r"`\"?([\w.-]+)\"?`", TEXT))  # every word between backticks, in quotes or not
NAMED |= set(re.findall(r"`(?:name|kind|late) = \"([\w-]+)\"`", TEXT))

TABLE: dict[str, Any] = {
    "axes": ["X"],
    "duration": 0.1,
    "reference": {"kind": "constant", "value": 0.0},
    "controller": {"name": "p"},
}

DECLARED = [
    ("", EXPERIMENT),
    ("", TIMING),
    ("", BUS),
    ("", NETWORK),
    ("converter.", MACHINE.keys["converter"]),
    ("axis.NAME.", AXIS),
    ("", Table("the axis behind the bus", PARAMETERS)),
]
UNBOUNDED = ("stop_after", "late_limit", "restart_ms", "data_bitrate")  # whose bounds nobody meets


def known_keys(**table: Any) -> list[str]:
    """The keys that the code knows where it was given the unknown key "no_such_key"."""
    with pytest.raises(rds.InputError) as refusal:
        resolve(TomlTable(TABLE | table, EXPERIMENT), Path())
    listed = re.search(r"known keys: ([\w, ]+)", str(refusal.value))
    assert listed, str(refusal.value)
    return listed[1].split(", ")


@pytest.mark.parametrize(
    "table",
    [
        {"no_such_key": 1},
        {"interface": {"no_such_key": 1}},
        {"timing": {"no_such_key": 1}},
        {"axis": {"X": {"no_such_key": 1}}},
        {"controller": {"file": str(ROOT / "examples" / "my_controller.py"), "no_such_key": 1}},
        {"model": {"file": str(ROOT / "examples" / "my_model.py"), "no_such_key": 1}},
    ],
    ids=("top", "interface", "timing", "axis", "controller", "model"),
)
def test_keys_of_an_experiment(table: dict[str, Any]) -> None:
    keys = [key for key in known_keys(**table) if key not in ("controller", "model", "reference", "signal")]
    headed = {"interface", "timing", "bus", "error_compensation", "following_error"}
    assert set(keys) - headed - {"axis", "network"} <= NAMED
    for key in set(keys) & headed:
        assert f"### `[{key}]`" in TEXT


@pytest.mark.parametrize("name", controller_names())
def test_options_of_controllers(name: str) -> None:
    assert f'name = "{name}"' in TEXT
    assert {*controller_module(name).OPTIONS} <= NAMED


@pytest.mark.parametrize("name", model_names())
def test_parameters_of_models(name: str) -> None:
    assert f'name = "{name}"' in TEXT
    assert {*model_module(name).PARAMETERS} <= NAMED


@pytest.mark.parametrize("kind", signal_kinds())
def test_signals(kind: str) -> None:
    assert kind in NAMED
    with pytest.raises(rds.InputError) as refusal:
        make_signal(kind, no_such_key=1)
    assert set(str(refusal.value).partition("; it has ")[2].split(", ")) <= NAMED


def test_options_of_a_user_signal_are_all_here() -> None:
    assert set(inspect.signature(user_signal).parameters) <= NAMED


def test_modes_endings_verdicts_and_metrics() -> None:
    words = {*mode_names(), *map(str, Verdict), *ERROR_METRICS, "fit_percent"}
    assert words <= NAMED
    assert all(f"| `{ending}` |" in TEXT for ending in Ending)


def test_columns() -> None:
    table = TomlTable(TABLE | {"mode": "implementation"}, EXPERIMENT)
    plan, _ = resolve(table, Path())
    columns, _ = plan.columns("modelled")
    assert set(columns) - {"sample"} | {"time", "X_simulated", "lateness", "io", "compute", "model", "taken"} <= NAMED


def test_machine_files() -> None:
    assert {field.name for field in fields(MachineParameters)} <= NAMED
    from rds.machines.machine import AXIS, LIMITS, MACHINE
    from rds.machines.module_table import MODULE

    assert {*MODULE.keys, *LIMITS.keys} <= NAMED
    tables = {"converter", "axis"}
    assert set(MACHINE.keys) - tables <= NAMED
    assert {f"axis.NAME.{key}" for key in AXIS.keys} | {"converter.range", "converter.bits"} <= NAMED


def rows_of_tables() -> dict[str, str]:
    """The rows of all tables of keys, by their keys; digits in groups are joined."""
    rows = re.findall(r"^\| `([\w.]+)` \|(.*)$", TEXT, re.MULTILINE)
    return {key: re.sub(r"(?<=\d) (?=\d{3})", "", row) for key, row in rows}


@pytest.mark.parametrize("prefix, table", DECLARED, ids=[table.meaning[:20] for _, table in DECLARED])
def test_ranges_and_defaults_of_the_tables_are_those_of_the_declarations(prefix: str, table: Table) -> None:
    rows = rows_of_tables()
    for key, declared in table.keys.items():
        row = rows.get(f"{prefix}{key}")
        if row is None or not isinstance(declared, Quantity):
            continue
        numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", row)]
        for bound in (declared.low, declared.high, declared.above, declared.default):
            if bound is not None and isfinite(bound) and bound < 1e9 and f"{prefix}{key}" not in UNBOUNDED:
                assert bound in numbers, f"{prefix}{key}: {bound:g} is not in |{row}"


def test_the_bus_protocol() -> None:
    for identifier in (
        frames.MORE_VOLTAGES,
        frames.COMMAND,
        frames.DRY_COMMAND,
        frames.SETUP,
        frames.CALL,
        frames.ANSWER,
    ):
        assert re.search(rf"^\| 0x{identifier:03X} ", TEXT, re.MULTILINE)
    for bit in frames.Status:
        name = (bit.name or "").lower().replace("_", " ")
        assert f"| {bit.value} | {name} |" in TEXT
    assert "20/16384 V" in TEXT and frames.VOLTS_PER_UNIT == 20 / 16384


@pytest.mark.parametrize("block", [b for b in BLOCKS if (b.file or "").endswith(".py")], ids=lambda b: b.file)
def test_its_functions_keep_their_interfaces(block: Block, tmp_path: Path) -> None:
    (file,) = save([block], tmp_path)
    report = check_file(file, 0.001)
    assert report.ok, str(report)


def test_its_experiment_runs(tmp_path: Path) -> None:
    save(BLOCKS, tmp_path)
    result = rds.Experiment.from_toml(tmp_path / "everything.toml").run()
    assert result.axes == ["X", "Y"]


def test_its_machine_runs_its_files(tmp_path: Path) -> None:
    save(BLOCKS, tmp_path)
    machine = load_machine(str(tmp_path / "my_machine.toml"))
    assert list(machine.axes) == ["X"]
    for model in ("model_example.py", "advance_example.py"):
        result = rds.Experiment(
            str(tmp_path / "my_machine.toml"),
            duration=0.5,
            reference=lambda t: 0.5 * t,
            controller=str(tmp_path / "controller_example.py"),
            model=str(tmp_path / model),
        ).run()
        assert abs(result["X_measured"][-1] - 0.25) < 0.02  # mm


def test_one_sample_of_transport(alone: Path) -> None:
    """With a live machine the voltage of a row is the limited command of the row before."""
    experiment = rds.Experiment(duration=0.3, reference=rds.sinusoid(1.0, 2.0), controller="p")
    result = experiment.run("implementation", out=alone / "out")
    follows = result["time"][1:] - result["time"][:-1] < 0.0015  # no period discarded between
    command, voltage = result["X_command"][:-1][follows], result["X_voltage"][1:][follows]
    assert result["X_voltage"][0] == 0.0
    step = 20.0 / 4096
    assert abs(voltage - command.clip(-10.0, 10.0 - step)).max() <= step / 2 + 1e-9
