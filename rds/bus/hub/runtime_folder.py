"""The folder where a user's processes meet: sockets, locks and logs of the buses. Nobody else may enter it.

Usually it is XDG_RUNTIME_DIR/rds, which the system keeps for the user, else rds-UID in the temporary folder. There,
another user of the computer may have put something of that name first. Then it is a folder in the user's home, and
stays that: all processes of a user must find the same one, or an emergency stop would not reach the machine, also if
the other name becomes free meanwhile. So the folder in the home goes before the one in the temporary folder as soon as
it is there, and a lock in the home lets one process at a time decide where none of them is.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from rds.core.errors import Notice
from rds.core.private_files import OWN_FOLDER, open_descriptor, state_folder

LONGEST_PATH = 104  # bytes of a Unix socket's path: 108 on Linux, 104 on macOS, with the final zero


def runtime_directory() -> Path:
    """The user's own folder for sockets, made if it is missing. A Notice is given when it moves to the user's home.

    PermissionError if no folder can be had that only the user can enter; OSError if its path leaves no room for a
    socket's name.
    """
    directory = _chosen()
    if len(os.fsencode(directory)) + 1 + 32 + 5 >= LONGEST_PATH:
        raise OSError(f"the path {directory} is too long for a socket in it; set XDG_RUNTIME_DIR to a shorter one")
    return directory


def _chosen() -> Path:
    base = os.environ.get("XDG_RUNTIME_DIR", "")
    if base and len(base) < 60 and _is_users_alone(base):
        return _require_private(Path(base, "rds"))
    import tempfile  # an import of some ms that most do without

    usual = Path(tempfile.gettempdir(), f"rds-{os.getuid() if hasattr(os, 'getuid') else 0}")
    if not hasattr(os, "getuid"):  # Windows, where each user has a temporary folder of his own
        usual.mkdir(exist_ok=True)
        return usual
    own = _in_home()
    if _is_users(own):
        return _require_private(own)
    if _is_users(usual) and _taken(usual) is None:
        return _require_private(usual)
    with _one_at_a_time(own):
        if _is_users(own):
            return _require_private(own)
        with contextlib.suppress(FileExistsError):
            usual.mkdir(OWN_FOLDER)
        taken = _taken(usual)
        return _require_private(usual) if taken is None else _move(usual, taken, own)


def _is_users_alone(base: str) -> bool:
    """Whether nobody else can put a folder there. After `su` the variable may still name that of another user."""
    if not os.path.isdir(base):
        return False
    about = os.stat(base)
    return not hasattr(os, "getuid") or (about.st_uid == os.getuid() and not about.st_mode & 0o022)


def _is_users(directory: Path) -> bool:
    """Whether it is there, and is the user's: after `su` a home may be that of another one."""
    try:
        about = directory.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(about.st_mode) and about.st_uid == os.getuid()


def _in_home() -> Path:
    """The folder to fall back to; another one for each computer, because many may have the same home."""
    from binascii import crc32

    return state_folder() / f"run-{crc32(os.uname().nodename.encode()):08x}"  # short: see LONGEST_PATH


def _taken(directory: Path) -> str | None:
    """Why it is not the user's own folder, as the end of a sentence; None if it is."""
    try:
        about, above = directory.lstat(), directory.parent.stat()
    except FileNotFoundError:
        return "was another user's until this moment"
    if about.st_uid != os.getuid():
        return f"belongs to another user (number {about.st_uid})"
    if not stat.S_ISDIR(about.st_mode):
        return "is no folder, and rds did not put it there"
    if above.st_uid not in (0, os.getuid()) or (above.st_mode & 0o022 and not above.st_mode & stat.S_ISVTX):
        return f"can be replaced by others, who may rename what is in {directory.parent}"
    return None


def _require_private(directory: Path) -> Path:
    """The same, made if it is missing; PermissionError if somebody else could have put something there."""
    directory.mkdir(OWN_FOLDER, exist_ok=True)
    about = directory.lstat()
    if hasattr(os, "getuid") and (
        not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077
    ):
        raise PermissionError(
            f"{directory} must be a directory that only you can enter (mode 0700); remove it or set XDG_RUNTIME_DIR"
        )
    return directory


def _move(usual: Path, taken: str, own: Path) -> Path:
    """The folder in the home, instead of the one that is taken."""
    import warnings

    try:
        own.mkdir(OWN_FOLDER)
        _require_private(own)
    except OSError as error:
        raise PermissionError(
            f"{usual} {taken}, and {own} cannot be had instead ({error.strerror or error}); set XDG_RUNTIME_DIR to a "
            "folder that only you can enter (mode 0700)"
        ) from error
    warnings.warn(
        f"{usual} {taken}; your programs meet in {own} from now on. Tell the administrator of this computer who took "
        "the name",
        Notice,
        stacklevel=4,
    )
    return own


@contextlib.contextmanager
def _one_at_a_time(own: Path) -> Iterator[None]:
    """For one process of the user after the other; without a lock where the home cannot hold one."""
    descriptor = -1
    with contextlib.suppress(ImportError, OSError):
        import fcntl

        own.parent.mkdir(OWN_FOLDER, parents=True, exist_ok=True)
        descriptor = open_descriptor(own.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, is_own=True)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if descriptor >= 0:
            os.close(descriptor)
