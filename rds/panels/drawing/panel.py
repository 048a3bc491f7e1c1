"""Drawings: cells or a picture, to an outline, to a part program."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.drawing.view import DrawingView

NAME = "drawing"
TITLE = "Drawing"
SUMMARY = "Draw cells or take a picture, and make a part program of its outline"
HELP = "program-panel"


def build(shell: Any) -> widgets.Widget:
    """Settings on the left, the drawing with its outline on the right."""
    return DrawingView(shell).widget
