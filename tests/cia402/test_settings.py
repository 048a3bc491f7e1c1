"""The [bus.cia402] table: what it says, and what it refuses."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from rds.bus.modules.cia402.codes import Mode
from rds.bus.modules.cia402.remote import Remote
from rds.bus.modules.cia402.settings import read_settings
from rds.core.errors import InputError
from rds.machines import Machine


def test_without_a_word_the_machines_own_numbers_hold(machine: Machine) -> None:
    settings = read_settings({}, machine, ["X", "spindle"])
    x, spindle = settings.drives
    assert (x.node, x.counts, x.velocity_counts, x.rated_voltage, x.direction) == (2, 1000.0, 1000.0, 10.0, 1)
    assert spindle.reads_velocity and spindle.velocity_counts == pytest.approx(4096 / 60)
    assert x.command.mode is Mode.CYCLIC_TORQUE and settings.host == 127


def test_counts_from_encoder_gear_and_feed(machine: Machine) -> None:
    table = {"axis": {"X": {"encoder": 8192, "gear": 2.5, "feed": 5.0}}}
    assert read_settings(table, machine, ["X"]).drives[0].counts == pytest.approx(4096.0)


def test_an_eds_is_found_beside_the_machine_file_or_here(machine: Machine, tmp_path: Path) -> None:
    eds = tmp_path / "drive.eds"
    eds.write_text("")
    assert read_settings({"axis": {"X": {"eds": str(eds)}}}, machine, ["X"]).drives[0].eds == str(eds)


def test_the_documented_example_is_accepted(machine: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (Path(__file__).parents[2] / "docs" / "cia402.md").read_text(encoding="utf-8")
    table = tomllib.loads(text.split("### A bought drive on SocketCAN")[1].split("```toml\n")[1].split("```")[0])[
        "bus"
    ]["cia402"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "servo-drive.eds").write_text("")
    settings = read_settings(table, machine, ["X", "Y"])
    x, y = settings.drives
    assert (x.node, x.counts, x.homing, len(x.write)) == (11, 2000.0, 17, 6)
    assert (y.node, y.counts, y.direction) == (12, 2000.0, -1)
    for key in {*table, *table["axis"]["X"], *table["axis"]["Y"]} - {"axis"}:
        assert f"`{key}`" in text, f"{key} is not explained"


@pytest.mark.parametrize(
    "table, says",
    [
        ({"modus": "cst"}, "no option 'modus'"),
        ({"mode": "torque"}, "'cst', 'csp', 'csv'"),
        ({"positions": "zero"}, '"start" or "drive"'),
        ({"host": 2}, "must all differ"),
        ({"host": 200}, "from 1 to 127"),
        ({"rpdo_transmission": 252}, "254 and 255"),
        ({"heartbeat": 0}, "from 0.001 to 20 s"),
        ({"heartbeat": 22.0}, "from 0.001 to 20 s"),
        ({"axis": {"Q": {}}}, "no axis 'Q'"),
        ({"axis": {"X": {"knots": 1}}}, "no option 'knots'"),
        ({"axis": {"X": {"node": 3}}}, "must all differ"),
        ({"axis": {"X": {"counts": -5}}}, "more than 0"),
        ({"axis": {"X": {"counts": 5, "gear": 2}}}, "either counts"),
        ({"axis": {"X": {"direction": 0}}}, "1, -1"),
        ({"axis": {"X": {"homing": 5}}}, "17"),
        (5, "must be a table"),
        ({"axis": 5}, "must be tables"),
        ({"axis": {"X": 5}}, "must be a table"),
        ({"mode": ["csp"]}, "'cst', 'csp', 'csv'"),
        ({"axis": {"X": {"write": 5}}}, "[index, sub-index, value]"),
        ({"axis": {"X": {"write": [5]}}}, "[index, sub-index, value]"),
        ({"axis": {"X": {"mode": "pv"}}}, "'cst', 'csp', 'csv'"),
        ({"axis": {"X": {"home": 1.0}}}, "give its method as well"),
        ({"axis": {"X": {"homing": 17, "home": 1e9}}}, "beyond what a drive can count"),
        ({"axis": {"X": {"homing": 17, "home": "left"}}}, "must be a number"),
        ({"axis": {"X": {"eds": "nowhere.eds"}}}, "no such file"),
        ({"axis": {"X": {"write": [[0x6072, 0]]}}}, "[index, sub-index, value]"),
    ],
)
def test_what_cannot_be_is_refused_in_words(machine: Machine, table: Any, says: str) -> None:
    with pytest.raises(InputError, match=r"\[bus\.cia402|mini-cnc") as refused:
        read_settings(table, machine, ["X", "Y"])
    assert says in str(refused.value)


@pytest.mark.parametrize(
    "table, value, torque, volts",
    [
        ({"torque_limit": 200}, 10.0, 200, 2.0),
        ({"torque_limit": 200}, -3.0, -200, -2.0),
        ({"torque_limit": 200}, 1.0, 100, 1.0),
        ({"rated_voltage": 5.0, "direction": -1}, 10.0, -1000, 5.0),
        ({"rated_voltage": 5.0, "torque_limit": 2000}, 10.0, 2000, 10.0),
        ({"rated_voltage": 48.0}, 40.0, 833, 39.984),
    ],
)
def test_a_law_may_saturate_at_the_converters_range(
    machine: Machine, table: dict[str, Any], value: float, torque: int, volts: float
) -> None:
    """A controller's 10 V, where the drive may have 2, ended the run: now 2 V are sent, and recorded."""
    remote = Remote(read_settings({"axis": {"X": table}}, machine, ["X"]).drives[0])
    assert remote.aim(value) == pytest.approx(volts) and remote.target == torque
    with pytest.raises(InputError, match="must be from"):
        remote.aim(50.0)
