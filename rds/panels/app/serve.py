"""Serving the page: Voilà with a template that asks no other machine for anything, and a kernel that is ready."""

from __future__ import annotations

import json
import os
import secrets
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rds.bus.hub.runtime_folder import runtime_directory
from rds.core.errors import InputError
from rds.core.extras import missing
from rds.machines import load_machine
from rds.panels.app.page import BUS, FOLDER, MACHINE, PANEL, WHEREABOUTS
from rds.panels.app.ready_kernels import ReadyKernels
from rds.panels.registry import PANELS

_HERE = Path(__file__).parent
LEFT = 60  # s after which a kernel ends that no browser shows and that has nothing to say: nothing goes on in it
SHOWN = 120  # s that the server waits for what a kernel shows; Jupyter's own 4 left pages empty on a busy computer


def serve(
    folder: Path,
    machine: str,
    panel: str,
    port: int | None,
    browser: bool,
    bus: Mapping[str, Any] | None = None,
) -> None:
    """Serve until Ctrl-C. InputError for a folder, machine or panel that is not there, or where Voilà is missing.

    `bus` is as for `rds.panels.main`, but for faults, which are for a run by itself.

    Only who has the address with its token gets in: a kernel runs whatever its page asks for. All that passes between
    browser, server and kernels passes by loopback, or lies in a folder that only this user may enter.
    """
    if not folder.is_dir():
        raise InputError("is no folder; give the one with your files, or make it first", str(folder))
    load_machine(machine)
    PANELS.module(panel)
    if bus and "faults" in bus:
        raise InputError("[bus] faults are injected by `rds run`; take them out of the table for the page")
    paths = [str(_HERE / "share" / "jupyter"), os.environ.get("JUPYTER_PATH", "")]
    os.environ |= {
        "JUPYTER_PATH": os.pathsep.join(filter(None, paths)),
        FOLDER: str(folder.resolve()),
        MACHINE: str(Path(machine).resolve()) if machine.endswith(".toml") else machine,  # a page is in its folder
        PANEL: panel,
        BUS: json.dumps(dict(bus or {}), default=str),  # a date is no JSON
    }
    # of a short name, for the sockets in it; a kernel that is just ending may still write there
    with tempfile.TemporaryDirectory(prefix="app", dir=runtime_directory(), ignore_cleanup_errors=True) as private:
        os.environ[WHEREABOUTS] = private
        ready = ReadyKernels()  # imports while this process does
        try:
            launch = _server(ready)
            launch(argv=[str(_HERE / "page.ipynb"), *_options(port, browser, private)])
        finally:
            ready.close()


def _server(ready: ReadyKernels) -> Callable[..., None]:
    """Voilà, which takes its kernels from `ready`; InputError where it is missing."""
    # jsonschema does without this one, which compiles a grammar of addresses for a second that nothing here checks
    sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]
    try:
        from rds.panels.app.provisioner import offer
        from rds.panels.app.server import PanelsServer
    except ImportError as error:
        raise missing(error.name or "Voilà", "the page", extra="lab") from error
    offer(ready)
    launch: Callable[..., None] = PanelsServer.launch_instance
    return launch


def _options(port: int | None, browser: bool, private: str) -> list[str]:
    settings: dict[str, Any] = {
        "Voila.ip": "127.0.0.1",
        "Voila.auto_token": True,
        # a browser sends a cookie to all ports of a host, so to the servers of other users, but only under its path
        "Voila.base_url": f"/{secrets.token_hex(8)}/",
        "Voila.connection_dir_root": private,
        "Voila.open_browser": browser,
        "VoilaConfiguration.template": "rds",
        "VoilaConfiguration.preheat_kernel": True,  # the first page opens on a kernel that has loaded everything
        "VoilaConfiguration.default_pool_size": 1,
        "VoilaConfiguration.show_tracebacks": True,
        "VoilaExecutor.iopub_timeout": SHOWN,
        "VoilaConfiguration.file_allowlist": "$.",  # a pattern that no file fits
        "VoilaConfiguration.multi_kernel_manager_class": "rds.panels.app.kernels.PageKernels",
        # the limit is for what code prints; a panel is up to 272 messages, and one that is left out never shows
        "ZMQChannelsWebsocketConnection.limit_rate": False,
        "MappingKernelManager.cull_idle_timeout": LEFT,
        "MappingKernelManager.cull_interval": 10,
    }
    if port is not None:
        settings |= {"Voila.port": port, "Voila.port_retries": 0}
    return [f"--{name}={value}" for name, value in settings.items()]
