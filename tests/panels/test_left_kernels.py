"""When kernels end: a time after their last page has gone, and with the server, even one that is just starting."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from types import SimpleNamespace

import pytest

pytest.importorskip("jupyter_server", reason="Voilà is not installed: it is in the extra lab")

from jupyter_server._tz import utcnow

from tests.panels.conftest import App


def test_a_kernel_ends_a_time_after_its_last_browser_left_and_not_after_its_last_word() -> None:
    from rds.panels.app.kernels import PageKernels  # here, as each worker would spend 2 s as it collects

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

    with ThreadPoolExecutor(1) as thread:  # in this one the browser of other tests has a loop
        assert thread.submit(asyncio.run, life()).result() == [True, True, True, False]


def test_a_server_ends_at_once_though_its_first_kernel_is_just_starting(start_app: Callable[..., App]) -> None:
    app = start_app()
    os.killpg(app.process.pid, signal.SIGTERM)
    assert app.process.wait(60) == 0


@pytest.mark.parametrize("gone", [True, False])
def test_no_message_of_jupyter_s_older_format_is_read_as_one_of_the_newer(
    gone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page that goes just then, or asked for no format, gets the older one. Voilà's reading it does not end."""
    from jupyter_server.services.kernels.connection.base import serialize_binary_message
    from voila.tornado import kernel_websocket_handler

    from rds.panels.app.server import KernelSocket

    def read(message: bytes) -> None:
        raise AssertionError("it would read 10^17 numbers")

    monkeypatch.setattr(kernel_websocket_handler, "read_header_from_binary_message", read)
    sent: list[bytes] = []
    connection = SimpleNamespace(
        is_closing=lambda: False,
        selected_subprotocol=None,
        write_message=lambda message, binary: sent.append(message),
    )
    socket = KernelSocket.__new__(KernelSocket)
    socket.ws_connection = None if gone else connection
    message = serialize_binary_message({"header": {"msg_type": "comm_msg"}, "buffers": [b"samples"]})
    socket.write_message(message, binary=True)
    assert sent == ([] if gone else [message])
