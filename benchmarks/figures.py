"""What a benchmark hands back: figures with a unit and, where there is one, a target."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

TITLES = ("figure", "measured", "least", "most", "target", "")


@dataclass(frozen=True)
class Figure:
    """One measured number: the median of `runs`; with a target, it is met by a value of at most `limit`."""

    name: str
    unit: str = ""
    runs: tuple[float, ...] = ()
    limit: float | None = None
    note: str = ""  # why there is no number, or what the target is made of

    @property
    def value(self) -> float | None:
        """The median of the runs; None where there was none."""
        return median(self.runs) if self.runs else None

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None where there is no target or no number."""
        return None if self.value is None or self.limit is None else self.value <= self.limit

    def cells(self) -> list[str]:
        """Its row of a table with the columns `TITLES`."""
        if self.value is None:
            return [self.name, "–", "", "", "", self.note or "skipped"]
        target = "" if self.limit is None else f"≤ {_number(self.limit)}"
        verdict = {True: "met", False: "NOT MET", None: ""}[self.met]
        remark = ", ".join(part for part in (verdict, self.note) if part)
        least_most = [_number(min(self.runs)), _number(max(self.runs))] if len(self.runs) > 1 else ["", ""]
        return [self.name, f"{_number(self.value)} {self.unit}", *least_most, target, remark]

    def to_json(self) -> dict[str, Any]:
        """As a plain dict."""
        return asdict(self) | {"value": self.value, "met": self.met}


def interleaved(runs: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, tuple[float, ...]]:
    """The results of each function over `rounds` rounds in which all take their turn: drift strikes them alike."""
    results: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            results[name].append(run())
    return {name: tuple(values) for name, values in results.items()}


def ratios(ours: Sequence[float], theirs: Sequence[float]) -> tuple[float, ...]:
    """Round by round."""
    return tuple(a / b for a, b in zip(ours, theirs, strict=True))


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
