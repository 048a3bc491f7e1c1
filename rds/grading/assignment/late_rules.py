"""What a late submission loses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from math import ceil, inf

from rds.core.toml_table import TomlTable

_DAY = 86_400.0  # s
_DIGITS = 9  # of days, a tenth of a millisecond: with less, rounding would cost a day that ends to the second


@dataclass(frozen=True)
class LateRules:
    """Each day that has begun after `due` and the hours of grace costs `percent_per_day` of the points earned.

    The loss is at most `cap_percent`. After `zero_after_days` days nothing is left. Within the grace nothing is lost;
    after it, days count from `due` itself. `free_days` of them cost nothing: late days that a student may spend here.
    """

    percent_per_day: float = 0.0
    grace_hours: float = 0.0
    cap_percent: float = 100.0
    zero_after_days: float = inf
    free_days: int = 0

    def spent(self, days: float, left: int | None = None) -> int:
        """Late days that are spent after `days` days, of those that the student has `left` (None: nobody counts)."""
        if self._is_in_time(days) or days > self.zero_after_days:
            return 0
        free = self.free_days if left is None else min(self.free_days, left)
        return min(free, ceil(days))

    def lost(self, days: float, left: int | None = None) -> float:
        """The share of the points that is lost after `days` days, 0 to 1; `left` as in `spent`."""
        if self._is_in_time(days):
            return 0.0
        if days > self.zero_after_days:
            return 1.0
        charged = ceil(days) - self.spent(days, left)
        return min(self.percent_per_day * charged, self.cap_percent) / 100.0

    def _is_in_time(self, days: float) -> bool:
        return days <= round(self.grace_hours / 24.0, _DIGITS)

    def to_table(self) -> Mapping[str, float]:
        """As the words of an assignment."""
        return {key: value for key, value in vars(self).items() if value != inf}


def days_late(due: datetime | None, submitted: datetime | None) -> float:
    """Days from `due` to `submitted`, both with their time zone; 0 where either is unknown, or in time."""
    if due is None or submitted is None:
        return 0.0
    return moved((submitted - due).total_seconds() / _DAY, 0.0)


def told_days(days: float, digits: str = ".3g") -> str:
    """Days late in words: '1.25 days', and what is less than an hour in minutes or seconds."""
    seconds = days * _DAY
    if seconds < 3600.0:
        return f"{seconds:.0f} s" if seconds < 60.0 else f"{seconds / 60.0:.0f} min"
    return f"{days:{digits}} days"


def moved(days: float, extension: float) -> float:
    """Days late where the due time is `extension` days later; 0 in time."""
    return max(0.0, round(days - extension, _DIGITS))


def read_late_rules(words: TomlTable | None) -> LateRules:
    """The table `[late]`; without one nothing is lost. InputError for a word or value that will not do."""
    if words is None:
        return LateRules()
    late = LateRules(**{key: words.read(key) for key in LateRules.__dataclass_fields__})
    words.done()
    return late
