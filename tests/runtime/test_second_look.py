"""The second look at a run's calls: what it takes of the computer has a limit."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="other systems limit the size of a process otherwise, or not")
def test_code_that_leaks_ends_the_second_look_instead_of_filling_the_computer() -> None:
    code = (
        "from rds.modes.process import second_look as look\n"
        "look._limit_memory()\n"
        "try:\n"
        "    bytearray(look.MEMORY)\n"
        "except MemoryError:\n"
        "    print('refused', len(bytearray(look.MEMORY // 4)))\n"
    )
    said = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == f"refused {1 << 28}\n"
