"""docs/serial-fieldbus.md is true where it shows code."""

from __future__ import annotations

import pytest
from documents import blocks

CODE = [block.text for block in blocks("docs/serial-fieldbus.md") if block.language == "python"]


def test_a_host_of_the_library_moves_the_units(capsys: pytest.CaptureFixture[str]) -> None:
    """Section 6.3 of dcs-thesis: 3 and 2 mm by buffers, at 100 steps a mm, and a jog of 0.1 s."""
    (code,) = (code for code in CODE if "add_to_queue" in code)
    exec(code, {})
    x, y, z = eval(capsys.readouterr().out)
    assert (x, y) == (300, 200)
    assert 27 <= z <= 36


def test_the_motor_of_z(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = (code for code in CODE if "StepperAxis" in code)
    exec(code, {})
    told = capsys.readouterr().out
    assert "600 steps sent" in told and "at once" in told
