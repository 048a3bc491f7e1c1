"""A few machines of the factory of truths, of which `python -m benchmarks.verdicts` judges hundreds."""

from __future__ import annotations

import pytest

from benchmarks.truths import machine
from benchmarks.verdicts import Row, rates, rows, table

KINDS = ("truth", "tau off by 30 %", "K 5 % off", "a hidden delay", "K 5 % off, a file of one's own")


@pytest.mark.parametrize("number", [8, 15])  # an open loop with noise, and a closed one
def test_right_models_are_valid_and_wrong_ones_are_not(number: int) -> None:
    found = rows(number, KINDS)
    assert [row.kind for row in found if row.right] == ["truth"] and len(found) == len(KINDS)
    assert [(row.kind, row.says) for row in found if row.error] == []
    right, wrong = rates(found)
    assert right.met and wrong.met and wrong.note == "0 of 4; below 52.71 % with 95 % confidence"


def test_the_rates_count_what_is_called_otherwise_than_it_is() -> None:
    made = [
        Row(1, "truth", right=True, suffices=True, says="cannot tell", error=True),
        Row(1, "truth", right=True, suffices=False, says="cannot tell", error=True),  # noise hides it: no error
        Row(1, "K 5 % off", right=False, suffices=True, says="valid", error=True),
        Row(2, "K 5 % off", right=False, suffices=True, says="not valid", error=False),
    ]
    right, wrong = rates(made)
    assert right.note.startswith("1 of 1") and wrong.note.startswith("1 of 2") and not wrong.met
    assert ("truth, log too weak", 1, "1 cannot tell") in table(made)


def test_a_machine_is_the_same_in_every_run() -> None:
    assert machine(8) == machine(8) != machine(9) and not machine(8).closed_loop and machine(15).closed_loop
