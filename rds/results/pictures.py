"""All pictures that one run leaves, drawn: a PNG for each axis, and those of its report.

Imports matplotlib, and so is called where that is imported already: see `rds.core.drawing`.
"""

from __future__ import annotations

from rds.results.late_samples import total_time
from rds.results.plots import overview
from rds.results.plots_signals import signals
from rds.results.plots_timing import timing
from rds.results.report import Pictures
from rds.results.result import Result
from rds.results.signals import signals_of


def pictures(result: Result) -> Pictures:
    """Draw all of them."""
    axes = {axis: overview(result, axis).png() for axis in result.axes}
    return Pictures(axes, of_report(result, next(iter(axes.values())) if len(axes) == 1 else None))


def of_report(result: Result, whole: bytes | None = None) -> dict[str, bytes]:
    """What the report shows of a run, by its title; `whole` is its overview, if that is drawn already."""
    drawn = {"response, error and voltage": whole or overview(result).png()}
    if any(signals_of(result, axis) for axis in result.axes) and len(result):
        drawn["signals of the controllers"] = signals(result).png()
    if total_time(result) is not None and len(result):
        drawn["timing"] = timing(result).png()
    return drawn
