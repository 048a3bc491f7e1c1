"""Options of a report: as text from a command line or as numbers, each with its unit, default and meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Quantity
from rds.results.reports.reading import BEYOND_MEASURE


@dataclass(frozen=True)
class Setting:
    """One option: its meaning, its unit ("" for text or a pure number), what it is when it isn't given."""

    meaning: str
    unit: str = ""
    default: float | str | None = None
    text: bool = False  # text rather than a number
    whole: bool = False  # a whole number
    at_least: float = -inf
    more_than: float = -inf
    at_most: float = BEYOND_MEASURE

    def read(self, value: Any, name: str, owner: str) -> float | int | str:
        """The value as what the option holds; InputError if it is no such thing."""
        if self.text:
            return str(value)
        meaning = f"{self.meaning}, in {self.unit}" if self.unit else self.meaning
        declared = Quantity(self.meaning, self.unit, low=self.at_least, above=self.more_than, whole=self.whole)
        number: float | int = declared.check(_number(value), name, owner)
        if number > self.at_most:
            raise InputError(f"{owner}: {name} = {value!r} must be at most {self.at_most:g} ({meaning})")
        if 0 < abs(number) < 1 / BEYOND_MEASURE:
            raise InputError(f"{owner}: {name} = {value!r} is too close to zero; check its unit ({meaning})")
        return number


def _number(value: Any) -> Any:
    """Text that is a number as that number; anything else as it is, for the check to refuse."""
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        return value


def read_settings(given: Mapping[str, Any], settings: Mapping[str, Setting], owner: str) -> dict[str, Any]:
    """All options of `owner`: those given, checked, and the defaults of the others (None: not known).

    Raises InputError for an unknown name or a value that will not do.
    """
    check_known(given, settings, owner)
    return {
        name: setting.read(given[name], name, owner) if name in given else setting.default
        for name, setting in settings.items()
    }


def settings_rows(settings: Mapping[str, Setting]) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows that explain the options."""
    rows = [[name, setting.unit or None, setting.default, setting.meaning] for name, setting in settings.items()]
    return ["option", "unit", "default", "meaning"], rows


def pairs_of(text: str, what: str, example: str) -> dict[str, str]:
    """`a=1, b=2` as a mapping of texts. InputError for an entry without `=`, or a name given twice."""
    found: dict[str, str] = {}
    for entry in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = (part.strip() for part in entry.partition("="))
        if not (equals and name and value):
            raise InputError(f"{what}: {entry!r} is not of the form name=value; write it as in {example!r}")
        if name in found:
            raise InputError(f"{what}: {name!r} is given twice; give it once")
        found[name] = value
    return found
