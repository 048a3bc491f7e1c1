"""Kernels run in Python first: with the samples of compiled ones, and a short program never waits for the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from math import inf
from pathlib import Path
from threading import Event, Thread
from time import sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from rds.core.compiling import TieredKernel
from rds.core.errors import Notice
from rds.interpolators.motion.least_time import LeastTime
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan

from .chains import MACHINES, chains

pytest.importorskip("numba", reason="numba is not installed: it is in the extra fast")

T = 20e-3  # s: the longest motion below has 8,000 samples so, each of which Python computes
LIMITS = MACHINES[0]


class Compiled:
    """What numba would make of a kernel."""

    stats = SimpleNamespace(cache_path="not there")

    def __call__(self) -> str:
        return "compiled"


def tiered(plain: Callable[[], Any]) -> TieredKernel:
    return TieredKernel(plain, Compiled())


@pytest.fixture
def all_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TieredKernel, "spent", -inf)


def samples(segments: np.ndarray, limits: Limits, in_python: bool) -> tuple[list[np.ndarray], float]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TieredKernel, "spent", -inf if in_python else inf)
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


@pytest.mark.usefixtures("all_in_python")
def test_one_long_call_does_not_stay_in_python() -> None:
    """A call that builds thousands of arcs takes 13 s in Python and 0.1 s compiled."""
    inner = tiered(lambda: "in Python")

    def outer() -> list[str]:
        found = [inner()]
        TieredKernel.spent = inf  # so much has been by now
        return [*found, inner()]

    assert tiered(outer)() == ["in Python", "compiled"]


@pytest.mark.usefixtures("all_in_python")
def test_what_is_not_kept_on_disk_is_compiled_later_and_that_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process may be compiling them, or was interrupted: then only some of the kernels are there."""

    def kept() -> str:
        return "in Python"

    def left() -> str:
        return "in Python"

    version = f"py{sys.version_info.major}{sys.version_info.minor}"
    (tmp_path / f"kernels.{kept.__qualname__}-1.{version}.nbi").touch()
    (tmp_path / f"kernels.{left.__qualname__}-9.py22.nbi").touch()  # of another Python
    monkeypatch.setattr(Compiled, "stats", SimpleNamespace(cache_path=str(tmp_path)))
    monkeypatch.setattr(TieredKernel, "told", False)
    monkeypatch.setattr(TieredKernel, "next_look", inf)
    kernels = tiered(kept), tiered(left), tiered(left)
    found = []
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for spent in (0.0, 1.0, 60.0):  # s
            TieredKernel.spent = spent
            found.append([kernel() for kernel in kernels])
    assert found == [["in Python"] * 3, ["compiled", "in Python", "in Python"], ["compiled"] * 3]
    assert [note.category for note in said] == [Notice]


@pytest.mark.usefixtures("all_in_python")
def test_what_another_process_has_compiled_meanwhile_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def late() -> str:
        return "in Python"

    monkeypatch.setattr(Compiled, "stats", SimpleNamespace(cache_path=str(tmp_path)))
    monkeypatch.setattr(TieredKernel, "next_look", 0.0)
    kernel, found = tiered(late), []
    for spent in (1.0, 1.1, 2.0):  # s
        TieredKernel.spent = spent
        found.append(kernel())
        (tmp_path / f"kernels.{late.__qualname__}-1.py{sys.version_info.major}{sys.version_info.minor}.nbi").touch()
    assert found == ["in Python", "in Python", "compiled"], "it is not looked for at each call"


@pytest.mark.usefixtures("all_in_python")
def test_a_second_thread_that_plans_warns_no_more_than_the_first() -> None:
    zero = np.zeros(1)
    entered, done = Event(), Event()

    def wait() -> None:
        entered.set()
        assert done.wait(60.0)

    first = Thread(target=tiered(wait))
    first.start()
    assert entered.wait(60.0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert tiered(lambda: zero[0] / zero[0] != 0.0)()
    finally:
        done.set()
        first.join()


@pytest.mark.usefixtures("all_in_python")
def test_after_an_interruption_in_a_kernel_the_next_one_is_a_first_one() -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tiered(interrupted)()
    TieredKernel.spent = 0.0
    tiered(lambda: sum(range(1000)))()
    assert TieredKernel.spent > 0.0


@pytest.mark.usefixtures("all_in_python")
def test_a_short_program_on_a_busy_computer_is_short() -> None:
    """By the clock, one of three lines was compiled for ten minutes beside other work."""
    TieredKernel.spent = 0.0
    tiered(lambda: sleep(0.2))()
    assert TieredKernel.spent < 0.1


@pytest.mark.skipif(np.lib.NumpyVersion(np.__version__) < "2.0.0", reason="it is by context from numpy 2 on")
@pytest.mark.usefixtures("all_in_python")
def test_an_interruption_anywhere_leaves_the_warnings_as_they_were() -> None:
    before, kernel = np.geterr(), tiered(lambda: "done")
    found, calls = None, 0
    while found is None:
        calls += 1
        left = calls

        def interrupt(*_: object) -> None:
            nonlocal left
            left -= 1
            if not left:
                raise KeyboardInterrupt

        tracing = sys.gettrace()
        sys.settrace(interrupt)
        try:
            found = kernel()
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(tracing)
        assert np.geterr() == before
    assert calls > 3
