"""Traces that a CODESYS controller saved: one variable after the other, stamps in ms or µs, nothing invented."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table

MAP = """
[time]
column = "time"
unit = "ms"
[axis.X]
command = { column = "PLC_PRG.fSetVoltage", unit = "V" }
position = { column = "PLC_PRG.fActPos", unit = "mm" }
"""


def trace(flags: int | None, *variables: tuple[str, Sequence[tuple[int, object]]]) -> str:
    """The file as the controller's trace editor saves it."""
    lines = ["[key]; [value]", "Version; 0x03050000", "IecTaskName; MainTask", "EveryNCycles; 1"]
    lines += [] if flags is None else [f"Flags; {flags}"]
    for number, (name, samples) in enumerate(variables):
        lines += [f"{number}.Variable; {name}", f"{number}.Class; 14", f"{number}.GraphColor; 42", f"{number}.Data; "]
        lines += [f"; {stamp}; {value}" for stamp, value in samples]
    return "\n".join(lines) + "\n"


def saved(folder: Path, text: str) -> Path:
    path = folder / "axis.trace.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_variables_of_one_task_share_a_time_and_become_a_log(tmp_path: Path) -> None:
    voltage = [(2 + 4 * k, float(k % 50 < 25)) for k in range(200)]
    position = [(2 + 4 * k, 0.125 * k) for k in range(200)]
    path = saved(tmp_path, trace(16, ("PLC_PRG.fSetVoltage", voltage), ("PLC_PRG.fActPos", position)))
    table = read_table(path)
    assert table.format == "codesys" and next(iter(table.columns)) == "time"
    assert table.columns["time"].unit == "ms" and table.columns["time"].values[-1] == 2 + 4 * 199
    path.with_name(path.name + ".map.toml").write_text(MAP, encoding="utf-8")
    (log,) = read_log(path)
    assert np.allclose(np.diff(log.time), 0.004) and len(log) == 200
    assert np.array_equal(log.position, 0.125 * np.arange(200))


def test_variables_of_two_tasks_keep_their_times_in_seconds(tmp_path: Path) -> None:
    fast, slow = [(291 + 1000 * k, k) for k in range(8)], [(500 + 4000 * k, "TRUE") for k in range(2)]
    table = read_table(saved(tmp_path, trace(36, ("A.fPos", fast), ("A.bOn", slow))))  # with a condition: the bit 4
    position, on = table.columns["A.fPos"], table.columns["A.bOn"]
    assert position.time is not None and np.allclose(position.time, 1e-6 * (291 + 1000 * np.arange(8)))
    assert on.time is not None and np.allclose(on.time, [0.0005, 0.0045]) and on.values.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("flags", [None, 0, 48])
def test_a_unit_that_the_file_does_not_give_is_not_made_up(flags: int | None, tmp_path: Path) -> None:
    same = [(k, k) for k in range(5)]
    table = read_table(saved(tmp_path, trace(flags, ("A.fPos", same), ("A.fVel", same))))
    assert table.columns["time"].unit is None
    with pytest.raises(InputError, match=r"`Flags` does not say whether these are in ms \(16\) or µs \(32\)"):
        read_table(saved(tmp_path, trace(flags, ("A.fPos", same), ("A.fVel", same[1:]))))


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("; 5; 0\n", 2, "stands before any variable"),
        ("0.Variable; A.x\n; 1,5; 0\n", 3, "'1,5' is no time stamp"),
        ("0.Variable; A.x\n; 1; 0\n1.Variable; A.x\n; 1; 0\n", 4, "'A.x' is recorded twice"),
        (f"0.Variable; A.x\n; {'9' * 400}; 0\n", 3, "is no time stamp"),
        ("0.Variable; A.x\nrubbish\n", 3, "neither `key; value` nor a sample"),
        ("0.Variable; A.x\n", None, "nothing was recorded"),
        ("Flags; 16\n0.Variable; A.x\n; 2; 0\n; 1; 0\n1.Variable; A.y\n; 1; 0\n", None, "'A.x' are repeated"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text: str, line: int | None, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said) as refused:
        read_table(saved(tmp_path, "[key]; [value]\n" + text))
    assert str(refused.value.where).endswith("" if line is None else f", line {line}")


def test_a_variable_without_samples_is_left_out_and_told(tmp_path: Path) -> None:
    same = [(2 * k, k) for k in range(4)]
    table = read_table(saved(tmp_path, trace(16, ("A.x", same), ("A.never", []), ("time", same))))
    assert list(table.columns) == ["time stamp", "A.x", "time"]  # a variable of that name hides no stamps
    assert table.columns["time stamp"].unit == "ms"
    assert [finding.what for finding in table.findings] == ["left out, as nothing was recorded of them: A.never"]


@pytest.mark.parametrize("coding", ["utf-16", "cp1252", "utf-8-sig"])
def test_the_coding_of_the_text_is_found(coding: str, tmp_path: Path) -> None:
    path = tmp_path / "axis.csv"
    path.write_bytes(trace(16, ("A.fWinkelmaß", [(1, 0.5), (2, 0.25)])).replace("\n; ", "\r\n ; ").encode(coding))
    assert read_table(path).columns["A.fWinkelmaß"].values.tolist() == [0.5, 0.25]


def test_words_are_told_where_the_column_is_used(tmp_path: Path) -> None:
    table = read_table(saved(tmp_path, trace(16, ("A.sState", [(1, "Standstill"), (2, "Homing")]))))
    assert table.columns["A.sState"].text == (0, "Standstill")


@given(junk=st.text(st.characters(blacklist_categories=("Cs",)), max_size=60), at=st.integers(0, 400))
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_trace_is_read_or_refused(junk: str, at: int, tmp_path: Path) -> None:
    whole = trace(16, ("A.fPos", [(k, k) for k in range(20)]), ("A.fVel", [(k, -k) for k in range(20)]))
    try:
        read_table(saved(tmp_path, whole[: 14 + at] + junk + whole[14 + at :]))
    except InputError as error:
        assert str(error)
