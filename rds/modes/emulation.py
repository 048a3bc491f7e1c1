"""Emulation: the simulation against the clock. The real drivers run too; their time counts, their data does not."""

from collections.abc import Sequence

from rds.core.colours import GREEN
from rds.core.contracts import Drivers
from rds.modes import EMULATION
from rds.modes.loop.loop import Loop
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import Plan
from rds.modes.parts import SimulatedAxes, loop


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of an emulation."""
    assert drivers is not None
    axes = SimulatedAxes(plan)
    exchange, hand_out, measure = drivers.exchange, drivers.write, axes.measure

    def read() -> Sequence[float]:
        exchange()
        return measure()

    full_scale = plan.machine.converter.range

    def write(voltages: Sequence[float]) -> Sequence[float]:
        hand_out(voltages if plan.saturation else [max(-full_scale, min(full_scale, u)) for u in voltages])
        return voltages

    return loop(plan, read, write, axes.follow_plant(plan))


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
