"""System test: a voltage signal to the machine, its response logged."""

from rds.core.clock import LatePolicy
from rds.core.contracts import Drivers
from rds.modes.parts import loop, nothing
from rds.runtime.loop import Loop
from rds.runtime.mode import Mode
from rds.runtime.plan import Plan


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of a system test."""
    assert drivers is not None
    return loop(plan, drivers.exchange, drivers.write, nothing)


MODE = Mode("system-test", build, drivers="live", drives=("signal",), late=LatePolicy(discard=True))
