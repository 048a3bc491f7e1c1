"""The journal: what is in it stays, whatever the last write came to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.grading.batch.journal import Journal, line, read_journal

ROWS: list[dict[str, Any]] = [{"student": "ada", "n": 1.5}, {"student": "b\n\u2028é", "n": None}, {"student": "cy"}]


def written(path: Path) -> bytes:
    with Journal(path) as journal:
        for row in ROWS:
            journal.append(row)
    return path.read_bytes()


def test_rows_come_back(tmp_path: Path) -> None:
    written(tmp_path / "j")
    with Journal(tmp_path / "j") as journal:
        assert journal.rows == ROWS and not journal.was_torn
    assert read_journal(tmp_path / "j") == ROWS
    assert read_journal(tmp_path / "none") == []


def test_cut_anywhere_whole_lines_stay_and_the_rest_is_written_again(tmp_path: Path) -> None:
    whole = written(tmp_path / "j")
    for length in range(len(whole)):
        (tmp_path / "cut").write_bytes(whole[:length])
        with Journal(tmp_path / "cut") as journal:
            count = whole[:length].count(b"\n")
            assert journal.rows == ROWS[:count]
            assert journal.was_torn == (length > 0 and not whole[:length].endswith(b"\n"))
            for row in ROWS[count:]:
                journal.append(row)
        assert (tmp_path / "cut").read_bytes() == whole


def test_every_changed_byte_is_noticed(tmp_path: Path) -> None:
    whole = written(tmp_path / "j")
    last = whole.rindex(b"\n", 0, -1) + 1
    for place in range(last - 1):
        if whole[place : place + 1] == b"\n":
            continue
        changed = bytearray(whole)
        changed[place] ^= 1
        (tmp_path / "bad").write_bytes(changed)
        with pytest.raises(InputError, match=r"line [12]"):
            Journal(tmp_path / "bad")


def test_garbage_in_the_place_of_the_last_line_is_cut_off(tmp_path: Path) -> None:
    whole = written(tmp_path / "j")
    (tmp_path / "j").write_bytes(whole + b"\0" * 40 + b"\n")
    with Journal(tmp_path / "j") as journal:
        assert journal.rows == ROWS and journal.was_torn
    assert (tmp_path / "j").read_bytes() == whole


@given(st.dictionaries(st.text(), st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False)))
def test_a_row_is_one_line(row: dict[str, Any]) -> None:
    assert line(row).count(b"\n") == 1


def test_one_process_at_a_time(tmp_path: Path) -> None:
    with Journal(tmp_path / "j"), pytest.raises(InputError, match="another rds grade run"):
        Journal(tmp_path / "j")
    Journal(tmp_path / "j").close()


def test_what_append_has_returned_from_survives_a_kill(tmp_path: Path) -> None:
    program = (
        "import sys\nfrom pathlib import Path\nfrom rds.grading.batch.journal import Journal\n"
        "journal = Journal(Path(sys.argv[1]))\n"
        "for n in range(1_000_000):\n    journal.append({'n': n, 'text': 'x' * 5000})\n    print(n, flush=True)\n"
    )
    words = [sys.executable, "-c", program, str(tmp_path / "j")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        process.stdout.readline()
        time.sleep(0.2)
        os.kill(process.pid, signal.SIGKILL)
        told = [int(each) for each in process.stdout.read().split("\n")[:-1]]
    with Journal(tmp_path / "j") as journal:
        numbers = [row["n"] for row in journal.rows]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) > (told[-1] if told else 0)
