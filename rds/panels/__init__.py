"""Panels for JupyterLab and the page of `rds app`: thin over `rds.session` and the rest.

rds.panels.main() shows the main menu and all panels; one file per panel, with NAME, TITLE, SUMMARY, HELP (a page of
the documentation) and build(shell), which gives the panel's widget.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rds.core.registry import Registry

PANELS = Registry(
    "panel",
    {
        "menu": "rds.panels.menu",
        "equipment-model": "rds.panels.equipment_model",
        "equipment-control": "rds.panels.equipment_control",
        "design": "rds.panels.design",
        "interpolator": "rds.panels.interpolator",
        "program": "rds.panels.program",
        "drawing": "rds.panels.drawing",
        "machine": "rds.panels.machine",
        "jog": "rds.panels.jog",
        "data": "rds.panels.data",
        "grading": "rds.panels.grading",
        "help": "rds.panels.guide",
    },
)


def main(
    folder: str | Path = ".", machine: str = "mini-cnc", panel: str = "menu", bus: Mapping[str, Any] | None = None
) -> Any:
    """The page with all panels, on the files of `folder`; the last expression of a notebook cell shows it.

    `bus` holds what the `[bus]` table of an experiment does; by default the machine is on the built-in bus.
    InputError for a panel that does not exist, ImportError naming the extra `lab` where ipywidgets is missing.
    """
    from rds.panels.shell import Shell
    from rds.session import Session

    PANELS.module(panel)
    return Shell(Session(folder, machine, bus), panel).widget
