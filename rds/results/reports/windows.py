"""Parts of a record of readings, named by the first and last reading of each (counted from 1)."""

from __future__ import annotations

import re
from typing import NamedTuple

from rds.core.errors import InputError
from rds.results.reports.settings import pairs_of

EXAMPLE = "rest=1-5, drilling=60-180"
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)")


class Window(NamedTuple):
    """Readings `first` to `last`, both included, counted from 1."""

    name: str
    first: int
    last: int

    @property
    def part(self) -> slice:
        """The readings of this window, for indexing."""
        return slice(self.first - 1, self.last)


def parse_windows(text: str | None, readings: int, where: str) -> list[Window]:
    """Windows from a text such as 'rest=1-5, drilling=60-180'.

    Raises InputError for one that is none, has fewer than two readings or is not within the `readings` of the file.
    """
    windows = []
    for name, span in pairs_of(text or "", "windows", EXAMPLE).items():
        match = _RANGE.fullmatch(span)
        if match is None:
            raise InputError(f"windows: {name} = {span!r} is not a range of readings; write it as in {EXAMPLE!r}")
        first, last = int(match[1]), int(match[2])
        if not 1 <= first < last <= readings:
            raise InputError(
                f"windows: {name} = {span!r} must have at least two of the readings 1 to {readings}, in order", where
            )
        windows.append(Window(name, first, last))
    return windows
