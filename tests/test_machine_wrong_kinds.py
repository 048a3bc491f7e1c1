"""A machine's file in which a value is of the wrong kind is refused in a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.machines import load_machine

FILE = """
sample_period = 0.001
{top}
[axis.X]
node = {node}
travel = {travel}
resolution = 0.01
{more}
"""


@pytest.mark.parametrize(
    "changed, said",
    [
        ({"travel": "5"}, r"travel = 5 must be \[lowest, highest\]"),
        ({"travel": '["a", "b"]'}, r"must be \[lowest, highest\]"),
        ({"travel": "[0.0, inf]"}, r"must be \[lowest, highest\]"),
        ({"node": "nan"}, "node = nan must be a whole number"),
        ({"node": "2.7"}, "node = 2.7 must be a whole number"),
        ({"more": "model = 5"}, r"axis.X.model = 5 must be a table; write \[axis.X.model\]"),
        ({"top": "converter = 5"}, r"converter = 5 must be a table; write \[converter\]"),
        ({"top": "axis.Y = 5"}, r"axis.Y = 5 must be a table; write \[axis.Y\]"),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused(changed: dict[str, str], said: str, tmp_path: Path) -> None:
    values = {"top": "", "node": "1", "travel": "[0.0, 9.0]", "more": ""}
    file = tmp_path / "own.toml"
    file.write_text(FILE.format(**values))
    assert load_machine(str(file)).axes["X"].node == 1
    file.write_text(FILE.format(**values | changed))
    with pytest.raises(InputError, match=said):
        load_machine(str(file))
