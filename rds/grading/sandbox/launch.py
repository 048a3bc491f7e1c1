"""`python -m rds.grading.sandbox.launch SOCKET ORDER FILTER`, three descriptors: becomes bubblewrap.

A process of its own, because what it does to itself on the way (another user, other mounts) cannot be undone.
"""

from __future__ import annotations

import json
import os
import sys

from rds.grading.sandbox.bubblewrap import command
from rds.grading.sandbox.user import become


def main(control: int, order_file: int, filter_file: int) -> None:
    """Become the user that the order names (0: stay who it is), then bubblewrap with `control` as its socket."""
    with os.fdopen(order_file) as file:
        order = json.load(file)
    sources = order["sources"]
    try:
        if order["user"]:
            sources = become(order["user"], sources)
        wrap = command(sources, order["places"], order["hidden"], order["preload"], control, filter_file)
        os.set_inheritable(control, True)
        os.set_inheritable(filter_file, True)
        os.execvpe(wrap[0], wrap, {"PATH": os.environ.get("PATH", "/usr/bin:/bin")})
    except OSError as error:
        sys.exit(f"rds sandbox: {error}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]))
