"""What a distributed module says of itself, and its tuning, as tables with units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.bus.oacs.pid import MEANINGS
from rds.console import cell, show_table


def show_info(found: Mapping[str, Any]) -> None:
    """The download and the tuning, as `module.info().as_dict()` has them."""
    unit = found["unit"]
    units = dict.fromkeys(("accuracy", "repeatability", "lowest", "highest", "initial"), unit)
    units |= {"counts_per_unit": f"counts/({unit})" if "/" in unit else f"counts/{unit}", "supply": "V"}
    speed = unit if unit == "rev/min" else f"{unit}/min"
    units |= dict.fromkeys(("least_speed", "clockwise_speed", "counterclockwise_speed"), speed)
    left = {"number", "unit", "matrix", "tuning"}
    rows = [
        [name.replace("_", " "), cell("–" if value == "" else value), units.get(name, "")]
        for name, value in found.items()
        if name not in left
    ]
    show_table(f"Module {found['number']}", ["what", "value", "unit"], rows)
    matrix = [[cell(value) for value in row] for row in found["matrix"]]
    moved = {"": "nothing moves it", **{j: f"the axis shifts along {j}" for j in "xyz"}}
    moved |= {j: f"the axis turns about {about}" for j, about in zip("abc", "xyz", strict=True)}
    note = f"From one interface to the next with the axis at zero; {moved[found['joint']]}."
    show_table("Transformation matrix", ["x", "y", "z", "shift [mm]"], matrix, note)
    show_tuning(found["tuning"])


def show_tuning(values: Mapping[str, Any]) -> None:
    """The tuning in force, by name."""
    rows = [[name, cell(value), *MEANINGS.get(name, ("", ""))] for name, value in values.items()]
    show_table("Tuning", ["parameter", "value", "unit", "meaning"], rows)
