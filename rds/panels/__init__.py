"""Panels for JupyterLab and the page of `rds app`: thin over `rds.panels.session` and the rest.

rds.panels.main() shows the main menu and all panels. A folder per panel; `registry.py` is their table.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rds.panels.registry import PANELS


def main(
    folder: str | Path = ".", machine: str = "mini-cnc", panel: str = "menu", bus: Mapping[str, Any] | None = None
) -> Any:
    """The page with all panels, on the files of `folder`; the last expression of a notebook cell shows it.

    `bus` holds what the `[bus]` table of an experiment does; by default the machine is on the built-in bus.
    InputError for a panel that does not exist, and where a package of the extra `lab` is missing.
    """
    from rds.core.extras import needed_for

    with needed_for("a panel"):
        from rds.panels.kit.made_at_once import made_at_once
        from rds.panels.page.shell import Shell
        from rds.panels.session import Session

    PANELS.module(panel)
    with made_at_once():
        return Shell(Session(folder, machine, bus), panel).widget
