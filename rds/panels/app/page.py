"""What the page's only cell shows."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

FOLDER, MACHINE, PANEL = "RDS_APP_FOLDER", "RDS_APP_MACHINE", "RDS_APP_PANEL"
BUS = "RDS_APP_BUS"  # as JSON, what rds.panels.main takes as bus
WHEREABOUTS = "RDS_APP_WHEREABOUTS"  # the folder where kernels say where they are


def show() -> Any:
    """The panels on the folder and machine that `rds app` was given."""
    import ipywidgets

    from rds.panels import main
    from rds.panels.app.kernel_stack import answer_asks

    ipywidgets.register_comm_target()  # it does so itself only where it is imported by a kernel that runs already
    if WHEREABOUTS in os.environ:
        answer_asks(Path(os.environ[WHEREABOUTS]))
    folder = os.environ.get(FOLDER, ".")
    os.chdir(folder)
    bus = json.loads(os.environ.get(BUS, "{}"))
    return main(folder, os.environ.get(MACHINE, "mini-cnc"), os.environ.get(PANEL, "menu"), bus)
