"""The fields of a path's motion: planned within the axes' limits, or made by an interpolator while it runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rds.interpolators import interpolator_names
from rds.panels.interpolator.fields import USER, filter_fields, filter_words
from rds.panels.session.fields import Choice, Field, Text

PLANNED = "planned"
ARC_FILE = "arc_interpolator_file"
OWN = ("interpolator_file", ARC_FILE)  # files of one's own
MADE = ("acceleration", "acceleration_time", "exact_stop")  # choices about an interpolator


def motion_fields() -> Iterable[Field]:
    """Who makes the samples, the file of an own interpolator, and the filter on top of one."""
    methods = {name: name.replace("-", " ") for name in interpolator_names()}
    yield Choice(
        "interpolator",
        "Motion",
        "planned within the axes' limits, or made by an interpolator in the loop, sample by sample",
        PLANNED,
        {PLANNED: "planned"} | methods | {USER: "user-defined interpolator"},
    )
    yield Text("interpolator_file", "Interpolator's file", "a Python file with interpolate()", "", "my_interpolator.py")
    tip = "a Python file with interpolate() for arcs; empty: the file above takes lines and arcs"
    yield Text(ARC_FILE, "Another file for arcs", tip, "", "e.g. my_arcs.py")
    yield from filter_fields("s-shape", 0.1)


def idle_motion(chosen: Mapping[str, Any]) -> set[str]:
    """The names of those that say nothing, as it is chosen."""
    name = chosen["interpolator"]
    idle = set() if name == USER else set(OWN)
    if name == PLANNED:
        return idle | set(MADE)
    return idle | ({"acceleration_time", "exact_stop"} if filter_words(chosen) is None else set())


def filter_of(chosen: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of the filter on top of an interpolator: `acceleration` and `exact_stop`."""
    words = filter_words(chosen)
    return {"acceleration": words, "exact_stop": words is not None and bool(chosen["exact_stop"])}
