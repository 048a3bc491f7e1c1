"""A kernel that no browser shows ends; but one that was just given to a page, or whose browser just left, does not."""

from __future__ import annotations

import asyncio
from datetime import timedelta

import pytest

pytest.importorskip("jupyter_server", reason="Voilà is not installed: pip install 'rds[lab]'")

from jupyter_server._tz import utcnow

from rds.panels.app.kernels import PageKernels


def test_a_kernel_ends_a_time_after_its_last_browser_left_and_not_after_its_last_word() -> None:
    def an_hour_later(kernels: PageKernels, kernel: str) -> None:
        kernels.get_kernel(kernel).last_activity = utcnow() - timedelta(hours=1)

    async def life() -> list[bool]:
        kernels = PageKernels(cull_idle_timeout=60, cull_busy=True)
        kernel = await kernels.start_kernel(kernel_name="python3")
        alive = []
        try:
            for change in ("given", "connected", "left", "an hour"):
                an_hour_later(kernels, kernel)
                if change == "connected":
                    kernels.notify_connect(kernel)
                elif change == "left":
                    kernels.notify_disconnect(kernel)
                await kernels.cull_kernel_if_idle(kernel)
                alive.append(kernel in kernels)
        finally:
            await kernels.shutdown_all(now=True)
        return alive

    assert asyncio.run(life()) == [True, True, True, False]
