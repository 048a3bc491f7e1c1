"""Tables that people hand over, as their spreadsheet saved them: cut at `,`, at `;`, as in Germany, or at tabs."""

from __future__ import annotations

import csv
import io

from rds.core.errors import InputError


def delimiter(text: str) -> str:
    """What separates the cells of a table: what its first line has most of."""
    head = text.partition("\n")[0]
    return max(",;\t", key=head.count)


def rows_by_heading(text: str, place: str) -> csv.DictReader[str]:
    """The rows of a table by its headings. InputError with the line at `place` where it cannot be cut into cells."""
    separator = delimiter(text)
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        for _ in rows:
            pass
    except csv.Error as error:
        said = f"cannot be cut into cells ({error}); look for a quotation mark that is not closed"
        raise InputError(said, f"{place}: line {rows.line_num}") from error
    return csv.DictReader(io.StringIO(text, newline=""), delimiter=separator)
