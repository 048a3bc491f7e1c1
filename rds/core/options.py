"""Options that users give by name: what each may be, and the sentence that says why a value will not do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from math import inf, isfinite, isnan, nan
from numbers import Real
from typing import Any

from rds.core.errors import InputError


@dataclass(frozen=True)
class Option:
    """A number that a user may give: what it means (with its unit) and its bounds."""

    meaning: str
    at_least: float = -inf
    more_than: float = -inf
    infinite: bool = False  # whether +inf is a sensible value

    def check(self, value: Any, name: str, owner: str) -> float:
        """The value as a float; InputError with the value and the remedy if it is no number within the bounds."""
        place = f"{owner}: {name} = {value!r}"
        if isinstance(value, bool) or not isinstance(value, Real):
            raise InputError(f"{place} must be a number ({self.meaning})")
        try:
            number = float(value)
        except OverflowError:  # an int of hundreds of digits
            number = nan
        if isnan(number) or not (isfinite(number) or (self.infinite and number == inf)):
            raise InputError(f"{place} must be a finite number ({self.meaning})")
        if number < self.at_least:
            raise InputError(f"{place} must be at least {self.at_least:g} ({self.meaning})")
        if number <= self.more_than:
            raise InputError(f"{place} must be more than {self.more_than:g} ({self.meaning})")
        return number


def check_known(given: Iterable[str], known: Iterable[str], owner: str) -> None:
    """InputError naming the first option that `owner` does not have, and listing those that it has."""
    table = list(known)
    for name in given:
        if name not in table:
            has = f"it has {', '.join(table)}" if table else "it has none"
            close = get_close_matches(str(name), table, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise InputError(f"{owner} has no option {name!r}; {has}{hint}")


def read_options(given: Mapping[str, Any], options: Mapping[str, Option], owner: str) -> dict[str, float]:
    """The options that were given, as checked floats. Raises InputError for an unknown name or a bad value."""
    check_known(given, options, owner)
    return {name: options[name].check(value, name, owner) for name, value in given.items()}
