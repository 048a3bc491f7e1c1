"""The picture of a sweep over plants: what is used against the number of nodes, a panel for each of what can break."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rds.core.extras import needed_for
from rds.network.loops.plant import PARTS, Shares

if TYPE_CHECKING:
    from rds.core.figure import Picture


def plot(found: Sequence[Shares]) -> Picture:
    """Lines on paper, points simulated; one colour for each combination of segment, bit rate and period."""
    with needed_for("a picture"):
        from rds.core.figure import CYCLE, Picture, dress, legend

    figure = Picture(8.0)
    groups: dict[str, list[Shares]] = {}
    for each in found:
        plant = each.plant
        label = f"{plant.per_segment} a segment, {plant.bitrate / 1e3:g} kbit/s, {plant.period * 1e3:g} ms"
        groups.setdefault(label, []).append(each)
    for part, axes in enumerate(figure.subplots(len(PARTS), 1)):
        for number, (label, rows) in enumerate(groups.items()):
            rows = sorted(rows, key=lambda each: each.plant.nodes)
            colour = CYCLE[number % len(CYCLE)]
            style = ("-", "--", ":")[number // len(CYCLE) % 3]
            paper = [r.paper[part] for r in rows]
            axes.plot([r.plant.nodes for r in rows], paper, style, color=colour, label=label)
            points = [(r.plant.nodes, r.simulated[part]) for r in rows if r.simulated is not None]
            axes.plot([p[0] for p in points], [p[1] for p in points], "o", color=colour, markersize=4)
        axes.axhline(1.0, color="#8A8A8A", linestyle="--")
        axes.set_xscale("log")
        axes.set_yscale("log")
        dress(axes, f"{PARTS[part]}, used", "nodes" if part == len(PARTS) - 1 else "")
        if part == 0 and len(groups) <= 12:
            legend(axes, 2)
    return figure
