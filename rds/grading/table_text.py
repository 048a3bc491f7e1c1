"""Tables that people hand over, as their spreadsheet saved them: cut at `,`, at `;`, as in Germany, or at tabs."""

from __future__ import annotations

import csv
import io


def delimiter(text: str) -> str:
    """What separates the cells of a table: what its first line has most of."""
    head = text.partition("\n")[0]
    return max(",;\t", key=head.count)


def rows_by_heading(text: str) -> csv.DictReader[str]:
    """The rows of a table by its headings."""
    return csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter(text))
