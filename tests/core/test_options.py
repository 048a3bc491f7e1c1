"""Options by name, and the door to library parts."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.core.options import check_known, read_options
from rds.core.quantities import Quantity
from rds.core.registry import Registry

GAIN = Quantity("gain", "V/mm", low=0.0)


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), np.int64(2), Fraction(2)])
def test_numbers_of_any_kind_become_floats(value):
    checked = GAIN.check(value, "gain", "law")
    assert checked == 2.0
    assert type(checked) is float


@pytest.mark.parametrize("value", ["2", None, True, np.bool_(True), [2.0], 2j, float("nan"), float("inf"), -1])
def test_anything_else_is_refused_with_name_value_and_meaning(value):
    with pytest.raises(InputError) as error:
        GAIN.check(value, "gain", "law")
    assert f"law: gain = {value!r} must be" in str(error.value)
    assert "V/mm" in str(error.value) and "(gain)" in str(error.value)


def test_infinity_is_allowed_where_it_has_a_sense():
    limit = Quantity("limit", "V", above=0.0, infinite=True)
    assert limit.check(float("inf"), "limit", "law") == float("inf")
    for value in (0.0, -float("inf"), float("nan")):
        with pytest.raises(InputError):
            limit.check(value, "limit", "law")


def test_unknown_options_are_named_beside_the_known_ones():
    assert read_options({"gain": 3}, {"gain": GAIN}, "law") == {"gain": 3.0}
    with pytest.raises(InputError, match="law has no option 'gian'; it has gain"):
        read_options({"gian": 3}, {"gain": GAIN}, "law")
    with pytest.raises(InputError, match="it has none"):
        check_known(["gain"], [], "law")


def test_registry_imports_on_use_and_lists_what_it_knows():
    door = Registry("toy", {"json": "json", "broken": "no.such.module"})
    assert door.names() == ["json", "broken"]
    assert door.module("json").dumps([1]) == "[1]"
    with pytest.raises(InputError, match="no toy 'yaml'; known toys: json, broken"):
        door.module("yaml")
