"""The help pages for a browser of this computer."""

from __future__ import annotations

from rds.results.serve import FolderServer, server_of


def help_server() -> FolderServer:
    """The one server of this process; builds the pages where that is still to do (some seconds)."""
    from rds.help.build import help_pages

    return server_of(help_pages())
