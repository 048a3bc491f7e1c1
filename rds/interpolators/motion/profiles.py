"""The profiles that a program's motion can have, and what each promises of its samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import JOINTS

if TYPE_CHECKING:
    from rds.interpolators.motion.least_time import LeastTime


class Profile(NamedTuple):
    """`promised`: which kinds of limits its samples keep; `about`: what it does, for people."""

    promised: tuple[str, ...]
    about: str


PLANNED, BLENDED = "planned", "blended"
PROFILES = {
    PLANNED: Profile(
        ("velocity", "acceleration", "jerk", "deviation"), "look-ahead and blending within G64's tolerance"
    ),
    "trapezoid": Profile(("velocity", "acceleration", "deviation"), "constant accelerations, at rest after each move"),
    BLENDED: Profile(("velocity",), "velocities held through corners, all axes in the same stage (three-axis-mill)"),
    "point-to-point": Profile(
        ("velocity", "acceleration", "jerk", "deviation"),
        "least time within the jerk, at rest after each move",
    ),
}


def motion_of(
    profile: str, blocks: Iterable[Any], limits: Limits, T: float, *, start: np.ndarray | None = None
) -> tuple[Iterator[SampleBlock], Certificate]:
    """The samples of a program's motion, checked as they pass by the certificate of what the profile promises.

    start: where the axes are if events come before motion (6). Raises InputError for a name that there is not, and as
    the profile does; RdsError without ruckig where it is needed.
    """
    if profile not in PROFILES:
        raise InputError(f"profile {profile!r} is not one of {', '.join(PROFILES)}")
    if not T > 0.0:
        raise InputError(f"sample period T = {T!r} must be more than 0 s")
    from rds.interpolators.motion.least_time import LeastTime  # numba, where it is installed

    least_time = LeastTime(limits, T) if profile == PLANNED else None
    certificate = Certificate(limits, promised=PROFILES[profile].promised, least_time=least_time)
    return certified(_samples(profile, blocks, limits, T, start, least_time), certificate), certificate


def _samples(
    profile: str,
    blocks: Iterable[Any],
    limits: Limits,
    T: float,
    start: np.ndarray | None,
    least_time: LeastTime | None,
) -> Iterator[SampleBlock]:
    if profile == PLANNED:
        from rds.interpolators.motion.planner import plan

        return plan(blocks, limits, T, start=start, least_time=least_time)
    blocks = _of_joints(blocks, profile)
    if profile == BLENDED:
        from rds.interpolators.motion.blended_path import blended_path

        return blended_path(blocks, limits, T, start=start)
    from rds.interpolators.motion.each_move import each_move, point_to_point_law, trapezoid_law

    if profile == "trapezoid":
        return each_move(blocks, limits, T, trapezoid_law(T), jerk_limited=False, start=start)
    return each_move(blocks, limits, T, point_to_point_law(T), jerk_limited=True, start=start)


def _of_joints(blocks: Iterable[Any], profile: str) -> Iterator[Any]:
    """The same blocks. InputError for chords of moves of the tool's tip, at each of which these profiles would rest."""
    for block in blocks:
        for_tip = getattr(block, "segments", block)["tip"] != JOINTS
        if for_tip.any():
            line = getattr(block, "segments", block)["line"][for_tip.argmax()]
            raise InputError(
                f"profile {profile!r} does not move the tool's tip (G43.4) smoothly; leave --profile away",
                f"line {line}",
            )
        yield block
