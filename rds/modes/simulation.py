"""Simulation: models behind converters and encoders, in virtual time."""

from rds.core.contracts import Clock, Drivers
from rds.modes.parts import SimulatedAxes, at_once
from rds.runtime.loop import Loop
from rds.runtime.mode import Mode, Record, Stop
from rds.runtime.plan import Plan


def build(plan: Plan, clock: Clock, drivers: Drivers | None, record: Record, stop: Stop) -> Loop:
    """The loop of a simulation."""
    axes = SimulatedAxes(plan)
    return Loop(plan.samples, clock, axes.measure, plan.laws(), at_once, axes.follow, record, stop)


MODE = Mode("simulation", build, drivers="none", drives=("controller", "signal"))
