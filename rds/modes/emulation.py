"""Emulation: the simulation against the clock. The real drivers run too; their time counts, their data does not."""

from collections.abc import Sequence
from math import inf

from rds.core.colours import GREEN
from rds.core.contracts import Drivers
from rds.modes import EMULATION
from rds.modes.loop.commands import Command
from rds.modes.loop.loop import Loop
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import Plan
from rds.modes.parts import SimulatedAxes, simulated_loop


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of an emulation."""
    assert drivers is not None
    axes = SimulatedAxes(plan)
    exchange, hand_out, measure = drivers.exchange, drivers.write, axes.measure

    def read() -> Sequence[float]:
        exchange()
        return measure()

    full_scale = plan.machine.converter.range
    # without saturation, a model gets more than the module's frame can say; a drive's targets have limits of their own
    most = [full_scale if axis.command is Command.VOLTAGE else inf for axis in plan.axes]

    def write(commands: Sequence[float]) -> Sequence[float]:
        if plan.saturation:
            hand_out(commands)
        else:
            hand_out([max(-limit, min(limit, u)) for limit, u in zip(most, commands, strict=True)])
        return commands

    return simulated_loop(plan, axes, read, write)


# Every period is processed, late or not, so that emulation repeats simulation sample for sample.
MODE = Mode(
    EMULATION,
    "Emulation",
    "the same against the clock, with the drivers",
    build,
    drivers="dry run",
    drives=("controller", "signal"),
    simulates_plant=True,
    line={"color": GREEN, "linewidth": 1.5, "linestyle": (0, (4, 3))},
    layer=2,
)
