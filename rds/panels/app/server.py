"""Voilà, but for three things: a page that goes away does not end its kernel, as a run may go on in it.

A page can hand in a file of some size, such as a log, where tornado ends the connection beyond 10 MB. And it can ask
the server itself for an emergency stop, and for the end of a kernel that does not answer (`rescue`).
"""

from __future__ import annotations

import asyncio
import shutil
from contextlib import suppress
from typing import Any

from jupyter_core.utils import run_sync
from voila.app import Voila
from voila.shutdown_kernel_handler import VoilaShutdownKernelHandler

from rds.panels.app.rescue import handlers

_LARGEST = 256 << 20  # bytes of a page's message, such as a file that is imported

_ENDING = 10.0  # s that the kernels may take to end


class PanelsServer(Voila):
    """A kernel without a page ends when nothing goes on in it any more (`serve.LEFT`), not at once.

    What it holds until then, such as the machine, another page sees and can stop. A run's record is saved as if
    the page were there.
    """

    name = "voila"  # the user's settings for it

    def init_settings(self) -> dict[str, Any]:
        """As ever, but for the size of a page's message."""
        return {**super().init_settings(), "websocket_max_message_size": _LARGEST}

    def stop(self) -> None:
        """End the kernels. For one that is just starting Jupyter's own has an error, or waits without end: it ends
        with the process that it was forked from.
        """

        async def end() -> None:
            with suppress(Exception):
                await asyncio.wait_for(self.kernel_manager.shutdown_all(), _ENDING)

        run_sync(end)()
        shutil.rmtree(self.connection_dir, ignore_errors=True)

    def init_handlers(self) -> list[Any]:
        """All but the one that a page tells of its going, and before them our own."""
        theirs = [handler for handler in super().init_handlers() if VoilaShutdownKernelHandler not in handler]
        return [*handlers(self.server_url), *theirs]
