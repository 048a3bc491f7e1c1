"""A module that waits to take another one's place: python standby_process.py DIALECT CHANNEL.

It writes "standby"; with the first line on stdin it is on the bus as axis X, with that axis's number and type (and in
the oacs dialect with serial number 77, as the one that it replaces).
"""

from __future__ import annotations

import sys
from importlib import import_module

from rds.bus.modules.dialects import server_module
from rds.bus.modules.oacs import messages
from rds.machines import load_machine

MACHINES = {"rds": "mini-cnc", "oacs": "mrmt-oacs", "cia402": "mini-cnc"}


def main(dialect: str, channel: str) -> None:
    """Wait, then serve until killed."""
    server = import_module(server_module(dialect))
    machine = load_machine(MACHINES[dialect])
    options = {"serials": {"X": 77}} if dialect == "oacs" else {}
    if dialect == "oacs":
        messages.load()
    say("standby")
    sys.stdin.readline()
    server.serve(machine, "rds", channel, ["X"], ready=lambda: say("ready"), **options)


def say(line: str) -> None:
    """One line on stdout."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
