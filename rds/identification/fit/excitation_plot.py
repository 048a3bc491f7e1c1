"""A designed test as a picture: the voltage, where it takes the axis, and what each kind of signal would tell."""

from __future__ import annotations

import numpy as np

from rds.core.figure import BLUE, CYCLE, GREY, VERMILLION, Picture, dress, legend
from rds.identification.fit.excitation import Design
from rds.references import sample_voltage


def excitation_picture(design: Design) -> Picture:
    """The best signal and its response over time; predicted standard errors of the best of each kind as bars."""
    task, best = design.task, design.best
    T = task.machine.sample_period
    t = np.arange(task.samples) * T
    u = sample_voltage(best.signal, T, task.samples)
    y = task.structure.respond(t, u, [0.0] * task.structure.states, task.values)
    every = slice(None, None, max(1, len(t) // 20_000))
    picture = Picture(9.0)
    voltage, response, bars = picture.subplots(3, 1, height_ratios=(2, 2, 3))
    response.sharex(voltage)
    voltage.plot(t[every], u[every], color=BLUE, linewidth=0.9, drawstyle="steps-post")
    dress(voltage, "command [V]", None)
    response.plot(t[every], y[every], color=VERMILLION, linewidth=1.2)
    dress(response, f"{task.axis.name} {'speed' if task.axis.unit == 'rev/min' else 'position'} [{task.axis.unit}]")
    kinds = design.best_of_kinds()
    width = 0.8 / len(task.parameters)
    for i, name in enumerate(task.parameters):
        at = np.arange(len(kinds)) + (i - 0.5 * (len(task.parameters) - 1)) * width
        bars.bar(at, [p.percent[name] for p in kinds], width, label=name, color=CYCLE[i % len(CYCLE)], zorder=2)
    bars.set_yscale("log")
    bars.set_xticks(np.arange(len(kinds)), [p.signal.kind for p in kinds])
    bars.axhline(best.worst_percent, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    dress(bars, "predicted standard error [%]", None)
    legend(bars, 6)
    return picture
