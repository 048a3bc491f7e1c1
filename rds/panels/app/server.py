"""Voilà, but for two things: a page that goes away does not end its kernel, as a run may go on in it.

And a page can ask the server itself for an emergency stop, and for the end of a kernel that does not answer (`rescue`).
"""

from __future__ import annotations

from typing import Any

from voila.app import Voila
from voila.shutdown_kernel_handler import VoilaShutdownKernelHandler

from rds.panels.app.rescue import handlers


class PanelsServer(Voila):
    """A kernel without a page ends when nothing goes on in it any more (`serve.LEFT`), not at once.

    What it holds until then, such as the machine, another page sees and can stop. A run's record is saved as if
    the page were there.
    """

    name = "voila"  # the user's settings for it

    def init_handlers(self) -> list[Any]:
        """All but the one that a page tells of its going, and before them our own."""
        theirs = [handler for handler in super().init_handlers() if VoilaShutdownKernelHandler not in handler]
        return [*handlers(self.server_url), *theirs]
