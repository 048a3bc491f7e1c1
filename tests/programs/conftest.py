"""A small part that has everything: spindle, lines, an arc, a stop, a dwell."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_machines import machine

PART = """\
(a small part)
G21 G90 G61
S2000 M3
G1 Z-0.5 F600
G1 X2 F600
G2 X4 Y-2 I0 J-2
M0
G4 P0.05
G1 Y-0.5
M2
"""


SLOW = "F240"  # of what somebody interrupts: over a second for it, on a computer that may be busy


ONE_AXIS = """\
(the same of one axis)
G21 G90 G61
(no tool, no spindle)
G1 X-0.5 F600
G1 X2 F600
G1 X4
M0
G4 P0.05
G1 X0.5
M2
"""


@pytest.fixture
def one_axis(tmp_path: Path) -> list[str]:
    """The words of `rds nc run` for a slow part on a machine with the axis X alone."""
    file = tmp_path / "part.ngc"
    file.write_text(ONE_AXIS.replace("G1 X2 F600", f"G1 X2 {SLOW}"))
    return [str(file), "--machine", str(machine(tmp_path, "X"))]


@pytest.fixture
def slow_part(tmp_path: Path) -> Path:
    """The same, slow enough to be interrupted in the middle of its cuts."""
    file = tmp_path / "part.ngc"
    file.write_text(PART.replace("G1 X2 F600", f"G1 X2 {SLOW}"))
    return file


@pytest.fixture
def part(tmp_path: Path) -> Path:
    file = tmp_path / "part.ngc"
    file.write_text(PART)
    return file
