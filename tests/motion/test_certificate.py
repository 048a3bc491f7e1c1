"""The certificate of samples made by hand: where a limit is kept, and where one more micrometre breaks it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rds.core.errors import RdsError
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import SEGMENT

T = 0.01
LIMITS = Limits.from_axes({"X": (10.0, 1e3, 1e5)})


def block(x: Any, y: Any = 0.0, first: int = 0, line: int = 7) -> SampleBlock:
    """Samples in X and Y, of a path that is not given."""
    position = np.zeros((len(x), 6))
    position[:, 0], position[:, 1] = x, y
    numbers = np.full(len(x), line)
    nothing = np.empty(0, SEGMENT)
    return SampleBlock(first, T, position, position, position, numbers, numbers, numbers, nothing, 0, 0.0)


def seen(*blocks: SampleBlock, **words: Any) -> Certificate:
    certificate = Certificate(LIMITS, **words)
    assert len(list(certified(blocks, certificate))) == len(blocks)
    return certificate


@pytest.mark.parametrize("kind, limit", [("velocity", 10.0), ("acceleration", 1e3), ("jerk", 1e5)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_limit_may_be_exceeded_by_a_millionth(kind: str, limit: float, sign: float) -> None:
    """Of k, k(k + 1)/2 and k(k + 1)(k + 2)/6 the differences of that order are 1 from the first on."""
    k = np.arange(1.0, 30.0)
    order = ("velocity", "acceleration", "jerk").index(kind) + 1
    unit = {1: k, 2: k * (k + 1) / 2, 3: k * (k + 1) * (k + 2) / 6}[order] * limit * T**order
    for excess, ok in ((0.9e-6, True), (1.2e-6, False)):
        certificate = Certificate(LIMITS, promised=(kind,))
        certificate.add(block(np.r_[0.0, sign * (1.0 + excess) * unit]))
        assert certificate.ok is ok, certificate.violations
        assert certificate.worst[kind, "X"].share == pytest.approx(1.0 + excess, abs=1e-8)
        assert certificate.time == pytest.approx(0.3)


def test_it_must_come_to_rest_and_does_not_jump_between_blocks() -> None:
    """0.05 mm in a sample are 5 mm/s, which is 500 mm/s² from rest, and 0.5 of the limits."""
    moving = np.arange(30.0) * 0.05
    stopped = np.r_[moving, moving[-1]]
    assert seen(block(stopped), promised=("velocity", "acceleration")).ok
    ends_fast = seen(block(moving * 2.5, line=3), promised=("acceleration",))
    assert [(found.sample, found.line) for found in ends_fast.violations] == [(1, 3), (30, 3)]
    apart = seen(block(stopped[:10]), block(stopped[10:] + 1.0, first=10, line=8), promised=("velocity",))
    assert [(found.sample, found.line, found.value) for found in apart.violations] == [(10, 8, pytest.approx(105.0))]
    assert seen(block(stopped), block([], first=31)).samples == 31


def test_what_is_not_promised_is_measured_and_an_axis_without_limits_may_not_move() -> None:
    jump = np.r_[0.0, np.full(9, 0.09)]
    certificate = seen(block(jump), promised=("velocity",))
    assert certificate.ok and certificate.worst["acceleration", "X"].share == pytest.approx(0.9)
    assert certificate.worst["jerk", "X"].share == pytest.approx(1.8)  # back again within a sample
    assert "Not promised: acceleration (90 % of the limit: X in line 7), jerk (180 %" in certificate.sentence()
    absent = seen(block(np.zeros(10), jump), promised=("velocity",))
    assert [(found.axis, found.limit, found.sample) for found in absent.violations] == [("Y", 0.0, 1)]


def test_all_violations_are_counted_a_hundred_kept_and_five_named() -> None:
    certificate = seen(block(np.arange(151.0)), promised=("velocity",))
    assert certificate.count == 150 and len(certificate.violations) == 100
    with pytest.raises(RdsError) as caught:
        certificate.require("part.ngc")
    assert str(caught.value).count("line 7: velocity of X is 100 at sample") == 5
    assert str(caught.value).endswith("part.ngc: and 145 more")
    seen(block(np.zeros(3))).require("part.ngc")


def test_the_ratio_is_of_the_time_from_the_first_sample_to_the_last() -> None:
    least: Any = SimpleNamespace(seconds=0.2)
    certificate = seen(block(np.zeros(31)), least_time=least)
    assert certificate.ratio == pytest.approx(1.5)
    assert "It takes 1.500 times the 0.200 s" in certificate.sentence()
    least.seconds = 0.0
    assert certificate.ratio is None


def test_the_sentence_names_the_axis_that_comes_nearest() -> None:
    certificate = Certificate(Limits.from_axes({"X": (10.0, 1e3, 1e5), "Y": (5.0, 1e4, 1e7)}), promised=("velocity",))
    ramp = np.arange(30.0) * 0.045
    certificate.add(block(ramp, ramp, line=2))
    assert certificate.sentence() == (
        "Certificate: all 30 planned samples keep the velocity of every axis (at most 90.0 %: velocity of Y in line 2)."
        " Not promised: acceleration (45 % of the limit: X in line 2), jerk (45 % of the limit: X in line 2), the path "
        "(at most 0.0000 mm off, in line 0)."
    )
    broken = seen(block(ramp * 2.5), promised=("velocity",))
    assert broken.sentence().startswith("The planned motion breaks its limits in 29 places; first: line 7: velocity")


def test_the_trace_is_the_largest_of_each_bin_at_its_time() -> None:
    assert seen().trace().shape == (0, 20)
    moved = np.zeros(70_000)
    moved[40_000:] = 0.05
    short, long = seen(block(moved[39_983:40_020])).trace(), seen(block(moved)).trace()
    assert short[:, 0] == pytest.approx([0.0, 0.16, 0.32]) and short[:, 1] == pytest.approx([0.0, 0.5, 0.0])
    assert len(long) == 2188 and long[:, 0] == pytest.approx(0.32 * np.arange(2188)), "bins are joined in pairs"
    assert np.flatnonzero(long[:, 1]).tolist() == [1250] and long[1250, 1] == pytest.approx(0.5)
