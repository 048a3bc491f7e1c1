"""System test: a voltage signal to the machine, its response logged."""

from rds.core.clock import LatePolicy
from rds.core.contracts import Clock, Drivers
from rds.modes.parts import nothing
from rds.runtime.loop import Loop
from rds.runtime.mode import Mode, Record, Stop
from rds.runtime.plan import Plan


def build(plan: Plan, clock: Clock, drivers: Drivers | None, record: Record, stop: Stop) -> Loop:
    """The loop of a system test."""
    assert drivers is not None
    return Loop(plan.samples, clock, drivers.exchange, plan.laws(), drivers.write, nothing, record, stop)


MODE = Mode("system-test", build, drivers="live", drives=("signal",), late=LatePolicy(discard=True))
