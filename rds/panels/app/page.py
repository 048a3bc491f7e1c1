"""What the page's only cell shows."""

from __future__ import annotations

import os
from typing import Any

FOLDER, MACHINE, PANEL = "RDS_APP_FOLDER", "RDS_APP_MACHINE", "RDS_APP_PANEL"


def show() -> Any:
    """The panels on the folder and machine that `rds app` was given."""
    import ipywidgets

    from rds.panels import main

    ipywidgets.register_comm_target()  # it does so itself only where it is imported by a kernel that runs already
    folder = os.environ.get(FOLDER, ".")
    os.chdir(folder)
    return main(folder, os.environ.get(MACHINE, "mini-cnc"), os.environ.get(PANEL, "menu"))
