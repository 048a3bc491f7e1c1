"""What a tool bears, by the comment of its line in the tool table."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import inf
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rds.nc.language.tools import Tool

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
