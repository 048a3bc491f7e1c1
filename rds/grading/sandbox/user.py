"""A root caller's unprivileged user, and the launcher that becomes it.

The limits on processes do not hold for root, so bubblewrap is started as a user that nobody else is. That user may not
be able to reach the interpreter (a folder of root's home, say): the launcher first binds what the sandbox will see
to a place that everyone can reach, in a mount namespace that ends with it.
"""

from __future__ import annotations

import os
import pwd
from collections.abc import Sequence
from pathlib import Path

_FIRST, _COUNT = 0x6F000000, 0x10000  # far from any system's ranges for people, services and containers
_PLACE = "/tmp"


def sandbox_user() -> int:
    """Whom to become: nobody else if the caller is root, 0 for the caller itself if it is not."""
    return unused_user() if os.geteuid() == 0 else 0


def unused_user() -> int:
    """The number of a user that has no name and no process."""
    taken = {entry.pw_uid for entry in pwd.getpwall()}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            taken.add(process.stat().st_uid)
        except OSError:
            continue  # it has just ended
    start = os.getpid() % _COUNT
    return next(number for step in range(_COUNT) if (number := _FIRST + (start + step * 257) % _COUNT) not in taken)


def become(user: int, sources: Sequence[str]) -> list[str]:
    """In a process of its own, as root: make `sources` reachable, become `user`; where each source is now.

    OSError if the kernel refuses.
    """
    from rds.grading.sandbox.inside import kernel

    kernel.unshare(kernel.CLONE_NEWNS)
    kernel.mount("none", "/", None, kernel.MS_REC | kernel.MS_PRIVATE)
    opened = [os.open(source, os.O_PATH) for source in sources]
    kernel.mount("tmpfs", _PLACE, "tmpfs", kernel.MS_NOSUID | kernel.MS_NODEV, "size=65536,mode=755")
    places = []
    for number, fd in enumerate(opened):
        place = Path(_PLACE) / str(number)
        if Path(f"/proc/self/fd/{fd}").is_dir():
            place.mkdir()
        else:
            place.touch()
        kernel.mount(f"/proc/self/fd/{fd}", str(place), None, kernel.MS_BIND | kernel.MS_REC)
        os.close(fd)
        places.append(str(place))
    os.chdir("/")
    os.setgroups([])
    os.setresgid(user, user, user)
    os.setresuid(user, user, user)
    return places
