"""python-can's own viewer on the built-in bus, on a terminal of its own."""

from __future__ import annotations

import os
import re
import select
import subprocess
import sys
import time
from collections.abc import Callable

import can
import pytest

pty = pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
pytest.importorskip("curses", reason="python-can's viewer needs curses: pip install windows-curses")


@pytest.mark.realtime
def test_the_viewer_shows_frames_of_the_built_in_bus(open_bus: Callable[..., can.BusABC]) -> None:
    bus = open_bus()
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "can.viewer", "-i", "rds", "-c", "test"]
    environment = os.environ | {"TERM": "xterm", "LINES": "24", "COLUMNS": "100"}
    viewer = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=subprocess.PIPE, env=environment)
    os.close(slave)
    shown = b""
    try:
        end = time.monotonic() + 60.0
        while time.monotonic() < end and not re.search(rb"0x123.*C0.?FF", shown, re.DOTALL):
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=[0xC0, 0xFF]))
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
        assert re.search(rb"0x123.*C0.?FF", shown, re.DOTALL), shown[-500:]
        os.write(master, b"q")
        assert viewer.wait(30.0) == 0
    finally:
        viewer.kill()
        _, complaints = viewer.communicate()
        os.close(master)
    assert complaints == b""
