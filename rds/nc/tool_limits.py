"""What a tool bears: speed and feed limits, which a tool table of LinuxCNC has no words for, from its comments.

`T3 P3 D3.0 Z20 ;end mill 3 mm, max S8000 F300` says at most 8000 rev/min and 300 mm/min; either may be left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import inf
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rds.nc.tools import Tool

_MAX = re.compile(r"\bmax((?:\s+[SF]\s*\d+(?:\.\d*)?)+)", re.IGNORECASE)
_WORD = re.compile(r"([SF])\s*(\d+(?:\.\d*)?)", re.IGNORECASE)


class ToolLimits(NamedTuple):
    """The most that a tool bears; inf where nothing is said."""

    speed: float = inf  # rev/min
    feed: float = inf  # mm/min


def tool_limits(comment: str) -> ToolLimits:
    """The limits in the comment of a tool's line: after the word `max`, S in rev/min and F in mm/min."""
    found = _MAX.search(comment)
    words = {letter.upper(): float(value) for letter, value in _WORD.findall(found[1])} if found else {}
    return ToolLimits(words.get("S", inf), words.get("F", inf))


def limits_of(tools: Iterable[Tool]) -> dict[int, ToolLimits]:
    """The limits of each tool by its number."""
    return {tool.number: tool_limits(tool.comment) for tool in tools}
