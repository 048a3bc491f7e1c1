"""Tables and sentences on the screen, for the command line only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rds.cli.demo import Demo
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
    """One table; columns of numbers are aligned to the right, those of words to the left.

    No word is cut in two: where the columns do not fit on a terminal, each row is shown as a column.
    """
    screen = console()
    least = _widths(columns, rows)
    if not screen.is_terminal:
        screen.width = max(screen.width, _total(least))  # a pipe has no width of its own
    fits = _total(least) <= screen.width or len(columns) < 3
    tables = [_table(columns, rows, screen.width)] if fits else _turned(columns, rows, screen.width)
    screen.print(escape(title), style="bold")  # not the table's own: that would wrap at the table's width
    for table in tables:
        screen.print(table)
    if note:
        screen.print(escape(note), style="dim")


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int, turned: bool = False) -> Table:
    """A table of at most `width` characters; beyond whole words, the widest columns share what there is."""
    widths = _widths(columns, rows, turned)
    natural = [max(map(len, [column, *(row[i] for row in rows)])) for i, column in enumerate(columns)]
    spare = width - _total(widths)
    while spare > 0 and widths != natural:
        widths[max(range(len(widths)), key=lambda i: natural[i] - widths[i])] += 1
        spare -= 1
    table = Table()
    for i, column in enumerate(columns):
        right = i > 0 and (turned or all(_is_number(row[i]) for row in rows))
        table.add_column(escape(column), justify="right" if right else "left", width=widths[i], overflow="fold")
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table


def _widths(columns: Sequence[str], rows: Sequence[Sequence[str]], turned: bool = False) -> list[int]:
    """The characters that each column needs, the first one and numbers in one line, the others by whole words."""
    widths = []
    for i, column in enumerate(columns):
        cells = [row[i] for row in rows]
        whole = i == 0 or turned or all(_is_number(cell) for cell in cells)
        heading = [column] if i == 0 or turned else column.split()
        widths.append(max(map(len, ["", *heading, *(cells if whole else " ".join(cells).split())])))
    return widths


def _total(widths: Sequence[int]) -> int:
    """The characters of a table with such columns: a line and a blank on either side of each."""
    return sum(widths) + 3 * len(widths) + 1


def _turned(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[Table]:
    """The rows as columns, as many side by side as the width holds."""
    tables = []
    left = list(rows)
    while left:
        for count in range(len(left), 0, -1):
            headings, *body = [[column, *(row[i] for row in left[:count])] for i, column in enumerate(columns)]
            if count == 1 or _total(_widths(headings, body, turned=True)) <= width:
                break
        tables.append(_table(headings, body, width, turned=True))
        left = left[count:]
    return tables


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
    if about := result.meta.get("program"):
        from rds.nc.run.report import findings

        for sentence in findings(about):
            screen.print(escape(sentence), soft_wrap=True)
    if result.verdict is not None:
        screen.print(escape(verdict_line(result)), soft_wrap=True)
    for axis, validation in (result.meta.get("validation") or {}).items():
        screen.print(f"model of {escape(axis)}: {escape(validation['sentence'])}", soft_wrap=True)
        for reason in validation["reasons"]:
            if reason["side"] in ("against", "cannot tell"):
                screen.print(f"- {reason['side']}: {escape(reason['what'])}", soft_wrap=True)
    for kind in ("program", "report", "csv"):
        if kind in files:
            screen.print(f"{kind}: {escape(str(files[kind]))}", soft_wrap=True)


def verdict_line(result: Result) -> str:
    """The timing verdict in one line, and below it the times and what they were measured in."""
    timing: dict[str, Any] = result.meta.get("timing", {})
    environment = result.meta.get("environment", {}).get("sentence", "")
    lateness, compute, io = (timing.get(stage, {}) for stage in ("lateness", "compute", "io"))
    made = f"interpolate {_pair(timing['interpolate'])}, " if "interpolate" in timing else ""
    return (
        f"timing {result.verdict}: {result.meta.get('verdict_reason')}\n"
        f"times in µs at the median / 99 %: lateness {_pair(lateness)}, {made}compute {_pair(compute)}, I/O {_pair(io)}"
        f"{f' ({environment})' if environment else ''}"
    )


def cell(value: Any) -> str:
    """A value in a table: nothing is a dash, and a float that nobody has rounded gets six significant digits."""
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def number(value: float | None) -> str:
    """Four significant digits."""
    return "–" if value is None else f"{value:.4g}"


def _is_number(text: str) -> bool:
    """Whether a cell holds a number, or says that there is none."""
    if text in ("", "–", "None"):
        return True
    try:
        float(text.rstrip(" %"))
    except ValueError:
        return False
    return True


def _pair(stage: Mapping[str, float]) -> str:
    return f"{stage.get('p50', float('nan')):.0f}/{stage.get('p99', float('nan')):.0f}"


def show_demo(demo: Demo) -> None:
    """The demo's tables, and where its report is."""
    for table in demo.tables:
        show_table(table["title"], table["columns"], table["rows"], table["note"])
    console().print(f"report: {escape(str(demo.files['report']))}", soft_wrap=True)
