"""A monitor's view as a table for the screen."""

from __future__ import annotations

from math import isfinite

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from rds.bus.tools.decode import Decoder
from rds.bus.tools.monitor import View, describe_error
from rds.bus.tools.statistics import Row

_FAULTS = 3  # of the last are shown


def picture(view: View, decode: Decoder, height: int | None = None) -> Group:
    """The whole view; of a table that is higher than `height` lines, the first ones and how many are left out."""
    rows = view.snapshot.rows
    room = len(rows) if height is None else max(1, height - 10 - min(len(view.faults), _FAULTS))
    table = Table()
    for heading in ("identifier", "frames", "Hz", "period ms", "± ms", "load %", "data", "decoded"):
        left = heading in ("identifier", "data", "decoded")
        table.add_column(heading, justify="left" if left else "right", no_wrap=heading not in ("data", "decoded"))
    for row in rows[:room]:
        table.add_row(*(escape(cell) for cell in _cells(row, decode)))
    parts: list[RenderableType] = [Text(view.headline, style="bold" if view.healthy else "bold red"), table]
    if len(rows) > room:
        parts.append(Text(f"and {len(rows) - room} more identifiers; a higher terminal shows them", style="dim"))
    error = describe_error(view.snapshot)
    if error is not None:
        parts.append(Text(f"last error frame: {error}", style="red"))
    parts += [Text(fault, style="red") for fault in view.faults[-_FAULTS:]]
    return Group(*parts)


def _cells(row: Row, decode: Decoder) -> list[str]:
    decoded = decode(row.last)
    words = ""
    if decoded is not None:
        signals = ", ".join(f"{name} {value}" for name, value in decoded.signals.items())
        words = f"{decoded.name}: {signals}" if signals else decoded.name
    return [
        str(row.key),
        str(row.count),
        _number(row.rate, "{:.1f}"),
        _number(row.period * 1e3, "{:.3f}"),
        _number(row.jitter * 1e3, "{:.3f}"),
        _number(row.load, "{:.1f}"),
        row.data.hex(" ").upper(),
        words,
    ]


def _number(value: float, form: str) -> str:
    return form.format(value) if isfinite(value) else "–"
