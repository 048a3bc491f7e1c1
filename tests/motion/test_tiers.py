"""Kernels run in Python first: with the samples of compiled ones, and a short program never waits for the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from math import inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from rds.core.compiling import TieredKernel
from rds.interpolators.motion.least_time import LeastTime
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan

from .chains import MACHINES, chains

pytest.importorskip("numba", reason="numba is not installed: it is in the extra fast")

T = 1e-3
LIMITS = MACHINES[0]


def samples(segments: np.ndarray, limits: Limits, in_python: bool) -> tuple[list[np.ndarray], float]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TieredKernel, "spent", 0.0)
        patch.setattr(TieredKernel, "enough", inf if in_python else 0.0)
        least_time = LeastTime(limits, T)
        found = [
            column
            for block in plan([segments], limits, T, least_time=least_time)
            for column in (block.position, block.velocity, block.acceleration, block.distance, block.segment)
        ]
    return found, least_time.seconds


@hypothesis_settings(max_examples=25)
@given(chains(most=4, low=-3.0))
def test_both_give_the_same_samples_bit_for_bit(segments: np.ndarray) -> None:
    """So it makes no difference when a kernel begins to be compiled: emulation repeats simulation."""
    plain, compiled = samples(segments, LIMITS, True), samples(segments, LIMITS, False)
    assert plain[1] == compiled[1]
    assert len(plain[0]) == len(compiled[0])
    for one, other in zip(plain[0], compiled[0], strict=True):
        assert np.array_equal(one, other)


def test_a_short_program_does_not_wait_for_the_compiler(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21 G90 G94 G64 P0.02\nG1 X5 F300\nG2 X7 Y2 I0 J2\nG1 X0 Y0\nM2\n")
    kept = tmp_path / "kept"
    done = subprocess.run(
        [sys.executable, "-m", "rds", "nc", "run", "part.ngc", "-o", "out"],
        cwd=tmp_path,
        env=os.environ | {"NUMBA_CACHE_DIR": str(kept)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "result.csv").is_file()
    assert not [file for file in kept.rglob("*.nbi") if "motion" in str(file.parent)]
