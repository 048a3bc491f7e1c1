"""Objects: a line, a quadrilateral, an arc, a cone or a file of points, by numbers, to a part program."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.objects.view import ObjectsView

NAME = "objects"
TITLE = "Objects"
SUMMARY = "Make a part program of a line, a quadrilateral, an arc, a cone or points by filling in their numbers"
HELP = "program-panel"


def build(shell: Any) -> widgets.Widget:
    """The object and its numbers on the left, its path on the right."""
    return ObjectsView(shell).widget
