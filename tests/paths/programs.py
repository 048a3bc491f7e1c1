"""Part programs of paths, as interpreters understand them: ours, and LinuxCNC's where it is installed."""

from __future__ import annotations

import shutil
from collections.abc import Sequence

import numpy as np

from rds.core.types import ArcSegment, Segment
from rds.nc.language.canon import ARC, FEED, RATE, MotionBlock
from rds.nc.paths.measure import pieces
from tests.nc.rs274 import calls, ours, rs274

HAS_RS274 = shutil.which("rs274") is not None


def agreed(program: str) -> None:
    """Both interpreters take the program, and say the same of it."""
    mine, complaint = ours(program.encode())
    assert not complaint
    if HAS_RS274:
        printed, complaint = rs274(program.encode())
        assert not complaint
        assert calls(mine) == calls(printed)


def assert_cuts(program: str, segments: Sequence[Segment], decimals: int = 4) -> None:
    """The program's cuts are these segments, to its decimals; before each piece it goes to its start."""
    from rds.nc import interpret

    rows = np.concatenate([item.rows for item in interpret(program) if isinstance(item, MotionBlock)])
    cuts = [row for row in rows if row["kind"] in (FEED, ARC)]
    rates = [row["values"][0] for row in rows if row["kind"] == RATE and row["values"][0] > 0]
    expected: list[tuple[Segment | None, tuple[float, ...]]] = []
    for piece in pieces(segments):
        expected += [(None, piece[0].start), *((segment, segment.end) for segment in piece)]
    assert len(cuts) == len(expected)
    near = 10.0**-decimals
    for row, (segment, end) in zip(cuts, expected, strict=True):
        values = row["values"]
        if isinstance(segment, ArcSegment):
            assert row["kind"] == ARC
            x, y, cx, cy, turn, z = values[:6]
            assert np.allclose((cx, cy), segment.centre[:2], atol=2 * near)
            assert turn == (-1 if segment.clockwise else 1)
        else:
            assert row["kind"] == FEED
            x, y, z = values[:3]
        assert np.allclose((x, y, z), end, atol=near)
    assert np.allclose(rates, [60 * segments[0].feed_rate], rtol=1e-6)  # written once
