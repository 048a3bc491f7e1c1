"""Beside a whole run's collection a process compiles the large kernels: each worker would take a minute to."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise

import pytest

_COMPILING = pytest.StashKey[subprocess.Popen[bytes]]()


def pytest_configure(config: pytest.Config) -> None:
    """Where all tests run side by side; a few of them need no kernels, as a rule."""
    is_whole = config.args_source in (pytest.Config.ArgsSource.TESTPATHS, pytest.Config.ArgsSource.INVOCATION_DIR)
    if is_whole and config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        config.stash[_COMPILING] = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )


def pytest_unconfigure(config: pytest.Config) -> None:
    """A run that is over before it has no use for it."""
    if (process := config.stash.get(_COMPILING, None)) is not None:
        process.terminate()
        process.wait()


def main() -> None:
    """What the first tests need comes first."""
    compile_fast_lane()
    compile_fits()
    compile_planner()


def compile_fast_lane() -> None:
    """The reader of plain lines of part programs."""
    from rds.nc.language.fast_lane import kernel

    kernel()


def compile_fits() -> None:
    """Fit two of the logs that come with the package, and validate a model on one."""
    import rds

    for name, structure in (("mini-cnc-X-steps", "axis"), ("mini-cnc-spindle-steps", "spindle")):
        rds.fit(rds.read_log(rds.shipped_log(name)), structure)
    axis = rds.library_model("linear-axis", tau=0.01, K=1.8, friction_plus=0.5, friction_minus=-0.5)
    rds.validate(axis, rds.read_log(rds.shipped_log("mini-cnc-X-steps")))


def compile_planner() -> None:
    """Plan a short motion that has every kind of segment and of corner."""
    from rds.core.compiling import compile_tiered
    from rds.interpolators.motion import Limits, plan
    from rds.interpolators.motion.least_time import LeastTime
    from rds.interpolators.motion.segments import BLEND, EXACT_PATH, EXACT_STOP, arc, chain, line

    compile_tiered()
    limits = Limits.from_axes(dict.fromkeys("XYZ", (20.0, 200.0, 10000.0)))
    corners: list[tuple[float, ...]] = [
        (0, 0, 0),
        (5, 0, 0),
        (5, 5, 0),
        (4.9, 5.1, 0),
        (0, 5, 1),
        (0, 5, -1),
        (2, 3, -1),
    ]
    for mode in (BLEND, EXACT_PATH, EXACT_STOP):
        parts = [line(*ends, 10.0, mode=mode, tolerance=0.1) for ends in pairwise(corners)]
        parts.append(arc(corners[-1], corners[0], (1.0, 1.5), 10.0, clockwise=True, mode=mode, tolerance=0.1))
        for _ in plan([chain(*parts)], limits, 1e-3, least_time=LeastTime(limits, 1e-3)):
            pass


if __name__ == "__main__":
    main()
