"""What a report holds: tables of numbers, pictures that are drawn when asked for, findings as sentences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rds.results.plain import plain

if TYPE_CHECKING:
    from rds.core.figure import Picture

Drawing = Callable[[], "Picture"]


@dataclass(frozen=True)
class Table:
    """A table: headings with units, rows of numbers and texts in full precision (None: not known)."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    note: str = ""
    digits: Mapping[str, int] = field(default_factory=dict)  # decimals to show, by heading; others: four significant

    def shown(self) -> list[list[Any]]:
        """The rows as they are to be read: numbers of columns with `digits` as text with so many decimals."""
        return [
            [_shown(cell, self.digits.get(column)) for column, cell in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def column(self, heading: str) -> list[Any]:
        """The cells below a heading; ValueError if the table has none such."""
        at = list(self.columns).index(heading)
        return [row[at] for row in self.rows]

    def to_json(self) -> dict[str, Any]:
        """`{title, columns, rows, note}` in types that JSON knows."""
        return {
            "title": self.title,
            "columns": list(self.columns),
            "rows": plain([list(row) for row in self.rows], self.title),
            "note": self.note,
        }


def _shown(cell: Any, decimals: int | None) -> Any:
    if decimals is None or isinstance(cell, bool) or not isinstance(cell, int | float):
        return cell
    return f"{cell:.{decimals}f}"


@dataclass(frozen=True)
class Report:
    """What was measured, said three ways: tables, pictures, sentences."""

    kind: str
    title: str
    sources: Sequence[str]  # names of the data files
    settings: Mapping[str, Any]
    tables: Sequence[Table]
    figures: Mapping[str, Drawing]  # name -> draws the picture
    findings: Sequence[str]
    links: Mapping[str, str] = field(default_factory=dict)  # what is said of them -> files beside the page

    def table(self, title: str) -> Table:
        """The table with this title; KeyError if there is none."""
        for table in self.tables:
            if table.title == title:
                return table
        raise KeyError(title)

    def to_json(self) -> dict[str, Any]:
        """The report without its pictures, in types that JSON knows."""
        return {
            "kind": self.kind,
            "title": self.title,
            "sources": list(self.sources),
            "settings": plain({name: value for name, value in self.settings.items() if value is not None}, self.kind),
            "tables": [table.to_json() for table in self.tables],
            "figures": list(self.figures),
            "findings": list(self.findings),
        }
