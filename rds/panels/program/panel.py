"""Part programs: written with their faults in sight, seen before they run, and run with an operator's hand on them."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.program.view import ProgramView

NAME = "program"
TITLE = "Program"
SUMMARY = "Write a part program, see its path and its faults, run it, hold it, change its feed"
HELP = "program-panel"


def build(shell: Any) -> widgets.Widget:
    """The editor on the left; preview, run and result on the right."""
    return ProgramView(shell).widget
