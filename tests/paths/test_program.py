"""Paths as part programs."""

from __future__ import annotations

from itertools import pairwise
from math import cos, radians, sin

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.core.types import ArcSegment, LineSegment
from rds.nc.paths import arc, line, part_program
from rds.nc.paths.program import comment
from tests.nc.rs274 import ours
from tests.paths.programs import agreed, assert_cuts

FEED = 5.0
TWO = [*line((0, 0), (10, 0), FEED), *line((20, 0, -1), (20, 10, -1), FEED)]


def test_the_program_of_two_pieces_reads_so() -> None:
    text = part_program(TWO, "two pieces", safe_height=5, spindle=6000, blend=0.02)
    assert text.splitlines() == [
        "(two pieces)",
        "G17 G21 G40 G90 G91.1 G94",
        "G64 P0.02",
        "S6000 M3",
        "G0 Z5",
        "G0 X0 Y0",
        "G1 Z0 F300",
        "G1 X10",
        "G0 Z5",
        "G0 X20 Y0",
        "G1 Z-1",
        "G1 Y10",
        "G0 Z5",
        "M5",
        "M2",
    ]
    agreed(text)


@given(
    st.floats(1e-4, 1000),
    st.floats(-360, 360),
    st.floats(-720, 720).filter(lambda swept: swept != 0),
    st.integers(4, 8),
    st.floats(-1000, 1000),
)
@example(1.0, 0.0, 1e-5, 4, 0.0)
@example(1e-4, 3.0, 200.0, 4, 0.33333)
@example(1.0, 0.0, 359.9999999, 4, 0.0)
def test_rounding_never_turns_an_arc_the_long_way_round(
    r: float, start: float, swept: float, decimals: int, x: float
) -> None:
    if abs(swept) < 1e-9:
        return
    path = arc((x, 0.1), r, start, swept, FEED)
    text = part_program(path, decimals=decimals)
    _, complaint = ours(text.encode())
    assert not complaint
    from rds.nc import interpret
    from rds.nc.language.canon import ARC, MotionBlock

    whole = 0.0
    for item in interpret(text):
        if isinstance(item, MotionBlock):
            whole += sum(abs(row["values"][4]) for row in item.rows if row["kind"] == ARC)
    assert whole <= len(path)  # no more turns than there were
    if r * abs(swept) > 1 and r > 0.002:  # degrees × mm: longer than the last decimal
        assert "G2" in text or "G3" in text


def test_arcs_at_few_decimals_keep_to_linuxcnc_s_tolerance_or_are_refused() -> None:
    (cut,) = arc((0.123, 0.456), 3.3, 17, 63, FEED)
    assert_cuts(part_program([cut], decimals=2), [cut], decimals=2)
    with pytest.raises(InputError, match="take 3 decimals"):
        part_program([cut], decimals=1)


def test_an_arc_off_its_circle_is_refused() -> None:
    good = ArcSegment((1, 0, 0), (0, 1.02, 0), (0, 0, 0), FEED)
    assert "G3" in part_program([good])  # 0.02 mm is within LinuxCNC's 0.028
    agreed(part_program([good]))
    with pytest.raises(InputError, match="off its circle"):
        part_program([ArcSegment((1, 0, 0), (0, 1.03, 0), (0, 0, 0), FEED)])
    large = ArcSegment((5000, 0, 0), (0, 5004, 0), (0, 0, 0), FEED)  # within 0.1 %, but far off
    with pytest.raises(InputError, match="off its circle"):
        part_program([large])


@given(st.text(max_size=300))
@example("MSG, hello")
@example("a (nested) comment")
@example("probeopen file")
@example("debug,#1")
def test_any_title_is_a_comment_and_nothing_else(title: str) -> None:
    text = part_program(line((0, 0), (1, 0), FEED), title)
    lines, complaint = ours(text.encode())
    assert not complaint
    assert not any("MESSAGE" in line for line in lines)
    for row in title.splitlines():
        assert comment(row).isascii() and comment(row).count("(") == 1 == comment(row).count(")")
        assert len(comment(row)) < 255


def test_comments_that_linuxcnc_acts_on_are_made_harmless() -> None:
    for title in ("MSG, stop here", "print, #5", "logopen,x", "LOGCLOSE", "probeopen x"):
        agreed(part_program(line((0, 0), (1, 0), FEED), title))


@pytest.mark.parametrize(
    "segments, options, words",
    [
        (TWO, {}, ["in 2 pieces", "give a safe height"]),
        (TWO, {"safe_height": 0.0}, ["safe height = 0 mm is not above the path, which reaches z = 0 mm"]),
        (TWO, {"safe_height": float("inf")}, ["safe height = inf must be a finite number"]),
        (TWO[:1], {"spindle": -1}, ["spindle speed = -1 must be more than 0"]),
        (TWO[:1], {"blend": 0}, ["blend = 0 must be more than 0"]),
        (TWO[:1], {"decimals": 0}, ["decimals = 0 must be a whole number from 1 to 9"]),
        (TWO[:1], {"decimals": 2.5}, ["decimals = 2.5"]),
        ([], {}, ["no segments"]),
        ([LineSegment((0, 0), (1, 1), FEED)], {}, ["must have X, Y and Z"]),
        ([LineSegment((0, 0, 0), (1, 1, float("nan")), FEED)], {}, ["leaves the space"]),
        ([LineSegment((0, 0, 0), (1, 1, 1), -1)], {}, ["feed rate = -1 must be more than 0"]),
        ([LineSegment((0, 0, 0), (1, 1, 1), 1e-9)], {}, ["F0"]),
        ([ArcSegment((1, 0, 0), (0, 0, 1), (0, 0, 0), FEED, plane=(0, 2))], {}, ["not in the XY plane"]),
        ([ArcSegment((0, 0, 0), (0, 0, 0), (0, 0, 0), FEED)], {}, ["off its circle"]),
    ],
)
def test_what_no_program_can_say_is_refused(segments: list, options: dict, words: list[str]) -> None:
    with pytest.raises(InputError) as refusal:
        part_program(segments, **options)
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


def test_rounding_does_not_add_up() -> None:
    third = 1 / 3
    points = [(k * third, k * third) for k in range(3001)]
    path = [s for a, b in pairwise(points) for s in line(a, b, FEED)]
    assert "X1000 Y1000" in part_program(path)


def test_a_circle_of_many_arcs_closes_to_the_last_decimal() -> None:
    path = [s for k in range(36) for s in arc((1 / 3, 1 / 7), 10, 10 * k, 10, FEED)]
    text = part_program(path)
    first, last = text.splitlines()[1].split()[1:3], text.splitlines()[-2].split()[1:3]
    assert first == [f"X{1 / 3 + 10 * cos(0):.4f}", f"Y{1 / 7 + 10 * sin(radians(0)):.4f}"] == last
