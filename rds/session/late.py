"""Orders that move a machine are refused once they are old: whoever gave one has stopped expecting it."""

from __future__ import annotations

from math import isfinite

LATE = 3.0  # s from the press of a button to the motion
STILL = ("simulation", "emulation")  # modes of a run in which nothing moves: it may begin late


def refusal(what: str, age: float) -> str:
    """Why an order was not carried out that was given `age` s ago; infinite where nobody knows."""
    when = f"{age:.0f} s ago" if isfinite(age) else "too long ago"
    return f"{what} was pressed {when}, while this page was busy, and is not carried out any more; press it again"
