"""How the controls of a panel stand: in rows, groups and columns."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.kit.html import Html


def row(*children: Any) -> widgets.HBox:
    """Controls side by side, which go on in the next line where there is no room."""
    box = widgets.HBox(list(children))
    box.add_class("rds-row")
    return box


def group(title: str, *children: Any) -> widgets.VBox:
    """Controls under a heading."""
    box = widgets.VBox([Html(f"<h2 class=rds-part>{title}</h2>"), *children])
    box.add_class("rds-group")
    return box


def fields_group(children: list[widgets.Widget]) -> widgets.Box:
    """Fields beside and below each other, as there is room."""
    box = widgets.Box(children)
    box.add_class("rds-group")
    box.add_class("rds-fields")
    return box


def columns(side: list[Any], main: list[Any]) -> widgets.HBox:
    """Settings at the left, what comes of them at the right."""
    left, right = widgets.VBox(side), widgets.VBox(main)
    left.add_class("rds-side")
    right.add_class("rds-main")
    box = widgets.HBox([right, left])  # Tab comes to the buttons before the settings
    box.add_class("rds-columns")
    return box
