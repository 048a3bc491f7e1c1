"""Tables that people hand over, as their spreadsheet saved them: cut at `,`, at `;`, as in Germany, or at tabs."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from rds.core.errors import InputError


def delimiter(text: str) -> str:
    """What separates the cells of a table: what its first line has most of."""
    head = text.partition("\n")[0]
    return max(",;\t", key=head.count)


def read_table(path: Path, largest: int, what: str, called: str) -> str:
    """The text of a table of `what` of at most so many bytes, which messages call `called`. InputError for another."""
    try:
        if path.stat().st_size > largest:
            raise InputError(f"has more than {largest} bytes; name a table of {what}", str(path))
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; name the {called}", str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("is no text in UTF-8; save it as CSV UTF-8", str(path)) from error


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
