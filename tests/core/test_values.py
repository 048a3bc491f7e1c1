"""Values of a student's making that fail at being shown or copied."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from rds.core.errors import ContractError
from rds.core.load import load_student
from rds.core.values import own_copy, shown

UNSEEN = """
class Unseen:
    def __repr__(self):
        raise RuntimeError("nobody sees me")
def control(t, r, y, state, params):
    return 0.0, state
"""


def test_what_cannot_be_shown_is_named_by_its_class() -> None:
    class Unseen:
        def __repr__(self) -> str:
            raise RuntimeError

    assert shown(Unseen()) == "a Unseen"
    assert shown([1.0] * 100, 20) == "[1.0, 1.0, 1.0, 1.0…"


def test_what_holds_itself_or_a_part_many_times_is_shown_in_no_time() -> None:
    doubled: Any = (1.0, 2.0)
    for _ in range(60):
        doubled = (doubled, doubled)
    assert shown(doubled) == "a tuple that holds more than 100000 others"
    assert shown([(1, 2)] * 5000, 15) == "[(1, 2), (1, 2…"


def test_what_cannot_be_copied_is_said_with_its_place() -> None:
    with pytest.raises(ContractError, match=r"law.py: params cannot be copied .*lock.*; keep numbers, lists"):
        own_copy({"key": threading.Lock()}, "params", "law.py")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("params = Unseen()", "params is a Unseen .*it must be a dict"),
        ("import threading; params = {'key': threading.Lock()}", "law.py: params cannot be copied"),
        ("import threading; initial_state = [threading.Lock()]", "law.py: initial_state cannot be copied"),
    ],
)
def test_a_file_with_such_values_is_refused_with_a_sentence(line: str, said: str, tmp_path: Any) -> None:
    law = tmp_path / "law.py"
    law.write_text(UNSEEN + line + "\n")
    with pytest.raises(ContractError, match=said):
        load_student(law).controller()
