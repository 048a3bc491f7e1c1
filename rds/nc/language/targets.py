"""Where the axis words of a block lead to."""

from __future__ import annotations

import math

from rds.nc.language.blocks import AXES
from rds.nc.language.context import Context, given, rotate
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import minus, plus
from rds.nc.language.state import State


def target(state: State, words: dict[str, float]) -> list[float]:
    """Where the axis words lead to from the present position."""
    end = [state.x, state.y, state.z, state.a, state.b, state.c]
    if state.absolute:
        for index, letter in enumerate(AXES):
            if letter in words:
                end[index] = words[letter]
    else:
        for index, letter in enumerate(AXES):
            if letter in words:
                end[index] += words[letter]
    if "@" in words or "^" in words:
        _polar(state, words, end)
    return end


def _polar(state: State, words: dict[str, float], end: list[float]) -> None:
    """@ (radius) and ^ (angle) about the origin of the coordinates instead of X and Y; in G91 both count from the
    tool's place. Raises Fault.
    """
    key = "@" if "@" in words else "^"
    x, y = end[0], end[1]
    if x == 0.0 and y == 0.0 and (not state.absolute or "^" not in words):
        raise Fault(f"{key} counts from the tool's place, which is the origin; write X and Y, or @ and ^", key)
    if state.absolute:
        radius = words["@"] if "@" in words else math.hypot(y, x)
        angle = words["^"] * math.pi / 180.0 if "^" in words else math.atan2(y, x)
        end[0], end[1] = radius * math.cos(angle), radius * math.sin(angle)
        return
    if "@" in words:
        angle, radius = math.atan2(y, x), math.hypot(y, x) + words["@"]
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    if "^" in words:
        angle, radius = math.atan2(y, x) + words["^"] * math.pi / 180.0, math.hypot(y, x)
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    end[0], end[1] = x, y


def in_machine_coordinates(m: Context, words: dict[str, float]) -> list[float]:
    """G53: the axis words are positions in the machine's coordinates; other axes stay where they are."""
    state = m.state
    for letter in "@^":
        if letter in words:
            raise Fault(f"{letter} does not go with G53; write X and Y", letter)
    end = plus(state.position(), state.axis_offset)
    rotate(end, state.rotation)
    for index, value in given(words):
        tool = state.tool_offset[index] if index < 3 else 0.0
        end[index] = value - state.origin[index] - tool
    rotate(end, -state.rotation)
    end = minus(end, state.axis_offset)
    for index, value in enumerate(state.position()):
        if index > 1 and AXES[index] not in words:
            end[index] = value
    return end
