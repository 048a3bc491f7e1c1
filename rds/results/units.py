"""The usual unit of a column, and its name as a heading."""

from __future__ import annotations

import re

_WHOLE = {"time": "s", "lateness": "µs", "io": "µs", "interpolate": "µs", "compute": "µs", "model": "µs"}
_ENDINGS = {
    "_reference": "mm",
    "_reference_velocity": "mm/s",
    "_reference_acceleration": "mm/s²",
    "_measured": "mm",
    "_modelled": "mm",
    "_simulated": "mm",
    "_command": "V",
    "_voltage": "V",
    "_plant_velocity": "mm/s",
    "_plant_current": "A",
}
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")

_INDEX = re.compile(r"\d+(\.\d+)?")


def default_unit(name: str) -> str:
    """The unit that a column called `name` has when nothing else is said; "" for an unknown name."""
    if name in _WHOLE:
        return _WHOLE[name]
    return next((unit for ending, unit in _ENDINGS.items() if name.endswith(ending)), "")


def heading(name: str, unit: str) -> str:
    """`name [unit]`, or the name alone for a pure number."""
    return f"{name} [{unit}]" if unit else name


def split_heading(text: str) -> tuple[str, str | None]:
    """Name and unit of a heading such as `time [s]` or `time (s)`; None where it gives no unit."""
    match = _HEADING.fullmatch(text.strip())
    if match and _INDEX.fullmatch(match["unit"]) and (match["unit"] != "1" or text.strip()[len(match["name"])] != " "):
        match = None  # `output[0]` and `FPOS(1)` are names with a number, and `duty [1]` has a unit
    return (match["name"], match["unit"].strip()) if match else (text.strip(), None)
