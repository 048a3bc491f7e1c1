"""Reports of what was measured on a machine: accuracy, moves, response times, currents, vibration, reconfiguration,
speed, flatness; return error, rapids and path error of part programs; the circular test of two axes.

One door: a kind of report, data files and options in; tables, pictures and findings out. Light to import: matplotlib
and python-can are imported by what needs them. A module of a kind has `SETTINGS`, its options by name (`Setting`),
and `report(files, settings) -> Report` (content.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.results.csv_file import description_beside
from rds.results.reports.content import Report, Table
from rds.results.reports.oacs import data_file
from rds.results.reports.settings import Setting, read_settings, settings_rows
from rds.results.reports.write import write

KINDS = Registry(
    "report",
    {
        "accuracy": "rds.results.reports.accuracy",
        "moves": "rds.results.reports.moves",
        "response": "rds.results.reports.response",
        "current": "rds.results.reports.current",
        "vibration": "rds.results.reports.vibration",
        "reconfiguration": "rds.results.reports.reconfiguration",
        "speed": "rds.results.reports.speed",
        "flatness": "rds.results.reports.flatness",
        "return-error": "rds.results.reports.return_error",
        "unsynchronized-rapids": "rds.results.reports.unsynchronized_rapids",
        "path-error": "rds.results.reports.path_error",
        "circular": "rds.results.reports.circular",
    },
    own=False,
)

__all__ = ["KINDS", "Report", "Setting", "Table", "make_report", "option_table", "options_of", "write"]


def make_report(kind: str, files: Sequence[str | Path], options: Mapping[str, str | float] | None = None) -> Report:
    """The report of this kind from data files, or from a table of oacs-thesis's appendices, as `oacs:O32`.

    `options` are those of `options_of(kind)`, as text or numbers. Raises InputError for an unknown kind or option, a
    value out of bounds, or data that can't be read: with the file, the line and the column, the value and the remedy.
    """
    module = KINDS.module(kind)
    if not files:
        raise InputError(f"a report on {kind} needs data; name at least one file")
    settings = read_settings(options or {}, module.SETTINGS, f"report {kind}")
    found = [data_file(file) for file in files]
    made: Report = module.report(found, settings)
    return replace(made, findings=[*_doubts(found), *made.findings])


def _doubts(files: Sequence[Path]) -> Iterator[str]:
    """What runs among the files say against their own readings: a report of them says the same first."""
    for file in files:
        with suppress(InputError, OSError):  # a table that nothing describes
            meta = description_beside(file)["meta"]
            if meta.get("verdict") in ("missed", "void"):
                said = (
                    f"its timing is {meta['verdict']}: samples were late or left out, and the numbers hold their effect"
                )
                yield f"{file.name}: {said}; run it again on a computer that is free"
            if meta.get("ending") not in (None, "done"):
                yield f"{file.name}: the run ended early ({meta['ending']})"


def options_of(kind: str) -> dict[str, Setting]:
    """The options of a kind of report, by name: unit, default, meaning. InputError for an unknown kind."""
    return dict(KINDS.module(kind).SETTINGS)


def option_table(kind: str) -> Table:
    """The options of a kind of report as a table, for a help text."""
    columns, rows = settings_rows(KINDS.module(kind).SETTINGS)
    return Table(f"Options of report {kind}", columns, rows)
