"""System test: a voltage signal to the machine, its response logged."""

from rds.core.clock import LatePolicy
from rds.core.contracts import Drivers
from rds.modes import SYSTEM_TEST
from rds.modes.loop.loop import Loop
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import Plan
from rds.modes.parts import loop, nothing


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of a system test."""
    assert drivers is not None
    return loop(plan, drivers.exchange, drivers.write, nothing)


MODE = Mode(
    SYSTEM_TEST,
    "System test",
    "the machine alone",
    build,
    drivers="live",
    drives=("signal",),
    late=LatePolicy(discard=True),
    modelled=False,
)
