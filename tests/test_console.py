"""Tables on the screen: whole words, whole numbers, and nothing wider than a terminal."""

from __future__ import annotations

import io
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

import rds.cli.console
from rds.cli.console import cell, show_table

COLUMNS = ["axis", "direction", "average [counts]", "largest − expected [counts]", "largest deviation [mm]", "remark"]
ROWS = [["X", "cw", "13532.0", "71.0", "0.349", "meets what was asked for"], ["X", "ccw", "13536.0", "–", "0.178", ""]]


def shown(columns: list[str], rows: list[list[str]], width: int, terminal: bool) -> list[str]:
    screen = Console(width=width, force_terminal=terminal, color_system=None, record=True, file=io.StringIO())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rds.cli.console, "console", lambda: screen)
        show_table("Title", columns, rows)
    return screen.export_text(styles=False).splitlines()


def test_numbers_stand_right_and_words_left() -> None:
    lines = shown(["id", "type", "counts"], [["2", "axis", "13532"], ["10", "device", "–"]], 80, True)
    assert lines[-3:-1] == ["│ 2  │ axis   │  13532 │", "│ 10 │ device │      – │"]


def test_what_does_not_fit_on_a_terminal_is_turned() -> None:
    lines = shown(COLUMNS, ROWS, 60, True)
    assert any("largest deviation [mm]" in line and "0.349" in line for line in lines)
    assert max(map(len, lines)) <= 60


def test_a_pipe_takes_what_width_is_needed() -> None:
    lines = shown(COLUMNS, ROWS, 40, False)
    assert len({len(line) for line in lines[1:] if line}) == 1
    assert any(line.startswith("│ X ") and "13532.0" in line and "0.349" in line for line in lines)


WORD = st.text("abcdefghij[]%", min_size=1, max_size=9)
TEXT = st.lists(WORD, min_size=1, max_size=3).map(" ".join)
NUMBER = st.floats(-1e4, 1e4).map(lambda value: f"{value:.3f}")


@given(st.data(), st.lists(TEXT, min_size=3, max_size=9), st.integers(1, 4), st.integers(60, 130), st.booleans())
def test_no_word_is_cut(data: st.DataObject, columns: list[str], count: int, width: int, terminal: bool) -> None:
    kinds: list[Any] = [TEXT, *(data.draw(st.sampled_from([TEXT, NUMBER])) for _ in columns[1:])]
    rows = [[data.draw(kind) for kind in kinds] for _ in range(count)]
    lines = shown(columns, rows, width, terminal)
    words = set(" ".join(lines).replace("│", " ").replace("┃", " ").split())
    assert words >= {word for text in [*columns, *(value for row in rows for value in row)] for word in text.split()}
    if terminal:
        assert max(map(len, lines)) <= width


def test_cells_say_nothing_by_a_dash_and_round_what_nobody_has() -> None:
    assert [cell(None), cell(122.52999999999999), cell(3), cell("0.50")] == ["–", "122.53", "3", "0.50"]
