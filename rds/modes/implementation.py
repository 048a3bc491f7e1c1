"""Implementation: the controllers drive the machine; the models run in parallel on the same voltages."""

from rds.core.clock import LatePolicy
from rds.core.colours import BLUE
from rds.core.contracts import Drivers
from rds.modes.loop.loop import Loop
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import Plan
from rds.modes.parts import SimulatedAxes, loop


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of an implementation, and of a model validation: what drives the axes is the plan's."""
    assert drivers is not None
    models = SimulatedAxes(plan)
    return loop(plan, drivers.exchange, drivers.write, models.follow_and_tell, cell=lambda: drivers.force)


# A machine does not wait: what was due while the loop was late is past, and is not caught up.
MODE = Mode(
    "implementation",
    "Implementation",
    "the machine, its models beside it",
    build,
    drivers="live",
    drives=("controller",),
    followed="modelled",
    late=LatePolicy(discard=True),
    line={"color": BLUE, "linewidth": 1.0},
)
