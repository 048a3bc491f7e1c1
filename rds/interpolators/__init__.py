"""Interpolators, one method per file, by name; and what turns a path of segments into samples with them.

Each file has `OPTIONS` and `interpolate(segment, T, params)`, the fixed interface: a generator of one row (position,
velocity, acceleration) for each sample period. Row k is the motion at k T after the segment's start, k = 1, 2, ...; the
last row is the segment's end. The jump of the velocity where a segment starts or ends has no finite acceleration and is
in no row: `rds.interpolators.acceleration` puts a filter on top of any method.
"""

from __future__ import annotations

from types import ModuleType

from rds.core.face import face
from rds.core.registry import Registry

__getattr__, __dir__ = face(
    __name__,
    {
        "BLEND": "motion.segments",
        "Certificate": "motion.certificate",
        "Limits": "motion.limits",
        "arc": "motion.segments",
        "blended": "motion.blended",
        "certified": "motion.certificate",
        "chain": "motion.segments",
        "line": "motion.segments",
        "make_acceleration": "acceleration",
        "plan": "motion.planner",
        "point_to_point": "motion.point_to_point",
        "trapezoid": "motion.trapezoid",
    },
)

DEFAULT = "constant-velocity"
LIBRARY = Registry(
    "interpolator",
    {
        "constant-velocity": "rds.interpolators.constant_velocity",
        "linear": "rds.interpolators.linear",
        "circular": "rds.interpolators.circular",
        "euler": "rds.interpolators.euler",
        "improved-euler": "rds.interpolators.improved_euler",
        "taylor": "rds.interpolators.taylor",
        "tustin": "rds.interpolators.tustin",
        "improved-tustin": "rds.interpolators.improved_tustin",
        "reference-pulse": "rds.interpolators.reference_pulse",
    },
)


def interpolator_names() -> list[str]:
    """Names of the library's interpolators, the default first."""
    return LIBRARY.names()


def interpolator_module(name: str) -> ModuleType:
    """The module of the interpolator called `name`, with its `OPTIONS` and `interpolate`."""
    return LIBRARY.module(name)
