"""A real server process, and clients of plain sockets."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CIRCLE = "G21 G90 G17 G61\nF600\nG3 X0 Y0 I-{radius} J0\nM2\n"


class Client:
    """Says the secret unless it is None; `ask(do=..., ...)` gives the answer."""

    def __init__(self, place: Path | int, secret: str | None):
        if isinstance(place, int):
            self.sock = socket.create_connection(("127.0.0.1", place), 60.0)
        else:
            self.sock = socket.socket(socket.AF_UNIX)
            self.sock.settimeout(60.0)
            self.sock.connect(str(place))
        self.lines = self.sock.makefile("rb")
        if secret is not None:
            assert self.ask(secret=secret)["ok"]

    def ask(self, **request: Any) -> dict[str, Any]:
        self.sock.sendall(json.dumps(request).encode() + b"\n")
        return self.read()

    def read(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.lines.readline())
        return found

    def ended(self) -> bool:
        """Whether the server has ended the connection."""
        try:
            return self.lines.read(1) == b""
        except ConnectionResetError:
            return True

    def until_over(self, job: int) -> dict[str, Any]:
        told = self.ask(do="watch", job=job, period=0.05)
        while told["state"] != "over":
            told = self.read()
        return told

    def until(self, job: int, **wanted: Any) -> dict[str, Any]:
        """The first status that says all of `wanted`."""
        while True:
            told = self.ask(do="status", job=job)
            assert told["state"] != "over", told
            if wanted.items() <= told.items():
                return told
            time.sleep(0.02)  # else both would use their processors, which the run needs

    def close(self) -> None:
        self.lines.close()
        self.sock.close()


class Server:
    """`rds jobs serve` on a folder of its own."""

    def __init__(self, folder: Path, *options: str, port: int | None = None):
        self.folder, self.port = folder, port
        folder.mkdir(exist_ok=True)
        self.socket = folder.parent / "s"
        self.secret_file = folder.parent / "s.secret"
        place = ["--port", str(port)] if port else ["--socket", str(self.socket)]
        secret = [] if "--no-secret" in options else ["--secret", str(self.secret_file)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rds", "jobs", "serve", *place, *secret, *options, str(folder)],
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
        )
        assert self.process.stderr is not None
        self.said = self.process.stderr.readline()
        assert "Ctrl-C ends" in self.said, self.said + self.process.stderr.read()
        self.clients: list[Client] = []

    def client(self, with_secret: bool = True) -> Client:
        secret = self.secret_file.read_text().strip() if with_secret else None
        self.clients.append(Client(self.port or self.socket, secret))
        return self.clients[-1]

    def end(self) -> None:
        for client in self.clients:
            client.close()
        self.process.terminate()
        assert self.process.stderr is not None
        self.process.wait(60.0)
        self.process.stderr.close()


@pytest.fixture
def serve(alone: Path) -> Iterator[Callable[..., Server]]:
    made: list[Server] = []

    def start(*options: str, port: int | None = None) -> Server:
        made.append(Server(alone / "parts", *options, port=port))
        (made[-1].folder / "circle.ngc").write_text(CIRCLE.format(radius=20))
        (made[-1].folder / "small.ngc").write_text(CIRCLE.format(radius=2))
        return made[-1]

    yield start
    for server in made:
        server.end()
