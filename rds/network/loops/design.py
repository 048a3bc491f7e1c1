"""`rds design lqg`: the law for a loop whose delay is known or was measured, with its margins."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.controllers import library_controller
from rds.controllers.lqg import DEFAULTS, OPTIONS
from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.linear_law import linear_law
from rds.core.toml_text import toml_text
from rds.core.types import Controller
from rds.models.machine_model import linear_part
from rds.modes.experiment.experiment import Experiment
from rds.network.delays import Delay
from rds.network.loops.experiment_cost import plant_of
from rds.network.margins import Margins, margins

if TYPE_CHECKING:
    from rds.core.figure import Picture

LQG = "Designed by `rds design lqg`"  # how the table's file begins


@dataclass(frozen=True)
class Designed:
    """The law `lqg` for one axis: its options and gains, its margins, and the delays that it is for, s."""

    axis: str
    T: float
    options: dict[str, float]
    controller: Controller
    margins: Margins
    delays: np.ndarray  # s; the histogram that was measured, or the one delay
    shares: np.ndarray

    @property
    def spread(self) -> tuple[float, float]:
        """The least and the greatest delay, s."""
        return float(self.delays.min()), float(self.delays.max())

    @property
    def bears(self) -> bool:
        """Whether the loop surely bears that the delay changes within its spread."""
        return self.margins.bears(*self.spread)

    def table(self) -> str:
        """The [controller] table of an experiment file."""
        return toml_text({"controller": {"name": "lqg", **self.options}}, f"{LQG}.").lstrip()

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        least, most = self.spread
        return {
            "axis": self.axis,
            "sample_period_s": self.T,
            "options": self.options,
            "gains": list(self.controller.params["gains"]),
            "delay_margin_s": None if self.margins.delay == inf else self.margins.delay,
            "jitter_margin_s": self.margins.jitter(least),
            "least_delay_s": least,
            "greatest_delay_s": most,
            "bears_jitter": self.bears,
        }

    def __str__(self) -> str:
        position, velocity = self.controller.params["gains"]
        least, most = self.spread
        margin = "of 60 samples, and more" if self.margins.delay == inf else f"below {self.margins.delay * 1e3:.4g} ms"
        said = "surely stays stable" if self.bears else "is not surely stable (the bound is sufficient, not necessary)"
        return "\n".join(
            [
                f"axis {self.axis}, sampled every {self.T * 1e3:g} ms, delay {self.options['delay'] * 1e6:.0f} µs",
                f"gains {position:.5g} V/mm and {velocity:.5g} V/(mm/s)",
                f"delay margin: stable with constant delays {margin}",
                f"jitter margin at {least * 1e6:.0f} µs: {self.margins.jitter(least) * 1e6:.0f} µs",
                f"with delays from {least * 1e6:.0f} to {most * 1e6:.0f} µs the loop {said}",
            ]
        )

    def plot(self) -> Picture:
        """The jitter margin over the constant part of the delay, with the distribution of the delay on top."""
        with needed_for("a picture"):
            from rds.core.figure import CYCLE, Picture, dress, legend

        figure = Picture(4.2)
        axes = figure.subplots()
        L, J = self.margins.L * 1e3, self.margins.J * 1e3
        axes.plot(L, J, color=CYCLE[0], label="jitter margin (Kao and Lincoln)")
        if self.margins.delay < inf:
            axes.axvline(self.margins.delay * 1e3, color=CYCLE[1], linestyle="--", label="delay margin")
        least, most = (each * 1e3 for each in self.spread)
        axes.plot([least], [most - least], "o", color=CYCLE[2], label="least delay, and its spread")
        dress(axes, "further delay that may change [ms]", "constant delay [ms]")
        above = axes.twinx()
        width = max((most - least) / 40.0, 0.002 * max(float(L.max()), 1e-6))
        above.hist(self.delays * 1e3, list(np.arange(least, most + 2.0 * width, width)), weights=100.0 * self.shares,
                   color=CYCLE[3], alpha=0.5, label="delays")  # fmt: skip
        above.set_ylabel("samples [%]")
        above.set_ylim(0.0, 300.0 * max(float(self.shares.max()), 1e-9))
        legend(axes)
        return figure


def design_lqg(experiment: Experiment, delay: Delay | None = None, axis: str | None = None) -> Designed:
    """The law for one axis of an experiment (by default the first) at the mean of `delay`.

    Options are those of the experiment's own controller where it is an `lqg`; without a `delay` its own holds.
    InputError for an axis that the law is not for.
    """
    plan = experiment.plan()
    if axis is not None and axis not in plan.names:
        raise InputError(f"axis {axis!r} does not run in this experiment; there are {', '.join(plan.names)}")
    chosen = plan.axes[0 if axis is None else plan.names.index(axis)]
    of = chosen.controller
    own = {} if of is None or of.source.name != "lqg" else {name: float(of.params[name]) for name in OPTIONS}
    options = DEFAULTS | own
    if delay is not None:
        values, shares = delay.histogram(200)
        options["delay"] = float(values @ shares)
    else:
        values, shares = np.array([options["delay"]]), np.ones(1)
    params = chosen.model.params
    if not {"tau", "K"} <= set(params):
        raise InputError(f"the model of axis {chosen.axis.name} gives no tau and K, which the design needs")
    linear = linear_part(params) if "viscous" in params else params
    limit = plan.machine.converter.range if plan.saturation else inf
    law = library_controller("lqg", linear, plan.T, limit, unit=chosen.axis.unit, **options)
    plant = plant_of(chosen, options["disturbance"], options["noise"], 0.0)
    found = margins(plant, linear_law(law), plan.T)
    return Designed(chosen.axis.name, plan.T, options, law, found, values, shares)
