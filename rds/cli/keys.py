"""Single keys from a terminal, without waiting for them."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Iterator


class Keys:
    """Keys that have been pressed. Only within `keyboard()`."""

    def __init__(self, descriptor: int):
        self._descriptor = descriptor

    def pressed(self, wait: float) -> str:
        """What was pressed, in order, within `wait` s; "" if nothing was."""
        ready, _, _ = select.select([self._descriptor], [], [], wait)
        return os.read(self._descriptor, 64).decode("utf-8", "replace") if ready else ""


@contextlib.contextmanager
def keyboard() -> Iterator[Keys | None]:
    """Keys as they are pressed, if stdin is a terminal that can give them; else None."""
    try:
        import termios
        import tty

        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor) if os.isatty(descriptor) else None
    except (ImportError, OSError, ValueError):
        before = None
    if before is None:
        yield None
        return
    try:
        tty.setcbreak(descriptor)  # Ctrl-C still interrupts
        yield Keys(descriptor)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
