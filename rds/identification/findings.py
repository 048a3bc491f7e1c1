"""What the data of a log say about themselves: resolution, saturation, excitation, sign, units, a closed loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rds.identification import data_excitation, data_plausibility, data_steps
from rds.identification.log import Finding, Log
from rds.machines.machine import Axis

_CHECKS: tuple[Callable[[Log, Axis | None], list[Finding]], ...] = (
    data_steps.quantization,
    data_steps.saturation,
    data_excitation.excitation,
    data_plausibility.direction,
    data_plausibility.magnitudes,
    data_plausibility.loop,
)


def with_findings(log: Log, axis: Axis | None = None) -> Log:
    """The log with the findings about its data added, and with the resolution and the loop that were found.

    What was stated stays: a resolution that the data contradict is a finding. `axis` gives travel and limits, where
    the machine is known.
    """
    if log.resolution is None:
        log = replace(log, resolution=data_steps.step_of(log.position))
    found = [finding for check in _CHECKS for finding in check(log, axis)]
    closed = log.closed_loop
    if closed is None and any(finding.kind == "closed-loop" for finding in found):
        closed = True
    return replace(log, findings=(*log.findings, *found), closed_loop=closed)
