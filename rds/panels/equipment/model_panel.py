"""Equipment model: a voltage signal to a model, to the machine, or to both."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.equipment.state import Equipment
from rds.panels.equipment.view import EquipmentView

NAME = "equipment-model"
TITLE = "Equipment model"
SUMMARY = "Send a voltage to a model, to the machine or to both, and compare what they do"
HELP = "equipment"


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return EquipmentView(shell, Equipment(shell.session, "model")).widget
