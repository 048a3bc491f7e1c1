"""The picture of a measurement: the delays of each direction as histograms, and the host's load over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.extras import needed_for
from rds.network.loops.measure import Measurement

if TYPE_CHECKING:
    from rds.core.figure import Picture


def plot(measured: Measurement) -> Picture:
    """Above the histograms (share of the samples by delay), below the processor's load, as oacs-thesis's figure 83."""
    with needed_for("a picture"):
        from rds.core.figure import CYCLE, Picture, dress, legend

    figure = Picture(7.0)
    above, below = figure.subplots(2, 1)
    names = ("actuator", "computing", "sensor", "total")
    labels = ("controller to actuator", "computing", "sensor to controller", "in all")
    parts = [measured.parts()[name] * 1e6 for name in names]
    most = max(float(np.nanpercentile(part, 99.9)) for part in parts if np.isfinite(part).any())
    edges = np.linspace(0.0, most * 1.02, 120)
    for part, label, colour in zip(parts, labels, CYCLE, strict=False):
        whole = part[np.isfinite(part)]
        share = 100.0 * np.histogram(whole, edges)[0] / max(len(part), 1)
        above.stairs(share, edges, color=colour, label=label, fill=label != "in all", alpha=0.7)
    above.axvline(measured.sample_period * 1e6, color="#8A8A8A", linestyle="--", label="sample period")
    above.set_xlim(0.0, most * 1.02)
    dress(above, "samples [%]", "delay [µs]")
    legend(above, 5)
    times = [row[0] for row in measured.host.rows]
    below.plot(times, [row[1] for row in measured.host.rows], color=CYCLE[0], label="this process, of one processor")
    below.plot(times, [row[2] for row in measured.host.rows], color=CYCLE[1], label="the computer, of all")
    begun = 0.0
    for number, phase in enumerate(dict.fromkeys(row[3] for row in measured.host.rows)):
        height = 101.0 if number % 2 == 0 else 106.0  # a set-up may be short
        below.annotate(f" {phase}", (begun, height), fontsize="small", va="bottom")
        below.axvline(begun, color="#C8C8C8", linewidth=0.8)
        begun = max(row[0] for row in measured.host.rows if row[3] == phase)
    below.set_ylim(0.0, 113.0)
    dress(below, "load of the host [%]")
    legend(below)
    return figure
