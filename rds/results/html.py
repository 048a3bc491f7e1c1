"""Results as pieces of HTML: all text escaped, nothing fetched from anywhere."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from rds.results.metrics import ERROR_METRICS, axis_metrics, metric_notes, metric_units
from rds.results.units import heading

if TYPE_CHECKING:
    from rds.results.result import Result

METRIC_TITLES = {
    "mean_error": "mean error",
    "std_error": "std of error",
    "mean_abs_error": "mean |error|",
    "std_abs_error": "std of |error|",
    "max_abs_error": "max |error|",
    "rms_error": "RMS error",
    "fit_percent": "fit",
}


def image(png: bytes, text: str) -> str:
    """A picture within the page, with a text for who does not see it."""
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{b64encode(png).decode("ascii")}">'


def number(value: Any) -> str:
    """A cell's text: four significant digits for a float, a dash for None."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    text = f"{value:.4g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e7 else text  # 10070, and not 1.007e+04


def table(
    columns: Sequence[str], rows: Iterable[Sequence[Any]], title: str = "", note: str = "", mixed: bool = False
) -> str:
    """A table of escaped cells: columns that hold numbers are right-aligned, unless they are `mixed` with words."""
    rows = [list(row) for row in rows]
    right = [not mixed and any(map(_is_number, cells)) for cells in zip(*rows, strict=False)]
    right += [False] * (len(columns) - len(right))
    head = "".join(_cell(column, to, 'th scope="col"') for column, to in zip(columns, right, strict=False))
    body = "".join(f"<tr>{''.join(_cell(*cell) for cell in zip(row, right, strict=False))}</tr>" for row in rows)
    caption = f"<caption>{escape(title)}</caption>" if title else ""
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return (
        f'<div class="scroll"><table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{below}'
    )


_NUMERAL = re.compile(r"[-+−]?\d+([.,]\d+)?([eE][-+]?\d+)?")
_NUMBER = ' class="number"'


def _is_number(value: Any) -> bool:
    """Whether a cell is a number, or the text of one that somebody has rounded already."""
    if isinstance(value, str):
        return _NUMERAL.fullmatch(value.strip()) is not None
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: Any, right: bool, tag: str = "td") -> str:
    text = escape(number(value))
    if "\n" in text:  # a controller's source keeps its lines
        text = f"<pre>{text}</pre>"
    return f"<{tag}{_NUMBER if right else ''}>{text}</{tag.split()[0]}>"


def metrics_rows(result: Result) -> tuple[list[str], list[list[Any]]]:
    """Headings and rows of a result's metrics: a row per metric and unit, a column per axis.

    Axes of different units (mm, rev/min) get rows of their own; a metric that no axis has gets none.
    """
    metrics = axis_metrics(result)
    rows = []
    for key in (*ERROR_METRICS, "fit_percent"):
        units = list(dict.fromkeys(metric_units(result, a)[key] for a in result.axes if key in metrics[a]))
        for unit in units:
            cells = [metrics[a].get(key) if metric_units(result, a)[key] == unit else None for a in result.axes]
            rows.append([heading(METRIC_TITLES[key], unit), *cells])
    return ["", *result.axes], rows


def verdict_line(result: Result, label: str = "") -> str:
    """The verdict with its reason as a paragraph led by `label`, and what it rests on behind *why?*; "" without one."""
    if not result.verdict:
        return ""
    kind = result.verdict if result.verdict in ("met", "missed", "void") else "other"
    reason = str(result.meta.get("verdict_reason") or "")
    lead = f"{escape(label)}: " if label else ""
    because = escape(f": {reason}") if reason else ""
    evidence = str(result.meta.get("verdict_evidence") or "")
    why = f"<details><summary>why?</summary><p>{escape(evidence)}</p></details>" if evidence else ""
    return f'<p class="verdict {kind}">{lead}<strong>{escape(str(result.verdict))}</strong>{because}</p>{why}'


def notes_list(notes: Iterable[str]) -> str:
    """Notes as a small paragraph each."""
    return "".join(f'<p class="note">{_parts(escape(note))}</p>' for note in notes)


def _parts(note: str) -> str:
    """A note about the bus in parts, so that the page finds each of them in its language's file."""
    start, bus, rest = note.partition("on the bus: ")
    if start or not bus:
        return note
    return f"<span>{bus}</span>{'; '.join(f'<span>{part}</span>' for part in rest.split('; '))}"


def result_fragment(result: Result) -> str:
    """How a result shows itself in a notebook: what it is, its verdict, its metrics."""
    what = f"{result.mode or 'run'} of {', '.join(result.axes)}, {len(result)} samples of {result.sample_period:g} s"
    if result.meta.get("ending") not in (None, "done"):
        what += f", ended: {ending(result)}"
    columns, rows = metrics_rows(result)
    shown = table(columns, rows) if rows else ""
    return f"<p>{escape(what)}</p>{verdict_line(result)}{shown}{notes_list(all_notes(result))}"


def ending(result: Result) -> str:
    """How the run came to its end, with the reason where it gave one."""
    reason = str(result.meta.get("ending_reason") or "")
    if reason.startswith("emergency stop"):  # the machine is there, and was told to stop
        return reason
    return str(result.meta.get("ending")) + (f" ({reason})" if reason else "")


def all_notes(result: Result) -> list[str]:
    """The run's own notes and those on its metrics."""
    return [*map(str, result.meta.get("notes") or []), *metric_notes(result)]


def key_values(values: Mapping[str, Any]) -> str:
    """A mapping as a table of two columns; nested mappings as `a.b`."""
    return table(["", ""], [[key, value] for key, value in flat(values)]) if values else ""


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Names and values of a mapping, with nested mappings as `a.b` and lists as text."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        elif isinstance(value, list | tuple):
            yield f"{prefix}{key}", ", ".join(number(item) for item in value)
        else:
            yield f"{prefix}{key}", value
