"""Criteria by kind, one file each. A module of a criterion has

- `MEANING`: what is measured, as the subject of a sentence;
- `UNIT`: the unit of its value, None for that of the axis;
- `MORE_IS_WORSE`: which way its bands must go;
- `FOR`: the kinds of submissions that it can be asked of;
- `OPTIONS`: what an assignment may set besides the bands, with `DEFAULTS`;
- `NEEDS`: what its runs must hold besides their samples ("counts", "linear");
- `measure(run, options) -> float` over all axes, or NotMeasured with the reason.
"""

from __future__ import annotations

from types import MappingProxyType

from rds.core.registry import Registry

KINDS = Registry(
    "criterion",
    MappingProxyType(
        {
            name: f"rds.grading.criteria.{name.replace('-', '_')}"
            for name in (
                "mean-error",
                "max-error",
                "rms-error",
                "contour-error",
                "path-followed",
                "overshoot",
                "rise-time",
                "settling-time",
                "steady-state-error",
                "effort",
                "saturation-time",
                "gain-margin",
                "phase-margin",
                "modulus-margin",
                "pole-radius",
                "damping",
                "disturbance-error",
                "recovery-time",
                "noise-error",
                "noise-voltage",
                "model-fit",
                "end-point-error",
                "path-error",
                "chord-error",
                "largest-velocity",
                "largest-acceleration",
                "duration",
                "feed-error",
                "row-consistency",
                "work",
                "unit-tests",
            )
        }
    ),
    own=False,
)
