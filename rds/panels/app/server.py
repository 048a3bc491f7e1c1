"""Voilà, but for some things: a page that goes away does not end its kernel, as a run may go on in it.

A page can hand in a file of some size, such as a log, where tornado ends the connection beyond 10 MB. It can ask
the server itself for an emergency stop, and for the end of a kernel that does not answer (`rescue`). And nobody but its
user gets at it, on a computer that others use as well: see the methods.
"""

from __future__ import annotations

import asyncio
import shutil
import threading
import webbrowser
from contextlib import suppress
from html import escape
from pathlib import Path
from typing import Any

from jupyter_core.paths import jupyter_config_path
from jupyter_core.utils import run_sync
from jupyter_server.base.handlers import APIHandler
from tornado import web
from tornado.httputil import HTTPServerRequest
from tornado.routing import Matcher, Rule
from traitlets import default
from voila.app import Voila
from voila.request_info_handler import RequestInfoSocketHandler
from voila.shutdown_kernel_handler import VoilaShutdownKernelHandler
from voila.tornado.kernel_websocket_handler import VoilaKernelWebsocketHandler, WebsocketHandler

from rds.core.private_files import write_private
from rds.panels.app.rescue import handlers

_LARGEST = 256 << 20  # bytes of a page's message, such as a file that is imported

_ENDING = 10.0  # s that the kernels may take to end

_HOSTS = ("127.0.0.1", "localhost", "[::1]", "::1")  # of any port: one may have been forwarded by ssh
_NOT_THEIRS = (RequestInfoSocketHandler,)  # tells a page's address to anybody
_OPEN = """<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer"><title>RDS</title>
<meta http-equiv="refresh" content="0;url={0}"><p><a href="{0}">To the page of RDS</a></p>
"""


class PanelsServer(Voila):
    """A kernel without a page ends when nothing goes on in it any more (`serve.LEFT`), not at once.

    What it holds until then, such as the machine, another page sees and can stop. A run's record is saved as if
    the page were there.
    """

    name = "voila"  # the user's settings for it

    @default("config_file_paths")
    def _own_settings(self) -> list[str]:
        """Those of the user and the computer; one in the folder would let whoever wrote it into the server."""
        return list(jupyter_config_path())

    def init_settings(self) -> dict[str, Any]:
        """As ever, but for the size of a page's message, and cookies that no other page's requests carry."""
        settings = super().init_settings()
        self.identity_provider.cookie_options = {"samesite": "Strict", **self.identity_provider.cookie_options}
        xsrf = {"path": self.base_url, "samesite": "Strict"}
        return {**settings, "websocket_max_message_size": _LARGEST, "xsrf_cookie_kwargs": xsrf}

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
        """What answers: first of all a refusal of other hosts, then our own, then Voilà's but for _NOT_THEIRS."""
        root = self.server_url.rstrip("/")
        theirs = [
            # that of the login is not under the server's address
            (path if path.startswith(f"{root}/") else root + path, _IN_PLACE.get(kind, kind), *rest)
            for path, kind, *rest in super().init_handlers()
            if kind not in _NOT_THEIRS
        ]
        return [Rule(_ForeignHost(), _Refused), *handlers(self.server_url), *theirs]

    def launch_browser(self) -> None:
        """Open the page by a file that only this user can read: all users see what a browser is started with."""
        file = Path(self.connection_dir) / "open.html"
        write_private(file, _OPEN.format(escape(self.display_url)).encode(), is_own=True)
        try:
            browser = webbrowser.get(self.browser or None)
        except webbrowser.Error:
            self.log.warning("There is no browser to be found; open the address above in one.")
            return
        threading.Thread(target=browser.open, args=(file.as_uri(), self.webbrowser_open_new), daemon=True).start()


class KernelSocket(VoilaKernelWebsocketHandler):
    """Takes a kernel's messages to a page. Voilà's own reads each in the newer of Jupyter's two formats; but a page
    that asked for none gets the older one, and so does one that goes at that moment. Read as the newer, a message of
    the older one with binary parts is a list of 10^17 numbers: the server answers nobody more, and fills the memory.
    """

    def write_message(self, message: bytes | str | dict[str, Any], binary: bool = False) -> Any:
        """Send it; to a page that has gone, nothing."""
        if self.ws_connection is None or self.ws_connection.is_closing():
            return None
        if isinstance(message, bytes) and not self.selected_subprotocol:
            return WebsocketHandler.write_message(self, message, binary)
        return super().write_message(message, binary)


class KernelStays(APIHandler):
    """A page that goes asks for the end of its kernel, which comes later (see `PanelsServer`): that is no fault."""

    @web.authenticated
    async def post(self, kernel_id: str) -> None:
        """Answer that it was heard."""
        self.set_status(204)
        self.finish()


_IN_PLACE = {VoilaKernelWebsocketHandler: KernelSocket, VoilaShutdownKernelHandler: KernelStays}  # of Voilà's


class _ForeignHost(Matcher):
    """A request of a browser that took this computer for another host, whose pages could then read ours."""

    def match(self, request: HTTPServerRequest) -> dict[str, Any] | None:
        return None if request.host_name in _HOSTS else {}


class _Refused(web.RequestHandler):
    """No, whatever is asked."""

    def prepare(self) -> None:
        self.set_status(403)
        self.finish("This page answers at 127.0.0.1 and localhost only: open the address that rds app has printed.\n")
