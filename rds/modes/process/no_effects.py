"""A process that only computes: what would be seen outside of it is refused, and noted."""

from __future__ import annotations

import os
import sys
from typing import Any

_EFFECTS = {
    "subprocess": "Popen",
    "os": "system fork forkpty exec posix_spawn spawn startfile kill killpg remove rename mkdir rmdir truncate link "
    "symlink chmod chown utime putenv unsetenv setxattr removexattr",
    "socket": "connect bind sendto sendmsg",
    "shutil": "rmtree move copyfile copytree make_archive",
    "signal": "pthread_kill",
    "webbrowser": "open",
    "_thread": "start_new_thread start_joinable_thread",
}
_FORBIDDEN = frozenset(f"{module}.{name}" for module, names in _EFFECTS.items() for name in names.split())
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def forbid_effects() -> list[str]:
    """From here on, refuse what has an effect outside this process; the list fills with what was refused.

    It holds for the rest of the process, and for Python code: it keeps work from being done twice and is no sandbox.
    """
    refused: list[str] = []
    sys.dont_write_bytecode = True

    def look(event: str, arguments: tuple[Any, ...]) -> None:
        is_write = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & _WRITING)
        if is_write or event in _FORBIDDEN:
            refused.append(event)
            raise PermissionError(f"{event} is not done a second time")

    sys.addaudithook(look)
    return refused
