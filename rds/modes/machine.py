"""The machine behind the bus of a run: one that is there already, or one started for this run."""

from __future__ import annotations

import secrets
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from rds.core.errors import MachineError
from rds.runtime.plan import Plan

BUILTIN = "rds"
TIMING = ("bitrate", "data_bitrate")  # options that all nodes of a bus share


@contextmanager
def machine_behind(plan: Plan) -> Iterator[Plan]:
    """The plan with its bus settled.

    On a bus other than the built-in one, the machine is what is connected there. On the built-in bus, a machine
    that is served on the channel (by default the machine's name) is used; where there is none, or another run
    commands it, one is started for this run, on a channel of its own unless the channel was given. InputError if
    what answers on the channel speaks another dialect.
    """
    bus = {"interface": BUILTIN, **plan.bus}
    if bus["interface"] != BUILTIN:
        yield replace(plan, bus=bus)
        return
    from rds.bus.address import channels
    from rds.bus.command import commanded
    from rds.bus.dialects import DEFAULT, is_served, server_module

    given, dialect = bus.get("channel"), bus.get("dialect", DEFAULT)
    channel = str(given or plan.machine.name)
    if (
        channel in channels()
        and (given or not commanded(channel))
        and is_served(dialect, plan.machine, BUILTIN, channel)
    ):
        yield replace(plan, bus=bus | {"channel": channel})
        return
    if given is None:
        channel = f"{plan.machine.name[:20]}-{secrets.token_hex(4)}"
    timing = {key: bus[key] for key in TIMING if key in bus}
    server = _serve(server_module(dialect), plan.machine.path, channel, timing)
    try:
        yield replace(plan, bus=bus | {"channel": channel})
    finally:
        server.terminate()
        try:
            server.wait(5)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()
        for pipe in (server.stdin, server.stdout):
            assert pipe is not None
            pipe.close()


def _serve(module: str, machine: str, channel: str, timing: Mapping[str, Any]) -> subprocess.Popen[bytes]:
    """Start the machine's modules in a process of their own, and wait until they are on the bus.

    They are the first there, so it is their options that say whether the bus has bit timing.
    """
    options = [word for key, value in timing.items() for word in ("--option", f"{key}={value}")]
    with tempfile.TemporaryFile() as said:
        server = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                module,
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
            server.kill()
            server.communicate()
            said.seek(0)
            last = said.read().decode(errors="replace").strip().splitlines()[-1:]
            raise MachineError(f"the machine on the built-in bus did not start: {''.join(last) or 'it said nothing'}")
    return server
