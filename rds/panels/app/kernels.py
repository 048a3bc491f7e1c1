"""The server's kernels: one that no browser shows ends after a time (`serve.LEFT`), counted from when the last left."""

from __future__ import annotations

from typing import Any

from jupyter_server._tz import utcnow
from jupyter_server.services.kernels.kernelmanager import AsyncMappingKernelManager


class PageKernels(AsyncMappingKernelManager):
    """Jupyter counts from a kernel's last word, however long ago: a page's connection that breaks for a moment, or a
    page that was just given the kernel that had been waiting for it and is not connected yet, would lose it.
    """

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
