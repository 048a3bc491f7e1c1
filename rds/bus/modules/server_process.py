"""The modules of a machine in a process of their own, on the built-in bus, for as long as somebody wants them."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from rds.bus.modules.dialects import SERIAL_DIALECTS, server_module
from rds.core.errors import MachineError
from rds.core.exit_code import how_it_ended

_ENDING = 1.0  # s for one that has closed its stdout


def start_server(
    dialect: str, machine: str, channel: str, timing: Mapping[str, Any] = MappingProxyType({})
) -> subprocess.Popen[bytes]:
    """Start a machine's modules in a process of their own, and wait until they are on the built-in bus.

    `machine` is a name or the path of a file. It ends with the process that started it, once nobody commands.
    MachineError with its last words if it does not start.

    They are the first there, so it is their options that say whether the bus has bit timing.
    """
    options = [word for key, value in timing.items() for word in ("--option", f"{key}={value}")]
    with tempfile.TemporaryFile() as said:
        server = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                server_module(dialect),
                machine,
                "--channel",
                channel,
                "--exit-with-stdin",
                *options,
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=said,
            start_new_session=True,
        )
        assert server.stdout is not None
        if not server.stdout.readline().startswith(b"ready"):
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(_ENDING)  # to know how it ended by itself
            server.kill()
            server.communicate()
            said.seek(0)
            last = said.read().decode(errors="replace").strip().splitlines()[-1:]
            why = "".join(last) or f"its process {how_it_ended(server.returncode)}"
            where = "a serial line" if dialect in SERIAL_DIALECTS else "the built-in bus"
            raise MachineError(f"the machine on {where} did not start: {why}")
    return server


def end_server(server: subprocess.Popen[bytes]) -> None:
    """End it; returns when it is over."""
    server.terminate()
    try:
        server.wait(5)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    for pipe in (server.stdin, server.stdout):
        assert pipe is not None
        pipe.close()
