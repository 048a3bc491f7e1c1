"""Help: the documentation beside the panels, opened at the page of the panel one comes from, with its search."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import watch
from rds.panels.kit.html import Html
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.results.serve import OWN_SCRIPT, FolderServer, server_of

NAME = "help"
TITLE = "Help"
SUMMARY = "The documentation, with a search"
HELP = "readme"


class Guide:
    """The page in sight; `show(subject)` turns to another."""

    def __init__(self, shell: Any):
        self.shell = shell
        self._subject = "readme"
        self.notice = Notice()
        self.bar = WorkBar(shell.ticker)
        self.frame = Html()
        self.frame.add_class("rds-guide")
        self.widget = widgets.VBox([self.notice, self.bar, self.frame])
        self._ready = False
        shell.on_help = self.show

    def show(self, subject: str) -> None:
        """Turn to the page on `subject`; the first time the pages may have to be built, which takes some seconds."""
        self._subject = subject
        if self._ready:
            self._turn()
        elif not self.bar.busy:
            task = self.shell.session.work("making the help", lambda task: help_server(task.pulse))
            task.note = "making the pages, once"
            watch(self.bar, self.notice, task, self._built)

    def _built(self, _: Any) -> None:
        self._ready = True
        self._turn()

    def _turn(self) -> None:
        from rds.panels.help.build import page_file

        address = escape(f"{help_server().url(page_file(self._subject))}?colours={self.shell.colours.name}")
        self.frame.value = ""  # anew even where the page is the same: its reader may have gone on from there
        self.frame.value = (
            f'<a href="{address}" target="_blank" rel="noopener">open in a page of its own</a>'
            f'<iframe src="{address}" title="Help"></iframe>'
        )


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    guide = Guide(shell)
    guide.show(shell.help_page)
    return guide.widget


def help_server(pulse: Callable[[], None] = lambda: None) -> FolderServer:
    """The one server of this process; builds the pages where that is still to do (some seconds; see `help_pages`)."""
    from rds.panels.help.build import help_pages

    return server_of(help_pages(pulse=pulse), OWN_SCRIPT)
