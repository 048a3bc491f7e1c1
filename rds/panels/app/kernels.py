"""The server's kernels: one that no browser shows ends after a time (`serve.LEFT`), counted from when the last left.

Server and kernel speak by Unix sockets in a folder that only this user may enter. Jupyter's TCP ports are open to every
user of the computer, and who connects to one of them is sent all that the page shows, without a password.
"""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

from jupyter_server._tz import utcnow
from jupyter_server.services.kernels.kernelmanager import AsyncMappingKernelManager, ServerKernelManager
from traitlets import default


class PageKernel(ServerKernelManager):
    """The server's end of one kernel."""

    @default("transport")
    def _default_transport(self) -> str:
        return "ipc" if hasattr(socket, "AF_UNIX") else "tcp"  # Windows has none that pyzmq could use

    @default("ip")
    def _default_ip(self) -> str:
        """How the names of its sockets begin: short, because the path of a Unix socket has 103 bytes at most."""
        if self.transport != "ipc":
            return "127.0.0.1"
        file = Path(self.connection_file)
        return str(file.parent / file.stem.removeprefix("kernel-")[:8])


class PageKernels(AsyncMappingKernelManager):
    """Jupyter counts from a kernel's last word, however long ago: a page's connection that breaks for a moment, or a
    page that was just given the kernel that had been waiting for it and is not connected yet, would lose it.
    """

    @default("kernel_manager_class")
    def _own_kind(self) -> str:
        return f"{__name__}.{PageKernel.__name__}"

    def __init__(self, **traits: Any):
        super().__init__(**traits)
        self._given: set[str] = set()  # the kernels that were seen to be a page's

    async def cull_kernel_if_idle(self, kernel_id: str) -> None:
        """Voilà asks this now and then for each kernel but those that wait for a page."""
        if kernel_id not in self._given:
            self._given = {*self._given.intersection(self._kernels), kernel_id}
            self._count_anew(kernel_id)
        await super().cull_kernel_if_idle(kernel_id)

    def notify_disconnect(self, kernel_id: str) -> None:
        """A browser has left."""
        super().notify_disconnect(kernel_id)
        self._count_anew(kernel_id)

    def _count_anew(self, kernel_id: str) -> None:
        kernel: Any = self._kernels.get(kernel_id)
        if kernel is not None:
            kernel.last_activity = utcnow()
