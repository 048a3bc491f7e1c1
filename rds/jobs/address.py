"""Where the server of jobs listens, and the secret that its user's programs read from a file."""

from __future__ import annotations

import os
import secrets
import socket
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rds.bus.hub.runtime_folder import LONGEST_PATH, runtime_directory
from rds.core.errors import InputError
from rds.core.private_files import OWN_FILE, open_descriptor

LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class Address:
    """A Unix socket, or a port of this computer's loopback address; and the file of the secret."""

    path: Path | None
    port: int
    secret_file: Path

    @classmethod
    def of(cls, path: Path | None = None, port: int | None = None, secret_file: Path | None = None) -> Address:
        """By default a socket in the user's runtime folder, where the secret is as well. InputError for both."""
        if path is not None and port is not None:
            raise InputError("give a socket or a port, not both")
        if port is not None:
            return cls(None, port, secret_file or runtime_directory() / f"jobs-{port}.secret")
        if not hasattr(socket, "AF_UNIX"):
            raise InputError("this system has no Unix sockets; give --port N, a port of the loopback address")
        path = runtime_directory() / "jobs.sock" if path is None else path.absolute()
        if len(os.fsencode(path)) >= LONGEST_PATH:
            raise InputError(f"is too long for a socket's path (at most {LONGEST_PATH - 1} bytes)", str(path))
        return cls(path, 0, secret_file or path.with_name(f"{path.name}.secret"))

    def listen(self) -> socket.socket:
        """A socket that listens, for its user alone. InputError where another server does, OSError where none can."""
        if self.path is None:
            return socket.create_server((LOOPBACK, self.port), backlog=32)
        self._make_room(self.path)
        listener = socket.socket(socket.AF_UNIX)
        before = os.umask(0o177)
        try:
            listener.bind(os.fspath(self.path))
        except OSError as error:
            listener.close()
            raise OSError(error.errno, error.strerror, str(self.path)) from error
        finally:
            os.umask(before)
        os.chmod(self.path, OWN_FILE)
        listener.listen(32)
        return listener

    def connect(self, timeout: float | None = 10.0) -> socket.socket:
        """A connection to the server. OSError where none answers."""
        if self.path is None:
            return socket.create_connection((LOOPBACK, self.port), timeout)
        sock = socket.socket(socket.AF_UNIX)
        sock.settimeout(timeout)
        try:
            sock.connect(os.fspath(self.path))
        except OSError as error:
            sock.close()
            raise OSError(error.errno, f"no server of jobs answers ({error.strerror})", str(self.path)) from error
        return sock

    def new_secret(self) -> str:
        """A secret in a new file that only its user can read, in place of an earlier one."""
        word = secrets.token_hex(16)
        self.secret_file.unlink(missing_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
        descriptor = open_descriptor(self.secret_file, flags, is_own=True)
        with os.fdopen(descriptor, "w") as file:
            file.write(word + "\n")
        return word

    def leave(self) -> None:
        """Remove socket and secret."""
        for path in (self.path, self.secret_file):
            if path is not None:
                with suppress(OSError):
                    path.unlink()

    def _make_room(self, path: Path) -> None:
        """Remove the socket of a server that was killed."""
        try:
            about = path.lstat()
        except FileNotFoundError:
            return
        if not stat.S_ISSOCK(about.st_mode):
            raise InputError("is there and is no socket; name another path", str(path))
        try:
            self.connect(1.0).close()
        except ConnectionRefusedError:
            path.unlink()
            return
        except OSError:  # it listens, and is too busy to answer
            pass
        raise InputError("another server of jobs listens there; stop it, or give --socket PATH", str(path))
