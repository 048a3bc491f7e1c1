"""docs/motion.md: its program runs, and its numbers are the code's."""

from __future__ import annotations

from math import acos, degrees
from pathlib import Path

import pytest
from documents import ROOT, blocks

from rds.interpolators.motion.path import MOST_JOINED, SHARP, STOP_SHARE, TURN_SHARE
from rds.interpolators.motion.planner import MARGIN, TOLERANCE
from rds.interpolators.motion.speed import BEND_SHARE
from rds.interpolators.motion.stretch import WINDOW

DOCUMENT = "docs/motion.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")


def test_its_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    block, move = (block for block in blocks(DOCUMENT) if block.language == "python")
    exec(compile(block.text, DOCUMENT, "exec"), {})
    seconds, away = capsys.readouterr().out.split(" s, ")
    assert 5.0 < float(seconds) < 7.0  # 58 mm at 10 mm/s
    assert 10.0 < float(away.split(" µm")[0]) <= 20.0
    assert (tmp_path / "certificate.png").read_bytes().startswith(b"\x89PNG")
    pytest.importorskip("ruckig")
    exec(compile(move.text, DOCUMENT, "exec"), {})
    assert capsys.readouterr().out == "0.685 s, and 0.685 s to rest\n"


def test_its_numbers() -> None:
    for said in (
        f"takes {TURN_SHARE} of the jerk",
        f"Δv ≤ {TURN_SHARE} j T²",
        f"below {100 * STOP_SHARE:.0f} % of the feed",
        f"v² Δκ ≤ {BEND_SHARE / 0.75:.1f} j T",
        f"{TOLERANCE} mm without a P",
        f"more than {degrees(acos(SHARP)):.0f}°",
        f"up to {MOST_JOINED} lines",
        f"over {WINDOW} pieces",
        f"up to {100 * MARGIN} %",
    ):
        assert said in TEXT, said
