"""The subject of the simulation and real-time benchmarks: the demo's X axis, 1 kHz, under the tracking controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rds
from rds.cli.demo import OBSERVER_POLE
from rds.controllers.tracking import law
from rds.machines.encoder import encoder
from rds.models.linear_axis import coefficients, respond
from rds.modes.loop.plan import Plan

Drive = Callable[[float, float, float, float, float, float], tuple[float, float, float]]
Move = Callable[[float, float, float], tuple[float, float]]


def experiment(duration: float = 10.0, **more: Any) -> rds.Experiment:
    """The demo's experiment with X alone."""
    return rds.Experiment(
        axis="X",
        duration=duration,
        reference=rds.sinusoid(5.0, 0.2),
        controller={"name": "tracking", "poles": [[-32, 24], [-32, -24]], "observer_pole": -OBSERVER_POLE},
        **more,
    )


def constants(plan: Plan) -> list[float]:
    """Every constant of the arithmetic, in the order of `struct axis` in axis.c."""
    axis, board = plan.axes[0], plan.machine.converter
    assert axis.controller is not None
    step = 2.0 * board.range / 2**board.bits
    interface = (step, -board.range, board.range - step, axis.axis.resolution)
    return [*axis.controller.params["coefficients"], *coefficients(axis.model.params, plan.T), *interface]


def parts(plan: Plan) -> tuple[Callable[[float], float], Drive, Move]:
    """The axis for other simulators, in our own arithmetic.

    `measure(x) -> y`; `drive(z, started, y, r, dr, ddr) -> (u, next z, next started)` with the reference r and the
    converter's voltage u; `move(x, w, u) -> (next x, next w)` with position x and velocity w. Everything starts at 0.
    """
    axis = plan.axes[0]
    assert axis.controller is not None
    c, m = axis.controller.params["coefficients"], coefficients(axis.model.params, plan.T)
    measure, (limit,) = encoder(axis.axis.resolution), plan.limits()
    assert measure is not None

    def drive(z: float, started: float, y: float, r: float, dr: float, ddr: float) -> tuple[float, float, float]:
        u, (z, started) = law(r, dr, ddr, y, (z, started), c)
        return limit(u), z, started

    def move(x: float, w: float, u: float) -> tuple[float, float]:
        return respond(x, w, u, *m)

    return measure, drive, move
