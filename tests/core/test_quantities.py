"""A quantity is declared once: every door refuses the same values, with the same sentence."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis.strategies import booleans, floats, integers, none, one_of, text

from rds.core.errors import InputError
from rds.core.quantities import Quantity, Table
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.toml_table import TomlTable
from rds.modes.loop.live_values import Channel
from rds.panels.session.fields import Number

QUANTITIES = {
    "between": Quantity("between two bounds", "s", 0.5, 20.0),
    "open": Quantity("more than a bound", "V/mm", above=0.0),
    "half_open": Quantity("more than a bound, up to another", "V", above=0.0, high=10.0),
    "whole": Quantity("a whole number", "", 1, 32, whole=True),
    "below": Quantity("up to a bound", "mm/s", high=0.0),
    "free": Quantity("any number", "mm"),
    "sample_period": SAMPLE_PERIOD,
}
VALUES = one_of(integers(-100, 100), floats(), booleans(), none(), integers(10**300, 10**310), text("ab", max_size=3))


def refusal(use: Any, *arguments: Any) -> str:
    """What it raises; empty where the value is accepted."""
    try:
        use(*arguments)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", QUANTITIES)
@given(value=VALUES)
def test_every_door_refuses_the_same_values_with_the_same_sentence(name: str, value: Any) -> None:
    quantity = QUANTITIES[name]
    core = quantity.fault(value)
    file = TomlTable({name: value}, Table("a table", {name: quantity}), f"{name} = 1\n", "own.toml")
    doors = {
        "file": refusal(file.read, name),
        "Python": refusal(quantity.check, value, name, "owner"),
        "live value": refusal(Channel.of(quantity, name, 1.0).check, value),
    }
    if not isinstance(value, str) and value is not None:
        doors["field"] = refusal(Number.of(quantity, name, name.title()).check, value)
    for door, said in doors.items():
        assert bool(said) is (core is not None), f"{door}: {said!r} beside {core!r}"
        assert core is None or core.partition(" (")[0] in said, f"{door}: {said!r} beside {core!r}"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("between", 0, r"must be from 0.5 to 20 s \(between two bounds\)"),
        ("between", nan, "must be a finite number in s"),
        ("between", "1", "must be a number in s, without quotes"),
        ("open", 0, "must be more than 0 V/mm"),
        ("open", inf, "must be a finite number in V/mm"),
        ("half_open", 0.0, "must be more than 0 and at most 10 V"),
        ("whole", 2.5, "must be a whole number from 1 to 32"),
        ("whole", True, "must be a whole number from 1 to 32"),
        ("below", 0.1, "must be at most 0 mm/s"),
        ("free", None, r"must be a number in mm \(any number\)"),
    ],
)
def test_the_sentence_tells_range_unit_and_meaning(name: str, value: Any, said: str) -> None:
    with pytest.raises(InputError, match=rf"owner: {name} = .* {said}"):
        QUANTITIES[name].check(value, name, "owner")


def test_a_default_that_comes_from_elsewhere_is_not_blamed_on_the_file(tmp_path: Path) -> None:
    table = TomlTable({}, Table("a table", {"sample_period": SAMPLE_PERIOD}, needed=("sample_period",)))
    assert table.read("sample_period", 0.002) == 0.002
    with pytest.raises(InputError, match=r"sample_period is missing; give it in s, as in `sample_period = 1\.0`"):
        table.read("sample_period")
    with pytest.raises(KeyError):
        table.read("sample_perod")
