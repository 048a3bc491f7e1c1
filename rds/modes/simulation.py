"""Simulation: models behind converters and encoders, in virtual time."""

from rds.core.colours import ORANGE
from rds.core.contracts import Drivers
from rds.modes import SIMULATION
from rds.modes.loop.loop import Loop
from rds.modes.loop.mode import Mode
from rds.modes.loop.plan import Plan
from rds.modes.parts import SimulatedAxes, at_once, simulated_loop


def build(plan: Plan, drivers: Drivers | None) -> Loop:
    """The loop of a simulation."""
    axes = SimulatedAxes(plan)
    return simulated_loop(plan, axes, axes.measure, at_once)


MODE = Mode(
    SIMULATION,
    "Simulation",
    "the models, as fast as it goes",
    build,
    drivers="none",
    drives=("controller", "signal"),
    simulates_plant=True,
    line={"color": ORANGE, "linewidth": 3.0, "alpha": 0.7},
    layer=1,
)
