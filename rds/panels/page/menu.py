"""The main menu: what there is to do, and the shortest way to a first tracked sine."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import button
from rds.panels.registry import PANELS

NAME = "menu"
TITLE = "Main menu"
SUMMARY = "What there is to do"
HELP = "panels"


def build(shell: Any) -> widgets.Widget:
    """The shortest way to a first experiment, and a card for each panel."""
    cards = [_card(shell, name) for name in PANELS.names() if name != NAME]
    grid = widgets.Box(cards)
    grid.add_class("rds-cards")
    return widgets.VBox([_first(shell), grid])


def _first(shell: Any) -> widgets.Widget:
    """What somebody who knows nothing of it does first."""

    def begin() -> None:
        from rds.panels.equipment.state import Equipment

        Equipment(shell.session, "control").first_sine()
        shell.open("equipment-control")

    tip = "Choose a first experiment for you; then press Run"
    press = button("Track a sine", tip, begin, shell, primary=True)
    text = widgets.HTML("<p>New here? Let the X axis follow a sine: press this, then Run. The result follows.</p>")
    first = widgets.HBox([press, text])
    first.add_class("rds-first")
    return first


def _card(shell: Any, name: str) -> widgets.VBox:
    module = PANELS.module(name)
    press = button(module.TITLE, module.SUMMARY, lambda: shell.open(name), shell, primary=True)
    card = widgets.VBox([press, widgets.HTML(f"<p>{escape(module.SUMMARY)}</p>")])
    card.add_class("rds-card")
    return card
