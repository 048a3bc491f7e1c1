"""Whether logs that a model is validated on contradict each other: what each by itself says of the axis.

By the fit of the model's structure to each log a parameter, and of any model by what it is off by on each: two logs
that differ by far more than their standard errors, and by as much as matters, are of two axes, loads or temperatures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from math import hypot, isfinite

from rds.identification.validate.assessment import Assessment
from rds.identification.validate.verdict import Bands, Reason, Side
from rds.identification.validate.within import judged_by, tells_speed_alone

_APART = 6.0  # standard errors of both, as for logs that are fitted together (`fit/contradiction.py`)
_MATTERS = 0.03  # of a parameter's value

Told = dict[str, tuple[float, float, str]]  # by the log's name: value, standard error, unit


def contradictions(assessments: Mapping[str, Assessment], bands: Bands) -> Iterator[Reason]:
    """A reason for each thing of which two logs say different things: those that differ most."""
    found = [*_parameters(assessments)] or [*_measures(assessments, bands)]
    for what, told, least in found:
        pairs = [
            (abs(a - b) / spread, one, other)
            for (one, (a, ea, _)), (other, (b, eb, _)) in combinations(told.items(), 2)
            if isfinite(spread := hypot(ea, eb)) and spread > 0.0 and abs(a - b) > max(_APART * spread, least)
        ]
        if not pairs:
            continue
        times, *both = max(pairs)
        said = " and ".join(f"by {name} {told[name][0]:.4g} {told[name][2]}".rstrip() for name in both)
        yield Reason(
            Side.NOTE,
            "contradiction",
            f"the logs contradict each other about {what}: {said} ({times:.0f} standard errors apart): the axis, its "
            "load or its temperature was another, or one log is at fault",
        )


def _parameters(assessments: Mapping[str, Assessment]) -> Iterator[tuple[str, Told, float]]:
    told: dict[str, Told] = {}
    for log, a in assessments.items():
        for p in a.attainable.parameters if a.attainable is not None else ():
            told.setdefault(p.name, {})[log] = (p.here, p.error, p.unit)
    for name, values in told.items():
        if len(values) > 1:
            yield name, values, _MATTERS * max(abs(value) for value, _, _ in values.values())


def _measures(assessments: Mapping[str, Assessment], bands: Bands) -> Iterator[tuple[str, Told, float]]:
    by_log = {log: found for log, a in assessments.items() if (found := judged_by(a, bands)) is not None}
    bounds = {"gain": bands.gain_percent, "lag": bands.delay, "friction": bands.friction_percent}
    for kind, least in bounds.items():
        offs = {
            log: off
            for log, found in by_log.items()
            if (off := getattr(found, kind)) is not None
            and (kind == "lag" or not tells_speed_alone(assessments[log], found))
        }
        told = {log: (off.value, off.error, off.unit) for log, off in offs.items()}
        if len(told) > 1:
            yield f"what the model is off by in its {kind}", told, least
