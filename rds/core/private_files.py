"""Files and folders that nobody but their user can read, whatever the umask.

On a computer that many people use, a file is often made readable for all of them (umask 022), or even writable for a
group. Every file that rds makes is 0600, in folders that are 0700 where rds makes them; a folder that is there
already keeps its mode. Files are written by `open_private`, folders made by `make_folder`; the processes of rds call
`keep_process_private` at their start, for what a library writes by itself. A notebook's process keeps its umask.

With `rds ... --shared`, or RDS_SHARED=1 in the environment, the group may read: 0640 in folders of 0750. It may not
write: whoever can write into the folder of a run can have his own code run there by its user. What drives a machine
(shared memory, sockets, locks) stays the user's own in any case.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path
from typing import IO, Any

from rds.core.errors import InputError

SHARED = "RDS_SHARED"  # in the environment, so that the processes of a run know it, too
OWN_FILE, OWN_FOLDER = 0o600, 0o700
_GROUP_FILE, _GROUP_FOLDER = 0o640, 0o750


def is_shared() -> bool:
    """Whether the group may read what is written. InputError where RDS_SHARED is neither 0 nor 1."""
    said = os.environ.get(SHARED, "")
    if said not in ("", "0", "1"):
        raise InputError(f"{SHARED} = {said!r} in the environment must be 1 (the group may read results) or 0")
    return said == "1"


def share() -> None:
    """From now on the group may read what this process and those that it starts write."""
    os.environ[SHARED] = "1"


def keep_process_private() -> None:
    """Set the umask of this process, which must be one of rds, so that libraries' files are private as well."""
    os.umask(umask())


def umask() -> int:
    """Of the processes of rds, and of those of other programs that write for it."""
    return 0o777 - _folder_mode()


def open_private(path: str | Path, mode: str, is_own: bool = False, **how: Any) -> IO[Any]:
    """Open a file for writing as `open` does, private to its user; with `is_own` also where results are shared.

    A file that is there and belongs to the user is made private as well, before anything is written into it.
    """
    wanted = OWN_FILE if is_own else _file_mode()
    return open(path, mode, opener=lambda name, flags: _opened(name, flags, wanted), **how)


def open_descriptor(path: str | Path, flags: int, is_own: bool = False) -> int:
    """The same by `os.open` and its flags, O_CREAT among them."""
    return _opened(os.fspath(path), flags | getattr(os, "O_CLOEXEC", 0), OWN_FILE if is_own else _file_mode())


def write_private(path: str | Path, data: bytes, is_own: bool = False) -> None:
    """Write a small file in place."""
    with open_private(path, "wb", is_own) as file:
        file.write(data)


def state_folder() -> Path:
    """Where rds keeps what lasts from one run to the next, in the user's home; it need not be there yet."""
    state = os.environ.get("XDG_STATE_HOME", "")
    base = Path(state) if os.path.isabs(state) else Path(os.path.expanduser("~"), ".local", "state")
    return base / "rds"


def make_folder(path: str | Path) -> None:
    """Make a folder, and those above it that are not there, each private. OSError where that cannot be.

    A folder that is there keeps its mode. A new one keeps the group that the folder above hands down (setgid).
    """
    path = Path(path)
    try:
        path.mkdir(_folder_mode())
    except FileNotFoundError:
        if path.parent.is_dir():  # nothing can be made there, as in /proc
            raise
        make_folder(path.parent)
        make_folder(path)
    except OSError:
        if not path.is_dir():
            raise
    else:
        _set_mode(path, path.stat().st_mode, _folder_mode())


def _file_mode() -> int:
    return _GROUP_FILE if is_shared() else OWN_FILE


def _folder_mode() -> int:
    return _GROUP_FOLDER if is_shared() else OWN_FOLDER


def _opened(name: str, flags: int, mode: int) -> int:
    descriptor = os.open(name, flags, mode)
    about = os.fstat(descriptor)
    # a device or a pipe is not ours to close to others, nor is somebody else's file
    if hasattr(os, "geteuid") and stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid():
        _set_mode(descriptor, about.st_mode, mode)
    return descriptor


def _set_mode(place: int | Path, now: int, wanted: int) -> None:
    """Exactly these permissions: the umask may have taken some away, or the file is an older one."""
    if stat.S_IMODE(now) & 0o777 != wanted:
        with contextlib.suppress(OSError):  # a disk without modes, as FAT; its mount says who can read it
            os.chmod(place, wanted | (now & stat.S_ISGID))
