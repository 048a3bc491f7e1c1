"""The stock of a program for the picture of the machine: as large as what it cuts, with room for the tool."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.nc.active import modes_at
from rds.nc.language.errors import ProgramError
from rds.nc.trace import CURVED, STRAIGHT
from rds.panels.program.check import Look
from rds.panels.program.state import Program
from rds.panels.scene.scene import TOOL

_BELOW = 3.0  # mm of stock below the deepest cut
_LEAST = 0.01  # mm: what does not go so deep below the top cuts nothing


def tool_of(look: Look, program: Program) -> dict[str, Any]:
    """Diameter (mm) of the first tool of the program, and whether its end is a ball, which the table's remark says."""
    numbers = [modes.tool for modes in look.modes.values() if modes.tool]
    try:
        tools = {tool.number: tool for tool in program.setup().tool_list()}
    except ProgramError:
        tools = {}
    tool = tools.get(numbers[0]) if numbers else None
    if tool is None or not tool.diameter > 0.0:
        return {"diameter": TOOL, "ball": False}
    return {"diameter": tool.diameter, "ball": "ball" in tool.comment.lower()}


def cutting_path(look: Look) -> np.ndarray:
    """The moves that cut, as points (n, 3), mm, with nan rows between polylines."""
    points = look.trace.points
    gap = np.full((1, 3), np.nan)
    return np.concatenate([points[STRAIGHT], gap, points[CURVED]])


def stock_of(look: Look, program: Program, diameter: float) -> dict[str, Any]:
    """Low and high corner in machine coordinates, mm; nothing where the program cuts nothing below the work's zero."""
    cuts = cutting_path(look)
    cuts = cuts[~np.isnan(cuts[:, 0])]
    rotary = any(axis.unit == "deg" for axis in program.machine.axes.values())
    if not len(cuts) or look.trace.of_tip or rotary:
        return {}
    modes = modes_at(look.modes, max(look.modes, default=0))
    top = 0.0 if modes is None else modes.origin[2] + modes.g92[2] + modes.tool_offset[2]
    low, high = cuts.min(axis=0), cuts.max(axis=0)
    if not low[2] < top - _LEAST:
        return {}
    room = 0.75 * diameter
    return {
        "low": [float(low[0] - room), float(low[1] - room), float(low[2] - _BELOW)],
        "high": [float(high[0] + room), float(high[1] + room), float(top)],
    }
