"""A whole run compiles once what each of its workers would compile.

Before the workers begin: modules and packages to bytecode, and the assertions of the tests' files. After a fresh clone
that is two thirds of a collection. Beside their collection: the large kernels, a minute.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import pytest

_COMPILING = pytest.StashKey[subprocess.Popen[bytes]]()


def pytest_configure(config: pytest.Config) -> None:
    """Where all tests run side by side; a few of them need little of it, as a rule."""
    is_whole = config.args_source in (pytest.Config.ArgsSource.TESTPATHS, pytest.Config.ArgsSource.INVOCATION_DIR)
    if is_whole and config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        config.stash[_COMPILING] = process
        if rewrite_assertions(config, Path(__file__).parent.rglob("*.py")):  # else it is no fresh clone
            assert process.stdout is not None
            process.stdout.read()  # up to its end, when all modules are imported


def pytest_unconfigure(config: pytest.Config) -> None:
    """A run that is over before it has no use for it."""
    if (process := config.stash.get(_COMPILING, None)) is not None:
        process.terminate()
        process.communicate()


def rewrite_assertions(config: pytest.Config, files: Iterable[Path]) -> int:
    """Write the bytecode that pytest reads of tests, with its assertions; give how many files had none of now.

    pytest has no public way to: where a version does it otherwise, each worker goes on doing it for itself.
    """
    if sys.dont_write_bytecode:
        return 0
    count = 0
    with contextlib.suppress(ImportError, AttributeError, TypeError, OSError):
        from _pytest.assertion import rewrite

        for path in files:
            if not (path.match("test_*.py") or path.name == "conftest.py"):
                continue
            folder = rewrite.get_cache_dir(path)
            compiled = folder / (path.stem + rewrite.PYC_TAIL)
            if rewrite._read_pyc(path, compiled) is None and rewrite.try_makedirs(folder):
                source, code = rewrite._rewrite_test(path, config)
                rewrite._write_pyc(config.stash[rewrite.assertstate_key], code, source, compiled)
                count += 1
    return count


def main() -> None:
    """What the first tests need comes first."""
    import_all()
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the end of what who started this waits for
    compile_fast_lane()
    compile_fits()
    compile_planner()


def import_all() -> None:
    """Import all modules of RDS, and with them all packages: Python keeps their bytecode."""
    import rds

    for module in pkgutil.walk_packages(rds.__path__, "rds."):
        if not module.name.endswith("__main__"):
            with contextlib.suppress(ImportError):  # what is not installed
                importlib.import_module(module.name)


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
