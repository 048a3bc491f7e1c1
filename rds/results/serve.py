"""Files for a browser of this computer: read only, on the loopback address, under a path that nobody guesses.

Other users of the computer reach the address as well, and so does a page of any site that the browser shows. So a
request must have the path, must be meant for this computer's own names, and if a script makes it, it must be one of
these pages'. The folder may be somebody else's: nothing outside of it is served, whatever links it holds.
"""

from __future__ import annotations

import os
import secrets
import stat
import threading
from functools import cache
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote

NO_SCRIPT = "default-src 'none'; img-src 'self' data:; style-src 'self' 'unsafe-inline'"  # for what anybody wrote
OWN_SCRIPT = "default-src 'self' data:; style-src 'self' 'unsafe-inline'; script-src 'self' 'unsafe-inline'"
_HOSTS = ("127.0.0.1", "localhost")
_PATIENCE = 30  # s for a connection that asks for nothing
_NOWHERE = os.devnull + "/-"  # a path where nothing is


class FolderServer:
    """Serves one folder until the process ends; `url(page)` is the address of a page in it.

    `policy` is the Content-Security-Policy of its pages: by default they run no script and load nothing from elsewhere.
    """

    def __init__(self, folder: Path, policy: str = NO_SCRIPT):
        self._secret = secrets.token_urlsafe(12)
        secret, root = self._secret.encode(), Path(os.path.realpath(folder))

        class Pages(SimpleHTTPRequestHandler):
            """What lies in the folder, and nothing without the secret."""

            timeout = _PATIENCE

            def __init__(self, *args: Any):
                super().__init__(*args, directory=str(root))

            def send_head(self) -> Any:
                host = self.headers.get_all("Host", [])
                if len(host) != 1 or host[0].rpartition(":")[0] not in _HOSTS:
                    return self.send_error(403, "This is not the host that you asked for")
                if self.headers.get("Origin", f"http://{host[0]}") != f"http://{host[0]}":
                    return self.send_error(403, "Pages of other sites get nothing here")
                return super().send_head()

            def translate_path(self, path: str) -> str:
                begin, _, rest = path.lstrip("/").partition("/")
                known = secrets.compare_digest(begin.encode(), secret)
                return _within(root, super().translate_path("/" + rest)) if known else _NOWHERE

            def list_directory(self, path: Any) -> None:
                self.send_error(404)

            def end_headers(self) -> None:
                self.send_header("Content-Security-Policy", policy)
                self.send_header("X-Content-Type-Options", "nosniff")
                self.send_header("Referrer-Policy", "no-referrer")  # the address holds the secret
                super().end_headers()

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


def _within(root: Path, path: str) -> str:
    """The file that is meant, its links followed; _NOWHERE for all but files in `root`, so for folders and pipes."""
    try:
        real = Path(os.path.realpath(path))
        served = real.is_relative_to(root) and stat.S_ISREG(real.lstat().st_mode)
    except (OSError, ValueError):  # it is not there, or its name has a zero in it
        served = False
    return str(real) if served else _NOWHERE


@cache
def server_of(folder: Path, policy: str = NO_SCRIPT) -> FolderServer:
    """The one server of this process for `folder`."""
    return FolderServer(folder, policy)
