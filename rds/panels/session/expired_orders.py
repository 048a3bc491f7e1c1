"""Orders that move a machine are refused once they are old: whoever gave one has stopped expecting it."""

from __future__ import annotations

from math import isfinite

LATE = 3.0  # s from the press of a button to the motion


def refusal(what: str, age: float, moved: bool = False) -> str:
    """Why an order was not carried out that was given `age` s ago; infinite where nobody knows.

    It was given by a press, or, where something was `moved`, by a slider.
    """
    when = f"{age:.0f} s ago" if isfinite(age) else "too long ago"
    was, again = ("moved", "move it again") if moved else ("pressed", "press it again")
    return f"{what} was {was} {when}, while this page was busy, and is not carried out any more; {again}"
