"""Tables and sentences on the screen, for the command line only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rds.demo import Demo
from rds.results import Result, metric_units

_HEADINGS = {
    "mean_error": "mean",
    "std_error": "std",
    "mean_abs_error": "mean |e|",
    "std_abs_error": "std |e|",
    "max_abs_error": "max |e|",
    "rms_error": "RMS",
    "fit_percent": "fit",
}


def console() -> Console:
    """The console on stdout, wide enough for tables where it is no terminal."""
    screen = Console(highlight=False)
    return screen if screen.is_terminal else Console(width=120, highlight=False)


def show_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> None:
    """One table; every column but the first is aligned to the right."""
    table = Table()
    for i, column in enumerate(columns):
        table.add_column(escape(column), justify="left" if i == 0 else "right", no_wrap=i == 0)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    screen = console()
    screen.print(escape(title), style="bold")  # not the table's own: that would wrap at the table's width
    screen.print(table)
    if note:
        screen.print(escape(note), style="dim")


def show_result(result: Result, files: Mapping[str, Path]) -> None:
    """Metrics per axis with units, the verdict with its environment, and where the files are."""
    metrics = result.metrics
    present = [name for name in _HEADINGS if any(values.get(name) is not None for values in metrics.values())]
    if present:
        rows = [
            [f"{axis} [{metric_units(result, axis)['mean_error']}]", *(number(values.get(name)) for name in present)]
            for axis, values in metrics.items()
        ]
        headings = [_HEADINGS[name] + (" %" if name == "fit_percent" else "") for name in present]
        title = "Tracking error" if "mean_error" in present else "Fit of the model"
        show_table(f"{title}, {result.mode}", ["axis", *headings], rows, " ".join(result.notes))
    screen = console()
    if result.verdict is not None:
        screen.print(escape(verdict_line(result)))
    for kind in ("report", "csv"):
        if kind in files:
            screen.print(f"{kind}: {escape(str(files[kind]))}", soft_wrap=True)


def verdict_line(result: Result) -> str:
    """The timing verdict in one line, with what it was measured in."""
    timing: dict[str, Any] = result.meta.get("timing", {})
    environment = result.meta.get("environment", {}).get("sentence", "")
    lateness, compute, io = (timing.get(stage, {}) for stage in ("lateness", "compute", "io"))
    return (
        f"timing {result.verdict}: {timing.get('late')} of {timing.get('samples')} samples late; µs at the median and "
        f"99 %: lateness {_pair(lateness)}, compute {_pair(compute)}, I/O {_pair(io)}"
        f"{f' ({environment})' if environment else ''}"
    )


def number(value: float | None) -> str:
    """Four significant digits."""
    return "–" if value is None else f"{value:.4g}"


def _pair(stage: Mapping[str, float]) -> str:
    return f"{stage.get('p50', float('nan')):.0f}/{stage.get('p99', float('nan')):.0f}"


def show_demo(demo: Demo) -> None:
    """The demo's tables, and where its report is."""
    for table in demo.tables:
        show_table(table["title"], table["columns"], table["rows"], table["note"])
    console().print(f"report: {escape(str(demo.files['report']))}", soft_wrap=True)
