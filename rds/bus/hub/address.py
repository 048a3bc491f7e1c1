"""Where the nodes of a channel meet: the user's runtime directory, its sockets and locks.

Nobody but the user may enter the directory (mode 0700, checked) or use the sockets in it (0600), and where the system
tells, each end asks it whose process the other end is. So both are the same user's. Where
there are no Unix sockets (Windows; or RDS_BUS_TRANSPORT=tcp) the hub listens on loopback TCP instead, and a file in
that directory holds its port and a random token.
"""

from __future__ import annotations

import contextlib
import os
import socket
from struct import Struct

from rds.bus.hub.runtime_folder import runtime_directory
from rds.core.channel_name import CHANNEL
from rds.core.private_files import write_private

_SUFFIXES = (".sock", ".tcp")
_CREDENTIALS = Struct("3i")  # process, user, group


class Address:
    """The meeting point of one channel.

    A channel's name is 1 to 32 letters, digits, '.', '_' and '-', and begins with a letter or digit (ValueError).
    """

    def __init__(self, channel: str):
        if not CHANNEL.fullmatch(channel):
            raise ValueError(
                f"channel {channel!r} must be 1 to 32 letters, digits, '.', '_' or '-', the first a letter or digit"
            )
        self.channel = channel
        self.unix = hasattr(socket, "AF_UNIX") and os.environ.get("RDS_BUS_TRANSPORT") != "tcp"
        self.directory = runtime_directory()
        self.path = self.directory / (channel + _SUFFIXES[0 if self.unix else 1])
        self.lock_path = self.directory / f"{channel}.lock"
        self.log_path = self.directory / f"{channel}.log"
        self.error_states_path = self.directory / f"{channel}.states"
        self.token = bytes(32)  # set by listen() and connect() where the transport needs one

    def listen(self) -> socket.socket:
        """A listening socket at this address. Only the holder of the channel's lock may call it."""
        self.path.unlink(missing_ok=True)
        if self.unix:
            server = socket.socket(socket.AF_UNIX)
            server.bind(str(self.path))
            self.path.chmod(0o600)
        else:
            import secrets  # here and below: imports of some ms that a hub's start can do without

            server = socket.create_server(("127.0.0.1", 0))
            self.token = secrets.token_hex(16).encode()
            draft = self.path.with_suffix(".new")
            write_private(draft, b"%d %s" % (server.getsockname()[1], self.token), is_own=True)
            draft.replace(self.path)
        server.listen(128)
        return server

    def connect(self, timeout: float) -> socket.socket:
        """A connection to the hub. ConnectionError or FileNotFoundError if there is no hub."""
        if self.unix:
            client = socket.socket(socket.AF_UNIX)
            target: str | tuple[str, int] = str(self.path)
        else:
            port, self.token = self.path.read_bytes().split()
            client = socket.socket(socket.AF_INET)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            target = ("127.0.0.1", int(port))
        try:
            client.settimeout(timeout)
            client.connect(target)
            if self.unix and (other := foreign_user(client)) is not None:
                raise PermissionError(f"the hub of channel {self.channel!r} is a process of another user ({other})")
        except BaseException:
            client.close()
            raise
        return client

    def lock(self) -> int | None:
        """The descriptor of the channel's lock, or None if somebody else holds it.

        Whoever starts a hub takes it and hands it on; the hub keeps it for life. So there is never a second hub,
        and a hub that was killed leaves nothing to clear away.
        """
        descriptor = os.open(self.lock_path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            lock_file(descriptor)
            if os.fstat(descriptor).st_ino == self.lock_path.stat().st_ino:
                return descriptor  # not one that a hub has just removed at its end
        except OSError:
            pass
        os.close(descriptor)
        return None

    def sign(self, lock: int) -> None:
        """Write this process's id into the lock's file, for whoever wonders who holds it."""
        os.lseek(lock, 0, os.SEEK_SET)
        os.truncate(lock, 0)
        os.write(lock, b"%d\n" % os.getpid())

    def holder(self) -> int | None:
        """The process id of the hub, if it lives or was killed."""
        try:
            return int(self.lock_path.read_text())
        except (OSError, ValueError):
            return None

    def remove(self, with_log: bool = False) -> None:
        """Take the address away, so that nobody connects any more. Only the holder of the lock may."""
        self.path.unlink(missing_ok=True)
        if with_log:
            self.log_path.unlink(missing_ok=True)
        with contextlib.suppress(PermissionError):  # Windows keeps files that are open
            self.lock_path.unlink(missing_ok=True)


def foreign_user(sock: socket.socket) -> int | None:
    """The user at the other end of a Unix socket, if it is not this process's own; None also where nobody can tell."""
    option = getattr(socket, "SO_PEERCRED", None)  # Linux
    if option is None:
        return None
    _, uid, _ = _CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, option, _CREDENTIALS.size))
    return None if uid == os.geteuid() else int(uid)


def lock_file(descriptor: int) -> None:
    """Lock the whole file, or raise OSError at once."""
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def channels() -> list[str]:
    """Names of the channels that have a hub, or had one that was killed."""
    return sorted(path.stem for path in runtime_directory().iterdir() if path.suffix in _SUFFIXES)
