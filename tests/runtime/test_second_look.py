"""The second look at a run's calls: what it takes of the computer has a limit."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import rds
from rds.modes.process.host import run_plan
from rds.modes.process.second_look import own_times


@pytest.mark.skipif(sys.platform != "linux", reason="other systems limit the size of a process otherwise, or not")
def test_code_that_leaks_ends_the_second_look_instead_of_filling_the_computer() -> None:
    code = (
        "from rds.modes.process import second_look as look\n"
        "look._limit_memory()\n"
        "try:\n"
        "    bytearray(look.MEMORY)\n"
        "except MemoryError:\n"
        "    print('refused', len(bytearray(look.MEMORY // 4)))\n"
    )
    said = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == f"refused {1 << 28}\n"


def test_a_run_that_its_following_error_ended_is_repeated_to_its_last_sample() -> None:
    """Where the last sample was late, it is this sample's own time that the verdict needs."""
    experiment = rds.Experiment(controller="p", reference=rds.sinusoid(5.0, 0.5), following_error={"ferror": 0.1})
    plan = experiment.plan()
    rows = run_plan(plan, None)
    assert rows.ending == "following error" and 2 < len(rows.values) < 100
    stages = np.full((len(rows.values), 3), 1e6)  # ns, as a run in real time records them
    timed = dataclasses.replace(
        rows, columns=[*rows.columns, "interpolate", "compute", "model"], values=np.hstack([rows.values, stages])
    )
    late = np.zeros(len(stages), bool)
    late[-1] = True
    times = own_times(plan, timed, late)
    assert times is not None and np.isfinite(times).all()
