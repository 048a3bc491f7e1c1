"""Finding a student's line in a gradebook that the instructor has downloaded."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rds.core.errors import InputError
from rds.grading.feedback.plain_text import one_line
from rds.grading.grade import LISTED, Grade
from rds.grading.intake.names import compared
from rds.grading.table_text import delimiter

_LARGEST = 64 << 20  # bytes
_MOST_NAMES = 10
_MARK = "\ufeff"  # byte order mark
Row = list[str]


@dataclass(frozen=True)
class Sheet:
    """A gradebook as it was downloaded: headings and rows, each as long as the headings."""

    columns: Row
    rows: list[Row]
    has_mark: bool  # whether it begins with a byte order mark
    form: tuple[str, str] = ("utf-8", ",")  # its encoding, and what stands between cells
    quotes_all: bool = False  # every cell, not only those that need it

    def at(self, column: str) -> int | None:
        """The place of a column, whatever its capitals; None if there is none."""
        names = [name.strip().casefold() for name in self.columns]
        wanted = column.strip().casefold()
        return names.index(wanted) if wanted in names else None

    def to_bytes(self) -> bytes:
        """As it came, every cell as it is: it is the platform's own."""
        stream = io.StringIO()
        encoding, delimiter = self.form
        writer = csv.writer(
            stream,
            delimiter=delimiter,
            lineterminator="\r\n",
            quoting=csv.QUOTE_ALL if self.quotes_all else csv.QUOTE_MINIMAL,
        )
        writer.writerows([self.columns, *self.rows])
        return (_MARK if self.has_mark else "").encode(encoding) + stream.getvalue().encode(encoding)


def read_sheet(path: Path) -> Sheet:
    """The CSV file at `path`. InputError if it is none."""
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"has more than {_LARGEST} bytes; name the gradebook as it was downloaded", str(path))
        data = path.read_bytes()
        encoding = "utf-16-le" if data.startswith(_MARK.encode("utf-16-le")) else "utf-8"
        text = data.decode(encoding)
        has_mark, text = text.startswith(_MARK), text.removeprefix(_MARK)
        separator = delimiter(text)
        rows = [row for row in csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator) if any(row)]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; name the gradebook's CSV file", str(path)) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is no CSV file in UTF-8 ({error}); download it once more", str(path)) from error
    if not rows:
        raise InputError("is empty; download it once more", str(path))
    width = len(rows[0])
    if any(len(row) > width and any(row[width:]) for row in rows):
        raise InputError("has rows that are longer than its headings; download it once more", str(path))
    return Sheet(rows[0], [(row + [""] * width)[:width] for row in rows[1:]], has_mark, (encoding, separator))


@dataclass(frozen=True)
class Key:
    """One way to know a student: a column of the sheet, and what a grade says that must be there.

    `of_row` changes a cell before it is compared; what is empty is never compared.
    """

    column: str
    of_grade: Callable[[Grade], Iterable[str]]
    of_row: Callable[[str], str] = str


def find(grades: Sequence[Grade], sheet: Sheet, keys: Sequence[Key]) -> tuple[dict[int, Grade], dict[str, str]]:
    """Grades by row of the sheet, and by student why there is no row for him.

    The first key that finds a row decides. Several rows, or two students for one row, are never guessed at.
    """
    tables = [(key, _by_cell(sheet, key)) for key in keys if sheet.at(key.column) is not None]
    found: dict[int, list[Grade]] = {}
    unmatched: dict[str, str] = {}
    for grade in grades:
        rows, column = _rows_of(grade, tables)
        if len(rows) == 1:
            found.setdefault(rows[0], []).append(grade)
        elif rows:
            unmatched[grade.student] = f"{len(rows)} lines of the gradebook have the same {column}"
        else:
            unmatched[grade.student] = "no line of the gradebook is this student's"
    for row, several in list(found.items()):
        if len(several) > 1:
            for grade in several:
                others = ", ".join(other.student for other in several if other is not grade)
                unmatched[grade.student] = f"the same line of the gradebook would be {others}'s"
            del found[row]
    return {row: several[0] for row, several in found.items()}, unmatched


def _by_cell(sheet: Sheet, key: Key) -> Mapping[str, list[int]]:
    at, table = sheet.at(key.column), {}  # type: tuple[int | None, dict[str, list[int]]]
    assert at is not None  # by `find`
    for number, row in enumerate(sheet.rows):
        if value := compared(key.of_row(row[at])):
            table.setdefault(value, []).append(number)
    return table


def _rows_of(grade: Grade, tables: Sequence[tuple[Key, Mapping[str, list[int]]]]) -> tuple[list[int], str]:
    # by the class list's identifier in every column, before what was handed in may be another student's name in one
    for called in dict.fromkeys((identifiers(grade)[0], grade.student)):
        known = replace(grade, student=called)
        for key, table in tables:
            for value in key.of_grade(known):
                if rows := table.get(compared(key.of_row(value))):
                    return rows, key.column
    return [], ""


def unknown(sheet: Sheet, known: Collection[int], column: str) -> tuple[str, ...]:
    """A note on the students of the gradebook who are not `known`, by row; `column` has their names."""
    at = sheet.at(column) or 0
    names = [one_line(row[at], 60) for number, row in enumerate(sheet.rows) if number not in known]
    if not names:
        return ()
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return (
        f"{len(names)} of the gradebook have no grade here, and their cells stay as they are: "
        f"{'; '.join(names[:_MOST_NAMES])}{more}. Give `rds grade run` the class list, and it is 0",
    )


def identifiers(grade: Grade) -> list[str]:
    """The student's identifiers: that of the class list first, where it has the student; then that of what came in."""
    return list(dict.fromkeys((str(grade.details.get(LISTED) or grade.student), grade.student)))


def names_here(grades: Iterable[Grade]) -> dict[str, str]:
    """What a gradebook without an instructor's own file calls each student: the class list's identifier where it is
    one student's, else that of what was handed in.
    """
    best = {grade.student: identifiers(grade)[0] for grade in grades}
    while several := [name for name, count in Counter(best.values()).items() if count > 1]:
        best = {student: student if name in several else name for student, name in best.items()}
    return best


def source(grade: Grade, *names: str) -> list[str]:
    """What the export from which the submission came says of the student, where it does."""
    about = grade.details.get("source")
    if not isinstance(about, Mapping):
        return []
    return [str(about[name]) for name in names if about.get(name)]


def platform(grade: Grade, name: str, *names: str) -> list[str]:
    """As `source`, of submissions that came from the platform called `name`."""
    return source(grade, *names) if source(grade, "platform") == [name] else []
