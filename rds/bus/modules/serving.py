"""Serving a machine's modules in the dialect that a user names."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rds.bus.modules.dialects import check_dialect, server_module
from rds.machines import Machine


def serve_machine(
    machine: Machine, dialect: str, interface: str, channel: str | None, ready: Callable[[], Any], **options: Any
) -> None:
    """Serve `machine` until the process is told to end; `options` as of `serve_loop.serve_nodes`.

    InputError for an unknown dialect; else as each server says.
    """
    check_dialect(dialect)
    import_module(server_module(dialect)).serve(machine, interface, channel, ready=ready, **options)
