"""The main menu: what there is to do, and the shortest way to a first tracked sine."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import button
from rds.panels.kit.html import Html
from rds.panels.page.first_visit import FirstVisit
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
    """What somebody who knows nothing of it sees and does first: an axis that moves, and three steps from there."""

    def begin() -> None:
        from rds.panels.equipment.state import Equipment

        Equipment(shell.session, "control").first_sine()
        shell.open("equipment-control")

    def write() -> None:
        from rds.panels.equipment.state import Equipment

        Equipment(shell.session, "control").own_controller()  # so that Run runs what is written
        shell.open("equipment-control")
        if shell.on_code is not None:
            shell.on_code()

    def design() -> None:
        shell.open("design")

    steps = (
        (
            "Track a sine",
            "Choose a first experiment for you; then press Run",
            begin,
            "Let the X axis follow it: press Run there.",
        ),
        (
            "Write a controller",
            "An editor with a file that works to begin with",
            write,
            "Yours in its place: change it, and run it.",
        ),
        (
            "Place its poles",
            "The design panel: drag the poles, see the response",
            design,
            "Drag them, and see what a better one does.",
        ),
    )
    rows = []
    for number, (title, tip, act, text) in enumerate(steps):
        press = button(title, tip, act, shell, primary=number == 0)
        line = widgets.HBox([press, Html(f"<p>{text}</p>")])
        line.add_class("rds-first-step")
        rows.append(line)
    first = widgets.HBox([FirstVisit(shell.session, shell.ticker), widgets.VBox(rows)])
    first.add_class("rds-first")
    return first


def _card(shell: Any, name: str) -> widgets.VBox:
    module = PANELS.module(name)
    press = button(module.TITLE, module.SUMMARY, lambda: shell.open(name), shell)
    card = widgets.VBox([press, Html(f"<p>{escape(module.SUMMARY)}</p>")])
    card.add_class("rds-card")
    return card
