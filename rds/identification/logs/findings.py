"""What the data of a log say about themselves: resolution, excitation, sign, units, a loop, leaps, sampling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rds.identification.logs import excitation, motor_constant, plausibility, sampling, slips, steps
from rds.identification.logs.log import Finding, Log
from rds.machines.machine import Axis

_CHECKS: tuple[Callable[[Log, Axis | None], list[Finding]], ...] = (
    steps.quantization,
    steps.saturation,
    excitation.excitation,
    plausibility.direction,
    plausibility.magnitudes,
    plausibility.loop,
    slips.leaps,
    sampling.repeated,
    sampling.slow,
    motor_constant.motor_constant,
)


def with_findings(log: Log, axis: Axis | None = None) -> Log:
    """The log with the findings about its data added, and with resolution, motor constant and loop as found.

    What was stated stays: a resolution that the data contradict is a finding. `axis` gives travel and limits, where
    the machine is known.
    """
    if log.resolution is None:
        log = replace(log, resolution=steps.step_of(log.position))
    if log.force_gain is None and (told := motor_constant.gain(log)) is not None:
        log = replace(log, force_gain=told[0], units={**log.units, "force": told[1]})
    found = [finding for check in _CHECKS for finding in check(log, axis)]
    closed = log.closed_loop
    if closed is None and any(finding.kind == "closed-loop" for finding in found):
        closed = True
    return replace(log, findings=(*log.findings, *found), closed_loop=closed)
