"""What the delay of a network costs the loop of an experiment: its mean and its jitter apart, and its losses.

The loop is that of the experiment's law about rest and the linear part of its model, disturbed by white noise of the
voltage, its measurement by noise of the encoder. The cost is the mean of y² + ρ u². With J of no delay, of the
constant mean delay, of the distribution, and of the distribution with losses,

    mean delay costs J(mean) - J(0)     jitter costs J(distribution) - J(mean)     losses cost the rest
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.linear_law import linear_law
from rds.core.quantities import Quantity
from rds.models.machine_model import linear_part
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import AxisPlan
from rds.network.cost import Cost, Law, cost
from rds.network.delays import Delay
from rds.network.sampled import Plant

DISTURBANCE = Quantity("white noise of the voltage, root of its intensity", "V√s", 0.0, 1e6, default=0.01)
NOISE = Quantity("noise of the measured position, rms; by default that of the encoder's counts", "mm", 0.0, 1e6)
EFFORT = Quantity("weight ρ of u² in the cost", "mm²/V²", 0.0, 1e12, default=0.0)
BINS = Quantity("parts of the delay's distribution", "", 1, 500, default=40, whole=True)
SLOWER = Quantity("how many samples of the law a measurement of the sensor serves", "", 1, 50, default=1, whole=True)


@dataclass(frozen=True)
class NetworkCost:
    """The costs (mm²) of one axis: without delay, with the constant mean delay, with the distribution, with losses."""

    axis: str
    unit: str
    mean_delay: float  # s
    lost: float  # share
    none: Cost
    mean: Cost
    random: Cost
    lossy: Cost

    @property
    def rows(self) -> list[tuple[str, Cost]]:
        """The four loops by name."""
        return [
            ("without delay", self.none),
            (f"mean delay, {self.mean_delay * 1e6:.0f} µs, constant", self.mean),
            ("the distribution", self.random),
            (f"and {100 * self.lost:.2g} % lost", self.lossy),
        ]

    @property
    def parts(self) -> dict[str, float]:
        """What the mean delay, its jitter and the losses cost, unit² of the axis; infinite where it turns unstable."""
        J = [loop.cost for _, loop in self.rows]
        names = ("mean_delay", "jitter", "loss")
        return {name: J[i + 1] - J[i] if J[i] < inf else inf for i, name in enumerate(names)}

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps; null for what is infinite."""
        loops = ("without_delay", "mean_delay", "distribution", "with_losses")
        told = {
            name: {
                "cost": _finite(loop.cost),
                "position_rms": _finite(_rms(loop.y)),
                "voltage_rms": _finite(_rms(loop.u)),
                "radius": loop.radius,
                "stable": loop.stable,
            }
            for name, (_, loop) in zip(loops, self.rows, strict=True)
        }
        costs = {name: _finite(value) for name, value in self.parts.items()}
        about = {"axis": self.axis, "unit": self.unit, "mean_delay_s": self.mean_delay, "lost": self.lost}
        return about | {"loops": told, "costs": costs}

    def __str__(self) -> str:
        lines = [
            f"axis {self.axis}",
            f"{'loop':<34}{f'position rms, {self.unit}':>20}{'voltage rms, V':>16}{'cost':>13}{'radius':>9}",
        ]
        for name, loop in self.rows:
            numbers = f"{_rms(loop.y):>20.4g}{_rms(loop.u):>16.4g}{loop.cost:>13.5g}"
            unstable = f"{'not stable':>20}{'':>16}{'':>13}"
            lines.append(f"{name:<34}{numbers if loop.stable else unstable}{loop.radius:>9.4f}")
        names = {"mean_delay": "the mean delay", "jitter": "its jitter", "loss": "losses"}
        for key, value in self.parts.items():
            if value == inf:
                lines.append(f"{names[key]}: the loop is not stable")
            else:
                lines.append(f"{names[key]} cost {value:.3g} {self.unit}² ({100 * value / self.none.cost:+.2g} %)")
        return "\n".join(lines)


def network_cost(
    experiment: Experiment,
    delay: Delay,
    *,
    axis: str | None = None,
    disturbance: float = 0.01,
    noise: float | None = None,
    effort: float = 0.0,
    loss: float = 0.0,
    bins: int = 40,
    every: int = 1,
) -> NetworkCost:
    """The cost of one axis's loop (by default the first) with the total `delay` from its sampling to its voltage.

    `disturbance` in V√s, `noise` in the axis's unit (rms), `effort` in unit²/V²; `every`: two rates. InputError for a
    law or a model that has no linear part, and numbers that will not do.
    """
    for quantity, value, name in ((DISTURBANCE, disturbance, "disturbance"), (EFFORT, effort, "effort")):
        quantity.check(value, name, "network cost")
    BINS.check(bins, "bins", "network cost")
    SLOWER.check(every, "every", "network cost")
    plan = experiment.plan()
    names = plan.names
    if axis is not None and axis not in names:
        raise InputError(f"axis {axis!r} does not run in this experiment; there are {', '.join(names)}")
    chosen = plan.axes[0 if axis is None else names.index(axis)]
    plant = plant_of(chosen, disturbance, _noise(chosen, plan.quantization, noise), effort)
    law = law_of(chosen)
    values, shares = delay.histogram(bins)
    mean = float(values @ shares)
    lost = 1.0 - (1.0 - loss) * (1.0 - delay.lost_share)
    arrived = Delay("trace", {}, tuple(v for v in delay.trace if v == v)) if delay.kind == "trace" else delay
    constant = Delay.named("constant", delay=mean)
    found = [
        cost(plant, law, plan.T, each, loss=share, bins=bins, every=every)
        for each, share in ((Delay(), 0.0), (constant, 0.0), (arrived, 0.0), (arrived, lost))
    ]
    return NetworkCost(chosen.axis.name, chosen.axis.unit, mean, lost, *found)


def law_of(axis: AxisPlan) -> Law:
    """The linear law of an axis; InputError where a signal drives it."""
    if axis.controller is None:
        raise InputError(f"axis {axis.axis.name} has no controller; the cost is that of a loop")
    return linear_law(axis.controller)


def plant_of(axis: AxisPlan, disturbance: float, noise: float, effort: float) -> Plant:
    """The linear part τ v' + v = K (u + w) of an axis's model, w white noise of intensity `disturbance`² V²s."""
    params: Mapping[str, Any] = axis.model.params
    if not {"tau", "K"} <= set(params):
        raise InputError(
            f"the model of axis {axis.axis.name} gives no tau and K; the cost is that of a linear axis: take the "
            "machine's own model, or linear-axis"
        )
    linear = linear_part(params) if "viscous" in params else params
    tau, K = float(linear["tau"]), float(linear["K"])
    if axis.axis.is_spindle:
        A, B, C = np.array([[-1.0 / tau]]), np.array([K / tau]), np.array([[1.0]])
    else:
        A, B, C = np.array([[0.0, 1.0], [0.0, -1.0 / tau]]), np.array([0.0, K / tau]), np.array([[1.0, 0.0]])
    return Plant(A, B, C, disturbance**2 * np.outer(B, B), noise**2, 1.0, effort)


def _noise(axis: AxisPlan, quantized: bool, given: float | None) -> float:
    if given is not None:
        return float(NOISE.check(given, "noise", "network cost"))
    return axis.axis.resolution / sqrt(12.0) if quantized else 0.0


def _rms(variance: float) -> float:
    return sqrt(variance) if variance < inf else inf


def _finite(value: float) -> float | None:
    return float(value) if abs(value) < inf else None
