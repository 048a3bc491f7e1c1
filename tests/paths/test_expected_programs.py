"""Programs of each maker as they are kept, and what LinuxCNC's interpreter said of them.

`python -c "from tests.paths.test_expected_programs import keep; keep()"` writes them anew, where rs274 is installed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from rds.core.types import Segment
from rds.nc.paths import (
    arc,
    line,
    outline,
    part_program,
    path_of_points,
    quadrilateral_by_moves,
    read_points,
    spiral_cone,
)
from rds.nc.paths.drawing import parse_text_drawing
from tests.nc.rs274 import calls, needs_rs274, ours, rs274

EXPECTED = Path(__file__).parent / "expected"
FEED = 5.0  # mm/s
RING = ".........../..#######../.#########./.###...###./.##.....##./.###...###./.#########./..#######../..........."

PATHS: dict[str, Callable[[], Sequence[Segment]]] = {
    "line": lambda: line((0, 0), (40, 30, -2), FEED),
    "quad": lambda: quadrilateral_by_moves((1, 2), [(10, 20, -1), (100, 15, 0), (170, 25, 1)], FEED),
    "helix": lambda: arc((10, -5), 7.5, 30, -800, FEED, depth=1, end_depth=4),
    "cone": lambda: spiral_cone((1, 2), 20, 5, 2, 3, FEED, step_angle=20),
    "points": lambda: path_of_points(read_points(EXPECTED / "circle.csv"), FEED, depth=1, tolerance=0.05)[0],
    "outline": lambda: (
        outline(
            parse_text_drawing(RING.replace("/", "\n")), 0.5, FEED, holes="cut", at=(3, 4), depth=2, passes=2
        ).segments
    ),
}


def program(name: str) -> str:
    return part_program(PATHS[name](), name, safe_height=5, spindle=6000, blend=0.02)


def keep() -> None:
    for name in PATHS:
        (EXPECTED / f"{name}.ngc").write_text(program(name))
        printed, complaint = rs274(program(name).encode())
        assert not complaint, f"{name}: {complaint}"
        (EXPECTED / f"{name}.canon").write_text("\n".join(printed) + "\n")


@pytest.mark.parametrize("name", PATHS)
def test_the_program_is_the_one_that_is_kept(name: str) -> None:
    assert program(name) == (EXPECTED / f"{name}.ngc").read_text()


@pytest.mark.parametrize("name", PATHS)
def test_we_read_it_as_linuxcnc_did(name: str) -> None:
    found, complaint = ours(EXPECTED / f"{name}.ngc")
    assert not complaint
    assert calls(found) == calls((EXPECTED / f"{name}.canon").read_text().splitlines())


@needs_rs274
@pytest.mark.parametrize("name", PATHS)
def test_linuxcnc_still_reads_it_so(name: str) -> None:
    found, complaint = rs274((EXPECTED / f"{name}.ngc").read_bytes())
    assert not complaint
    assert calls(found) == calls((EXPECTED / f"{name}.canon").read_text().splitlines())
