"""A one-page report in a single HTML file: readable in light and dark, printed or offline; it fetches nothing."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from rds.core import drawing
from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.results import html
from rds.results.metrics import ERROR_METRICS, axis_metrics, metric_units
from rds.results.result import Result
from rds.results.units import heading

# no script, nothing loaded from outside, even if a text from a student's file slipped through
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

DRAWN_BY = "rds.results.pictures"  # which imports matplotlib, and so may be called elsewhere


class Pictures(NamedTuple):
    """PNG files of a run: `axes` the overview of each axis by its name, `report` what the report shows, by its title.

    Here and not where they are drawn, so that who gets them from another process need not import matplotlib.
    """

    axes: dict[str, bytes]
    report: dict[str, bytes]


def write_report(
    path: str | Path,
    title: str,
    results: Sequence[Result],
    tables: Sequence[Mapping[str, Any]] = (),
    notes: Sequence[str] = (),
    files: Sequence[str | Path] = (),
    sections: Sequence[str] = (),
    pictures: Sequence[Mapping[str, bytes]] = (),
) -> Path:
    """Write the report of `results`, one section each, to `path`; whole or not at all.

    `tables` are shown first, each {title, columns, rows, note}; `notes` are sentences under the title; `files` are
    linked by their way from the report. All text is escaped; `sections` are HTML, and stand as they are after the
    tables; `pictures` are what `pictures.of_report` gives of each result, if they are drawn already.
    Raises InputError for a table that lacks its columns or rows, no results, or a path that can't be written.
    """
    path = Path(path)
    text = report(title, results, tables, notes, [_link(path, file) for file in files], sections, pictures)
    return write_whole(path, text.encode("utf-8", "backslashreplace"))


def report(
    title: str,
    results: Sequence[Result],
    tables: Sequence[Mapping[str, Any]] = (),
    notes: Sequence[str] = (),
    files: Sequence[str] = (),
    sections: Sequence[str] = (),
    pictures: Sequence[Mapping[str, bytes]] = (),
) -> str:
    """The report as HTML text; `files` are relative paths, `sections` HTML, `pictures` as for `write_report`."""
    if not results:
        raise InputError("there is nothing to report; give at least one result")
    labels = _labels(results)
    if not pictures:
        pictures = [drawing.asked(DRAWN_BY, "of_report", result)() for result in results]
    parts = [
        f"<header><h1>{escape(title)}</h1>{_subtitle(results)}{html.notes_list(notes)}</header>",
        f"<section><h2>Runs</h2>{_runs(results, labels)}{_verdicts(results, labels)}</section>",
        *(f"<section>{_extra(table)}</section>" for table in tables),
        *sections,
        f"<section><h2>Tracking and fit</h2>{_metrics(results, labels)}</section>",
        _together(results, labels),
        *(_run_section(*of_one) for of_one in zip(results, labels, pictures, strict=True)),
        _files(files),
    ]
    return page(title, "\n".join(filter(None, parts)))


def page(title: str, body: str) -> str:
    """A whole HTML page that fetches nothing, in the look of all reports.

    `title` is text and is escaped; `body` is HTML and stands as it is. For whoever makes a report of another kind.
    """
    before, after = around(title)
    return f"{before}{body}{after}"


def around(title: str) -> tuple[str, str]:
    """What stands before and after the body of a `page`, for whoever writes a long one piece by piece."""
    before, after = _PAGE.split(_BODY)
    return before.format(title=escape(title), policy=_POLICY, style=_STYLE), after


def _labels(results: Sequence[Result]) -> list[str]:
    """What to call each result: its mode, numbered where modes repeat."""
    names = [result.mode or "run" for result in results]
    return [f"{name} {names[: i + 1].count(name)}" if names.count(name) > 1 else name for i, name in enumerate(names)]


def _subtitle(results: Sequence[Result]) -> str:
    machines = dict.fromkeys(str(r.meta["machine"]) for r in results if r.meta.get("machine"))
    axes = dict.fromkeys(axis for result in results for axis in result.axes)
    started = [str(result.meta["started"]) for result in results if result.meta.get("started")]
    versions: dict[str, Any] = next((r.meta["versions"] for r in results if r.meta.get("versions")), {})
    said = [
        f"machine {', '.join(machines)}" if machines else "",
        f"{'axes' if len(axes) > 1 else 'axis'} {', '.join(axes)}",
        f"started {min(started)}" if started else "",
        ", ".join(f"{name} {version}" for name, version in versions.items()),
    ]
    return f'<p class="about">{escape(" · ".join(filter(None, said)))}</p>'


def _runs(results: Sequence[Result], labels: Sequence[str]) -> str:
    columns = ["run", "axes", "samples", "sample period [ms]", "length [s]", "ending", "verdict", "late samples"]
    rows = [
        [
            label,
            ", ".join(result.axes),
            len(result),
            result.sample_period * 1e3,
            result.length,
            html.ending(result) if result.meta.get("ending") else None,
            result.verdict,
            (result.meta.get("timing") or {}).get("late"),
        ]
        for result, label in zip(results, labels, strict=True)
    ]
    return html.table(columns, rows)


def _verdicts(results: Sequence[Result], labels: Sequence[str]) -> str:
    return "".join(html.verdict_line(result, label) for result, label in zip(results, labels, strict=True))


def _metrics(results: Sequence[Result], labels: Sequence[str]) -> str:
    """A table per axis: a row per metric, a column per run, so that like numbers stand side by side."""
    metrics = [axis_metrics(result) for result in results]
    tables = []
    for axis in dict.fromkeys(axis for result in results for axis in result.axes):
        rows: list[list[Any]] = []
        for key in (*ERROR_METRICS, "fit_percent"):
            having = [i for i, found in enumerate(metrics) if key in found.get(axis, {})]
            if having:
                unit = metric_units(results[having[0]], axis)[key]
                rows.append([heading(html.METRIC_TITLES[key], unit), *(m.get(axis, {}).get(key) for m in metrics)])
        if rows:
            tables.append(html.table(["", *labels], rows, f"Axis {axis}"))
    notes = dict.fromkeys(note for result in results for note in html.all_notes(result))
    return f'<div class="row">{"".join(tables)}</div>{html.notes_list(notes)}'


def _extra(table: Mapping[str, Any]) -> str:
    missing = [key for key in ("title", "columns", "rows") if key not in table]
    if missing:
        raise InputError(f"a table of the report lacks {missing[0]!r}; it needs title, columns and rows, maybe a note")
    shown = html.table(table["columns"], table["rows"], note=str(table.get("note") or ""))
    return f"<h2>{escape(str(table['title']))}</h2>{shown}"


def _together(results: Sequence[Result], labels: Sequence[str]) -> str:
    shared = [axis for axis in results[0].axes if all(f"{axis}_measured" in result for result in results)]
    if len(results) < 2 or not shared:
        return ""
    from rds.results.plots_overlay import modes

    return f"<section><h2>All runs over each other</h2>{html.image(modes(results, labels).png(), 'all runs')}</section>"


def _run_section(result: Result, label: str, pictures: Mapping[str, bytes]) -> str:
    shown = "".join(html.image(png, f"{label}: {title}") for title, png in pictures.items())
    return (
        f"<section><h2>{escape(label.capitalize())}</h2>{shown}"
        f"{_environment(result)}{_timing(result)}{_details('Controller', result.meta.get('controller'))}"
        f"{_details('Model', result.meta.get('model'))}"
        "</section>"
    )


def _environment(result: Result) -> str:
    """What the timing was measured in: the verdict means nothing without it."""
    environment = result.meta.get("environment")
    if not isinstance(environment, Mapping) or not environment:
        return ""
    said = environment.get("sentence") or " · ".join(
        f"{name.replace('_', ' ')} {html.number(value)}" for name, value in html.flat(environment)
    )
    return f'<p class="note">Ran with: {escape(str(said))}</p>{_details("Environment", environment)}'


def _timing(result: Result) -> str:
    summary = result.meta.get("timing") or {}
    keys = ("p50", "p99", "p999", "max")
    stages = {name: v for name, v in summary.items() if isinstance(v, Mapping) and "p50" in v}
    rows = [[name, *(values.get(key) for key in keys)] for name, values in stages.items()]
    return html.table(["stage", "p50 [µs]", "p99 [µs]", "p99.9 [µs]", "max [µs]"], rows) if rows else ""


def _details(title: str, values: Any) -> str:
    if not values:
        return ""
    shown = html.key_values(values) if isinstance(values, Mapping) else f"<p>{escape(html.number(values))}</p>"
    return f"<details><summary>{escape(title)}</summary>{shown}</details>"


def _link(report: Path, file: str | Path) -> str:
    return Path(os.path.relpath(Path(file).resolve(), report.resolve().parent)).as_posix()


def _files(files: Sequence[str]) -> str:
    if not files:
        return ""
    # "./" keeps a name with a colon from being taken for a scheme
    items = "".join(f'<li><a href="{escape("./" + quote(file))}">{escape(file)}</a></li>' for file in files)
    return f"<section><h2>Files</h2><ul>{items}</ul></section>"


_BODY = "{body}"
_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""

_STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --dim: #57606a; --paper: #ffffff; --line: #d0d7de; --band: #f6f8fa;
  --met: #0a6b4d; --missed: #a8410b; --void: #6a5400; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ec; --dim: #9aa4ae; --paper: #14181d; --line: #333b44;
  --band: #1c2229; --met: #4fd1a5; --missed: #ff9d66; --void: #e5c453; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1.25rem 3rem; max-width: 1280px; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
.about, .note { color: var(--dim); } .about { margin: 0 0 .8rem; } .note { margin: .35rem 0; font-size: .9rem; }
.scroll { overflow-x: auto; } .row { display: flex; flex-wrap: wrap; gap: .6rem 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { text-align: left; padding: .22rem .9rem .22rem .4rem; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; border-bottom-width: 2px; } td.number, th.number { text-align: right; }
tbody tr:nth-child(even) { background: var(--band); }
.verdict { margin: .4rem 0; padding: .35rem .7rem; border-left: 4px solid var(--line); background: var(--band); }
.verdict.met { border-color: var(--met); } .verdict.missed { border-color: var(--missed); }
.verdict.void { border-color: var(--void); }
.met strong { color: var(--met); } .missed strong { color: var(--missed); } .void strong { color: var(--void); }
pre { margin: 0; font-size: .85rem; }
img { display: block; width: 100%; height: auto; margin: .6rem 0; background: #ffffff; border-radius: 6px; }
details { margin: .5rem 0; } summary { cursor: pointer; font-weight: 600; }
@media print { body { max-width: none; padding: 0; } section { break-inside: avoid-page; } }
"""
