"""Equipment control: a controller on one system, in simulation, emulation or implementation."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.equipment.state import Equipment
from rds.panels.equipment.view import EquipmentView

NAME = "equipment-control"
TITLE = "Equipment control"
SUMMARY = "Let a controller follow a reference: simulated, against the clock, or on the machine"
HELP = "equipment"


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return EquipmentView(shell, Equipment(shell.session, "control")).widget
