"""Python's collection of garbage in programs of our own.

Imports leave hardly any garbage, but Python looks for it after every 700 objects that stay, and once more in all of
them when a program ends: together a tenth to a fifth of what a short program takes.
"""

from __future__ import annotations

import gc
import sys
from typing import NoReturn

_OBJECTS = 10_000  # more of them are won by nothing, and a student's arrays may be in what is not collected yet


def collect_rarely() -> None:
    """From now on look for garbage after 10,000 new objects. Only a program that owns its interpreter may call it."""
    gc.set_threshold(_OBJECTS)


def leave(code: int) -> NoReturn:
    """End a program that runs no student's code, whose open files in a cycle of objects Python would still write."""
    gc.freeze()
    sys.exit(code)
