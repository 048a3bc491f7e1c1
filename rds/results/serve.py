"""Files for a browser of this computer: read only, on the loopback address, under a path that nobody guesses."""

from __future__ import annotations

import secrets
import threading
from functools import cache
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote


class FolderServer:
    """Serves one folder until the process ends; `url(page)` is the address of a page in it."""

    def __init__(self, folder: Path):
        self._secret = secrets.token_urlsafe(12)
        secret = self._secret

        class Pages(SimpleHTTPRequestHandler):
            """What lies in the folder, and nothing without the secret."""

            def __init__(self, *args: Any):
                super().__init__(*args, directory=str(folder))

            def translate_path(self, path: str) -> str:
                begin, _, rest = path.lstrip("/").partition("/")
                return super().translate_path("/" + rest if begin == secret else "/-")

            def list_directory(self, path: Any) -> None:
                self.send_error(404)

            def log_message(self, format: str, *args: Any) -> None:
                """Nobody reads it."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Pages)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, name=f"rds pages of {folder}", daemon=True).start()

    def url(self, page: str) -> str:
        """Where the browser finds a page, such as "experiments.html" or "first/report.html"."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/{self._secret}/{quote(page)}"

    def close(self) -> None:
        """Serve no more."""
        self._server.shutdown()
        self._server.server_close()


@cache
def server_of(folder: Path) -> FolderServer:
    """The one server of this process for `folder`."""
    return FolderServer(folder)
