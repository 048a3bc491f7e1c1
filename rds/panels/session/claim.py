"""One user of the machine at a time: a page that runs something holds a file that other pages can see."""

from __future__ import annotations

import contextlib
import json
import os
import time
from pathlib import Path
from types import TracebackType

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.private_files import open_descriptor

try:
    from fcntl import LOCK_EX, LOCK_NB, LOCK_UN, flock
except ImportError:  # Windows: the built-in bus still finds a second host
    flock = None  # type: ignore[assignment]


class Claim:
    """The right to use a machine from this folder, until `release` or the end of the process, however it ends."""

    def __init__(self, folder: Path, what: str):
        """Take it; InputError that says who has it, or that the folder cannot be written to."""
        self.what = what
        self._note = folder / ".machine.json"
        lock = folder / ".machine.lock"
        try:
            self._descriptor = open_descriptor(lock, os.O_RDWR | os.O_CREAT, is_own=True)
        except OSError as error:
            raise InputError(
                f"cannot be written ({error.strerror}), and what uses the machine writes here; free some space, or "
                "choose a folder that can be written to",
                str(lock),
            ) from error
        try:
            if flock is not None:
                flock(self._descriptor, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            os.close(self._descriptor)
            raise InputError(f"the machine is in use by another page: {holder(folder)}; stop it there first") from None
        with contextlib.suppress(InputError):  # a full disk: others are not told what for
            write_whole(self._note, json.dumps({"what": what, "process": os.getpid(), "since": time.time()}).encode())

    def release(self) -> None:
        """Give it back; a second call does nothing."""
        if self._descriptor < 0:
            return
        with contextlib.suppress(OSError):
            self._note.unlink(missing_ok=True)
        if flock is not None:
            flock(self._descriptor, LOCK_UN)
        os.close(self._descriptor)
        self._descriptor = -1

    def __enter__(self) -> Claim:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.release()


def holder(folder: Path) -> str:
    """What the machine is used for and since when, as far as its user said."""
    try:
        note = json.loads((folder / ".machine.json").read_text())
        since = time.strftime("%H:%M:%S", time.localtime(float(note["since"])))
        return f"{note['what']}, since {since}"
    except (OSError, ValueError, KeyError, TypeError):
        return "something that has just begun"
