"""The harness that counts endings: what it calls right, and the page that it writes."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.endings import HERE, Ended, _judge, page, read_trials


@pytest.mark.parametrize(
    "code, said, ending, is_right",
    [
        (2, "rds: the disk is full", "no record, and why", True),
        (0, "", "no record", False),
        (7, "", "exit code 7", False),
        (1, f'Traceback\n File "{HERE}/rds/cli/main.py"', "traceback", False),
        (-2, "Traceback\n <frozen runpy>", "before Python had begun", True),
        (-2, f'Traceback\n File "{HERE}/rds/__init__.py"', "before Python had begun", True),
        (-2, "", "before Python had begun", True),
        (-2, f'Traceback\n File "{HERE}/rds/cli/main.py"', "exit code -2", False),
    ],
)
def test_what_is_right(code: int, said: str, ending: str, is_right: bool, tmp_path: Path) -> None:
    told, wrong = _judge(code, tmp_path / "out", said, tmp_path)
    assert told == ending and (not wrong) == is_right


def test_the_page_has_the_counts_and_what_was_wrong() -> None:
    hub = [Ended("hub", "implementation", *told) for told in (("machine lost", ""), ("hangs", "it hung"))]
    text = page([hub[0], Ended("leak", "emulation", "done", ""), *hub])
    assert "4 runs, 3 right." in text and "- hub, implementation: it hung" in text
    assert "| the bus's hub is killed | implementation | 3 | 2 | 2 machine lost, 1 hangs |" in text


def test_trials_are_read_up_to_a_torn_line(tmp_path: Path) -> None:
    kept = tmp_path / "trials.jsonl"
    assert read_trials(kept) == []
    kept.write_text('{"case": "hub", "mode": "emulation", "ending": "done", "wrong": ""}\n{"case": "h')
    assert read_trials(kept) == [Ended("hub", "emulation", "done", "")]
