"""Whether a sandbox that holds can be had on this computer."""

from __future__ import annotations

import shutil
import sys
from functools import lru_cache


def available() -> str | None:
    """None if it holds here; else a sentence that says what is missing, with the command that installs it."""
    return _fault()


@lru_cache
def _fault() -> str | None:
    if sys.platform != "linux":
        return (
            f"the sandbox needs Linux's namespaces, and this is {sys.platform}; grade on Linux, or in a virtual machine"
        )
    if shutil.which("bwrap") is None:
        return (
            "bubblewrap is missing, and submissions are run in nothing else; install it, as in "
            "`sudo apt install bubblewrap` or `sudo dnf install bubblewrap`"
        )
    try:
        import pyseccomp  # noqa: F401
    except (ImportError, RuntimeError, OSError):
        return (
            "pyseccomp or libseccomp is missing; install them, as in `pip install 'rds[grading]'` and "
            "`sudo apt install libseccomp2`"
        )
    return None
