"""The harness that counts endings: what it calls right, and the page that it writes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from benchmarks.endings import HERE, Count, _judge, page


@pytest.mark.parametrize(
    "code, said, ending, is_right",
    [
        (2, "rds: the disk is full", "no record, and why", True),
        (0, "", "no record", False),
        (7, "", "exit code 7", False),
        (1, f'Traceback\n File "{HERE}/rds/cli/main.py"', "traceback", False),
        (-2, "Traceback\n <frozen runpy>", "before Python had begun", True),
    ],
)
def test_what_is_right(code: int, said: str, ending: str, is_right: bool, tmp_path: Path) -> None:
    told, wrong = _judge(code, tmp_path / "out", said, tmp_path)
    assert told == ending and (not wrong) == is_right


def test_the_page_has_the_counts_and_what_was_wrong() -> None:
    counts = {
        ("hub", "implementation"): Count(3, 2, Counter({"machine lost": 2, "hangs": 1}), ["it hung"]),
        ("leak", "emulation"): Count(1, 1, Counter(done=1)),
    }
    text = page(counts)
    assert "4 runs, 3 right." in text and "- hub, implementation: it hung" in text
    assert "| the bus's hub is killed | implementation | 3 | 2 | 2 machine lost, 1 hangs |" in text
