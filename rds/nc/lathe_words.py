"""Words that turn on lathes of other controls (Fanuc's, type A) and mean something else here: told, not refused.

`G90 X14 Z-15 F0.2` cuts there, and goes back by itself; here it is one move, at rapid after G0, through the work.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

_SILENT = re.compile(r"\([^()]*\)|;.*|[ \t\r\n]")
_CYCLE = re.compile(r"g0*9(0|2|4)(?![0-9.])")
_ENDS = re.compile(r"[xz][-+0-9.#\[]")
_FEED = re.compile(r"f[-+0-9.#\[]")
_MOVES = re.compile(r"g0*(?:[0-5]|28|30|33|38|53|7[0-9]|8[0-9])(?![0-9])")
_FEED_MODE = re.compile(r"g0*9(8|9)(?![0-9.])")
_DRILLS = re.compile(r"g0*(?:73|8[1-9])(?![0-9])")

_CYCLES = {
    "0": "turns along Z, and goes back; here it is the move in force before, once (at rapid after G0)",
    "2": "cuts a thread; here it sets the origin and moves nothing",
    "4": "faces, and goes back; here it is the move in force before, once (at rapid after G0)",
}
_FEED_MODES = {
    "8": "is feed per minute on Fanuc's lathes, and here where canned cycles retract to; write G94",
    "9": "is feed per revolution on Fanuc's lathes, and here where canned cycles retract to; write G95",
}


def meant_otherwise(program: Iterable[str]) -> Iterator[tuple[int, str, str]]:
    """Line, word, and what to know of it, of the lines of a lathe's program."""
    feeds: list[tuple[int, str, str]] = []
    drills = False
    for line, raw in enumerate(program, start=1):
        text = _SILENT.sub("", raw.lower())
        drills = drills or _DRILLS.search(text) is not None
        cycle = _CYCLE.search(text)
        if cycle and _ENDS.search(text) and _FEED.search(text) and not _MOVES.search(text):
            said = f"with X or Z and F, G9{cycle[1]} on Fanuc's lathes {_CYCLES[cycle[1]]}"
            yield line, f"G9{cycle[1]}", f"{said}; write the cuts as G0 and G1, or by G71 or G76"
        if not feeds and (mode := _FEED_MODE.search(text)):
            feeds.append((line, f"G9{mode[1]}", f"G9{mode[1]} {_FEED_MODES[mode[1]]}"))
    if not drills:
        yield from feeds
