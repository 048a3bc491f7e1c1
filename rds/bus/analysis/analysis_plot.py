"""The picture of an analysis: one cycle on the bus, and worst responses against deadlines."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from rds.bus.analysis.analysis_report import MET, MISSED, Analysis, Row, time_text
from rds.bus.analysis.measured_words import BEYOND
from rds.bus.medium.bits import INTERFRAME
from rds.core.colours import BLACK, BLUE, GREY, ORANGE, VERMILLION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rds.bus.analysis.measured import Delays, Measured

_COLOURS = {MET: BLUE, MISSED: ORANGE}
_PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
_BINS = 200  # of the measured distribution, over the width
_SEVERAL = 20  # messages beyond which the picture gets no taller


def plot(analysis: Analysis, measured: Measured | None = None) -> Figure:
    """Above, one cycle with the table's data, a line each; below, worst responses with deadlines; times in µs.

    With `measured`, over the worst responses how often each delay was measured, and where the largest is.

    A matplotlib Figure of its own, without pyplot and display. In the cycle every message that needs no other one is
    released at 0; the light bar before a frame is the time that it waits, the mark its release.
    """
    from matplotlib.figure import Figure

    lines = min(len(analysis.rows), _SEVERAL)
    figure = Figure(figsize=(10.0, 2.9 + 0.56 * lines), dpi=128, layout="constrained", facecolor="white")
    above, below = figure.subplots(2, 1)
    _cycle(above, analysis)
    _responses(below, analysis, measured)
    for axes in (above, below):
        axes.set_yticks(range(len(analysis.rows)), [_label(row) for row in analysis.rows])
        axes.set_ylim(len(analysis.rows) - 0.4, -0.6)  # the highest priority on top
        axes.grid(True, axis="x", color="#E2E2E2", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
    return figure


def _cycle(axes: Axes, analysis: Analysis) -> None:
    space = INTERFRAME * 1e6 / analysis.bitrate
    for slot in analysis.cycle:
        released, start, end = slot.released / 1e3, slot.start / 1e3, slot.end / 1e3
        axes.barh(slot.message, start - released, left=released, height=0.5, color=BLUE, alpha=0.2)
        axes.barh(slot.message, end - space - start, left=start, height=0.5, color=BLUE)
        axes.barh(slot.message, space, left=end - space, height=0.5, color=GREY)
        axes.plot([released, released], [slot.message - 0.36, slot.message + 0.36], color=BLACK, linewidth=1.2)
        text = f"{analysis.rows[slot.message].bits} bits"
        place = (end, slot.message)
        axes.annotate(
            text, place, (4, 0), textcoords="offset points", va="center", fontsize="small", bbox=_PAPER, zorder=2
        )
    last = analysis.cycle[-1].end / 1e3
    shortest = min(row.period for row in analysis.rows) * 1e6
    axes.set_xlim(0, max(last * 1.12, shortest * 1.01 if shortest < 3 * last else 0))
    if shortest < 3 * last:
        axes.axvline(shortest, color=BLACK, linewidth=1.2, linestyle=(0, (5, 2)))
        name = f"period {shortest:g} µs "
        axes.annotate(name, (shortest, -0.55), ha="right", va="top", fontsize="small")
    axes.set_xlabel("time since the beginning of the cycle [µs]")
    title = f"{analysis.title}, {analysis.bitrate / 1e3:g} kbit/s: one cycle takes {last:g} µs, "
    title += f"load {analysis.load_percent:.1f} % (worst {analysis.worst_load_percent:.1f} %)"
    axes.set_title(title, fontsize="medium", loc="left")


def _responses(axes: Axes, analysis: Analysis, measured: Measured | None) -> None:
    finite = [time for row in analysis.rows for time in (row.response, row.deadline) if isfinite(time)]
    finite += [row.largest for row in measured.rows if row.largest is not None] if measured else []
    edge = 1.12e6 * max(finite)
    for place, row in enumerate(analysis.rows):
        if isfinite(row.response):
            alpha = 1.0 if measured is None else 0.25
            axes.barh(place, row.response * 1e6, height=0.5, color=_COLOURS[row.verdict], alpha=alpha)
        else:
            axes.barh(place, edge, height=0.5, color=VERMILLION, alpha=0.35, hatch="//", edgecolor="white")
        deadline = row.deadline * 1e6
        axes.plot([deadline, deadline], [place - 0.4, place + 0.4], color=BLACK, linewidth=1.6)
        if measured is None:
            _say(axes, place, row, edge)
        else:
            _measured(axes, place, measured.rows[place], edge)
    axes.set_xlim(0, edge)
    what = "the mark is the deadline"
    if measured is not None:
        what += "\ndark: how often so long was measured; the triangle is the largest"
    axes.set_xlabel(f"worst-case response since the beginning of the cycle [µs]; {what}")


def _measured(axes: Axes, place: int, row: Delays, edge: float) -> None:
    """The distribution of the delays on the message's line, as high as its bar where most are."""
    import numpy as np

    if row.largest is None:
        return
    counts, edges = np.histogram(row.values * 1e6, bins=np.linspace(0.0, edge, _BINS + 1))
    heights = np.sqrt(counts / max(1, counts.max()))  # rare ones are to be seen
    colour = VERMILLION if row.verdict == BEYOND else BLACK
    axes.stairs(place + 0.25 - 0.5 * heights, edges, baseline=place + 0.25, fill=True, color=BLUE, zorder=3)
    largest = row.largest * 1e6
    axes.plot([largest], [place + 0.34], marker="^", color=colour, markersize=6, zorder=4)
    words = f"{time_text(row.largest)}, {row.verdict}"
    if row.verdict == BEYOND:
        words += f" by {time_text(row.beyond)}"
    inside = largest > 0.7 * edge
    axes.annotate(
        words,
        (largest, place + 0.34),
        (-8 if inside else 8, 0),
        textcoords="offset points",
        ha="right" if inside else "left",
        va="center",
        fontsize="small",
        color=colour,
        bbox=_PAPER,
        zorder=4,
    )


def _say(axes: Axes, place: int, row: Row, edge: float) -> None:
    """The response in words, in its bar if that is long enough."""
    if not isfinite(row.response):
        at, words, inside = 0.0, row.verdict, False
    else:
        at = row.response * 1e6
        words, inside = f"{time_text(row.response)}, {row.verdict}", at > 0.25 * edge
    axes.annotate(
        words,
        (at, place),
        (-5 if inside else 5, 0),
        textcoords="offset points",
        ha="right" if inside else "left",
        va="center",
        fontsize="small",
        color="white" if inside and row.verdict == MET else BLACK,
        bbox=None if inside else _PAPER,  # over a deadline's mark
    )


def _label(row: Row) -> str:
    return f"{row.name}  {row.identifier_text}"
