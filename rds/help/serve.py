"""The help pages for a browser of this computer."""

from __future__ import annotations

from collections.abc import Callable

from rds.results.serve import FolderServer, server_of


def help_server(pulse: Callable[[], None] = lambda: None) -> FolderServer:
    """The one server of this process; builds the pages where that is still to do (some seconds; see `help_pages`)."""
    from rds.help.build import help_pages

    return server_of(help_pages(pulse=pulse))
