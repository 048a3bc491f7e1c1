"""A controller that forks: the copy of the process neither drives nor records nor reports, and ends."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from waiting import wait_for

import rds

FORKS = """
import os
initial_state = 0
def control(t, r, y, state, params):
    if state == 50:
        copy = os.fork() == 0
        with open("forks.txt", "a") as file:
            file.write("c" if copy else "p")
        if copy and RAISES:
            raise RuntimeError("in the copy")
    return 10.0 * (r.position - y), state + 1
"""

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no os.fork() on this system")


@pytest.mark.realtime
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("raises", [False, True])
@pytest.mark.parametrize("mode", ["simulation", "emulation", "implementation"])
def test_the_record_is_that_of_one_loop(mode: str, raises: bool, alone: Path) -> None:
    Path("law.py").write_text(
        FORKS.replace("RAISES", str(raises)).replace('"forks.txt"', repr(str(alone / "forks.txt")))
    )
    given = {"axis": "X", "duration": 0.3, "reference": rds.sinusoid(5.0, 2.0), "controller": "law.py"}
    result = rds.Experiment(**given).run(mode, out="run")
    wait_for(lambda: set(Path("forks.txt").read_text()) == {"c", "p"})  # both went on; looking again may fork again
    assert result.meta["ending"] == "done"
    assert (np.diff(result["time"]) > 0.0).all()
    assert result["time"][-1] >= 0.25  # on the machine periods may be left out
    assert mode == "implementation" or len(result["time"]) == 300
    assert np.array_equal(rds.open_result("run")["X_measured"], result["X_measured"])
