"""The panels by name, in the order of the navigation.

Each has a folder, with a module that holds NAME, TITLE, SUMMARY, HELP (a page of the documentation) and build(shell),
which gives the panel's widget.
"""

from __future__ import annotations

from rds.core.registry import Registry

PANELS = Registry(
    "panel",
    {
        "menu": "rds.panels.page.menu",
        "equipment-model": "rds.panels.equipment.model_panel",
        "equipment-control": "rds.panels.equipment.control_panel",
        "design": "rds.panels.design.panel",
        "interpolator": "rds.panels.interpolator.panel",
        "program": "rds.panels.program.panel",
        "drawing": "rds.panels.drawing.panel",
        "objects": "rds.panels.objects.panel",
        "machine": "rds.panels.machine.panel",
        "jog": "rds.panels.jog.panel",
        "data": "rds.panels.data.panel",
        "grading": "rds.panels.grading.panel",
        "help": "rds.panels.help.panel",
    },
)
