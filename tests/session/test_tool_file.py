"""Tool tables that are edited: faults at their words, and no table lost or written over."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.panels.program.tool_file import ToolFile


def test_a_new_table_is_one_that_the_interpreter_reads(tmp_path: Path) -> None:
    table = ToolFile(tmp_path, "mine.tbl")
    assert table.changed and [tool.diameter for tool in table.tools()] == [6.0] and not table.path.exists()
    table.text += "T2 P2 D3 Z-1.5 ;drill\n"
    table.save()
    assert not table.changed
    again = ToolFile(tmp_path, "mine.tbl")
    assert [(tool.number, tool.offset[2]) for tool in again.tools()] == [(1, 0.0), (2, -1.5)]


def test_a_fault_is_marked_at_its_word_and_not_saved(tmp_path: Path) -> None:
    table = ToolFile(tmp_path, "mine.tbl")
    table.text = "T1 P1 D6\nT2 P2 Dx\n"
    (mark,) = table.marks()
    assert (mark.line, mark.column, mark.length) == (2, 7, 2) and mark.text.startswith("Dx: is no word")
    with pytest.raises(InputError, match=r"mine.tbl:2:7: Dx: is no word of a tool table"):
        table.save()
    assert not table.path.exists()


def test_what_somebody_else_wrote_meanwhile_is_not_written_over(tmp_path: Path) -> None:
    table = ToolFile(tmp_path, "mine.tbl")
    table.path.write_text("T7 P7 D2\n")
    with pytest.raises(InputError, match="changed by somebody else"):
        table.save()
    assert table.path.read_text() == "T7 P7 D2\n"


def test_a_table_of_another_coding_is_not_edited(tmp_path: Path) -> None:
    (tmp_path / "old.tbl").write_bytes("T1 P1 D6 ;Fräser\n".encode("latin-1"))
    with pytest.raises(InputError, match="is no UTF-8 at byte 13"):
        ToolFile(tmp_path, "old.tbl")


@pytest.mark.parametrize("name", ["../mine.tbl", ".tbl", ".hidden.tbl", "mine.txt", "", "a/b.tbl", "a\n.tbl"])
def test_names_that_are_none_of_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no name of a tool table"):
        ToolFile(tmp_path, name)
