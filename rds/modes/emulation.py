"""Emulation: the simulation against the clock. The real drivers run too; their time counts, their data does not."""

from collections.abc import Sequence

from rds.core.contracts import Clock, Drivers
from rds.modes.parts import SimulatedAxes
from rds.runtime.loop import Loop
from rds.runtime.mode import Mode, Record, Stop
from rds.runtime.plan import Plan


def build(plan: Plan, clock: Clock, drivers: Drivers | None, record: Record, stop: Stop) -> Loop:
    """The loop of an emulation."""
    assert drivers is not None
    axes = SimulatedAxes(plan)
    exchange, hand_out, measure = drivers.exchange, drivers.write, axes.measure

    def read() -> Sequence[float]:
        exchange()
        return measure()

    def write(voltages: Sequence[float]) -> Sequence[float]:
        hand_out(voltages)
        return voltages

    return Loop(plan.samples, clock, read, plan.laws(), write, axes.follow, record, stop)


# Every period is processed, late or not, so that emulation repeats simulation sample for sample.
MODE = Mode("emulation", build, drivers="dry run", drives=("controller", "signal"))
