"""Serving a machine's modules in the dialect that a user names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rds.bus.modules.dialects import check_dialect
from rds.machines import Machine


def serve_machine(
    machine: Machine, dialect: str, interface: str, channel: str | None, ready: Callable[[], Any], **options: Any
) -> None:
    """Serve `machine` until the process is told to end; `options` as of `serve_loop.serve_nodes`.

    InputError for an unknown dialect; else as each server says.
    """
    check_dialect(dialect)
    if dialect == "rds":
        from rds.bus.modules.rds.server import serve

        serve(machine, interface, channel, ready=ready, **options)
    elif dialect == "oacs":
        from rds.bus.modules.oacs.server import serve_oacs

        serve_oacs(machine, interface, channel, ready=ready, **options)
    else:
        from rds.bus.modules.cia402.server import serve as serve_drives

        serve_drives(machine, interface, channel, ready=ready, **options)
