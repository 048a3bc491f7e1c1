"""A report as files: a CSV file per table, a PNG file per picture, one HTML page that holds all."""

from __future__ import annotations

import csv
import io
import re
from html import escape
from pathlib import Path
from urllib.parse import quote

from rds.core.atomic import write_files
from rds.results import html
from rds.results.html import image
from rds.results.report import page
from rds.results.reports.content import Report, Table


def write(report: Report, folder: str | Path) -> list[Path]:
    """Write the report into `folder` (made if missing); all files appear together or none does.

    Returns the paths, the page first. Raises InputError where the system refuses to write.
    """
    folder = Path(folder)
    pictures = {name: draw().png() for name, draw in report.figures.items()}
    contents = {folder / f"{report.kind}.html": to_html(report, pictures).encode("utf-8", "backslashreplace")}
    for name, table in _named(report).items():
        contents[folder / f"{name}.csv"] = _csv(table)
    for name, png in pictures.items():
        contents[folder / f"{report.kind}-{slug(name)}.png"] = png
    write_files(contents)
    return list(contents)


def to_html(report: Report, pictures: dict[str, bytes]) -> str:
    """The report as one HTML page that fetches nothing; `pictures` are PNG files by name."""
    settings = {name: value for name, value in report.settings.items() if value is not None}
    findings = "".join(f"<li>{escape(finding)}</li>" for finding in report.findings)
    parts = [
        f'<header><h1>{escape(report.title)}</h1><p class="about">{escape(" · ".join(report.sources))}</p></header>',
        f"<section><h2>Findings</h2><ul>{findings}</ul></section>" if findings else "",
        *(
            f"<section><h2>{escape(table.title)}</h2>{html.table(table.columns, table.shown(), note=table.note)}"
            "</section>"
            for table in report.tables
        ),
        *(f"<section><h2>{escape(name)}</h2>{image(png, name)}</section>" for name, png in pictures.items()),
        _links(report),
        f"<details><summary>Options</summary>{html.key_values(settings)}</details>" if settings else "",
    ]
    return page(report.title, "\n".join(filter(None, parts)))


def slug(text: str) -> str:
    """`text` as a part of a file's name: letters, digits, `-`."""
    return re.sub(r"[^0-9A-Za-z]+", "-", text).strip("-").lower() or "unnamed"


def _links(report: Report) -> str:
    if not report.links:
        return ""
    # "./" keeps a name with a colon from being taken for a scheme
    items = "".join(
        f'<li><a href="{escape("./" + quote(file))}">{escape(file)}</a>: {escape(said)}</li>'
        for said, file in report.links.items()
    )
    return f"<section><h2>Beside this page</h2><ul>{items}</ul></section>"


def _named(report: Report) -> dict[str, Table]:
    """The tables by file name; a number where two titles would make the same."""
    named: dict[str, Table] = {}
    for table in report.tables:
        stem = f"{report.kind}-{slug(table.title)}"
        name, count = stem, 1
        while name in named:
            count += 1
            name = f"{stem}-{count}"
        named[name] = table
    return named


def _csv(table: Table) -> bytes:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(["" if cell is None else cell for cell in row] for row in table.to_json()["rows"])
    return stream.getvalue().encode("utf-8")
