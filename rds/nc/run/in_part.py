"""A program begun at one of its lines, and one that waits after each of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.shared_quantities import TIED_FEED
from rds.interpolators.motion.segments import AXES, EXACT_STOP, JOINTS, line
from rds.modes.loop.program import STEP, Program, ProgramEvent
from rds.nc.path_block import Event, PathBlock

_KEPT = ("tool", "spindle", "coolant", "override")  # events of what was left out that hold at the line where it begins
_FASTEST = 1e3  # mm/s; a rapid move has the axes' own speeds


def from_line(blocks: Iterable[PathBlock], begin: int, file: Path) -> Iterator[PathBlock]:
    """The motion from the first move on that line `begin`, or a later one, of `file` makes.

    All before it is left out but the tool, the spindle, the coolant and the lock of the override that hold there. The
    axes go from 0 to where that move begins: up to the highest point so far, across, and down, at the move's feed where
    it cuts. InputError where no move comes there, or it moves the tool's tip (G43.4).
    """
    top, last, latest = 0.0, 0, dict[str, Event]()
    given = iter(blocks)
    for block in given:
        own = not block.file or Path(block.file).name == file.name
        moves = block.segments["line"] >= begin if own else np.zeros(len(block), bool)
        at = int(moves.argmax()) if moves.any() else len(block)
        for event in block.events:
            if event.kind in _KEPT and (event.after < at - 1 or (event.after == at - 1 and event.line < begin)):
                latest[event.kind] = event
        if at:
            top = max(top, float(block.segments["start"][:at, 2].max()), float(block.segments["end"][:at, 2].max()))
            last = max(last, int(block.segments["line"][:at].max())) if own else last
        if at < len(block):
            yield _approach(block.segments[at], top, latest, block.tool)
            events = [
                event._replace(after=event.after - at)
                for event in block.events
                if event.after >= at or (event.after == at - 1 and event.line >= begin)
            ]
            feed_lines = block.feed_lines[at:] if len(block.feed_lines) else block.feed_lines
            yield replace(block, segments=block.segments[at:], events=events, feed_lines=feed_lines)
            yield from given
            return
    raise InputError(
        f"nothing moves from line {begin} on; " + (f"the last line that moves is {last}" if last else "nothing does"),
        str(file),
    )


def _approach(first: np.ndarray, top: float, latest: dict[str, Event], tool: int) -> PathBlock:
    if first["tip"] != JOINTS:
        raise InputError(
            f"line {first['line']} moves the tool's tip (G43.4), and a program begins at no such line; choose one "
            "before G43.4"
        )
    number, target = int(first["line"]), first["start"]
    over = np.array([*target[:2], max(top, float(target[2])), *target[3:]])
    up = np.zeros(len(AXES))
    up[2] = over[2]
    places = [np.zeros(len(AXES)), up, over, target]
    moves = []
    for start, end in pairwise(places):
        if np.array_equal(start, end):
            continue
        cuts = end is target and not first["rapid"]
        rate = float(first["rate"]) if cuts else _FASTEST
        moves.append(line(start.tolist(), end.tolist(), rate, rapid=not cuts, mode=EXACT_STOP, program_line=number))
    segments = np.concatenate(moves) if moves else np.zeros(0, first.dtype)
    events = [latest[kind]._replace(after=-1) for kind in _KEPT if kind in latest]
    if events and events[-1][1:3] == ("override", TIED_FEED):  # on the way to a thread a hold is no harm
        events[-1] = events[-1]._replace(after=len(segments) - 1)
    return PathBlock(segments, events, tool=tool)


def stepwise(program: Program) -> Program:
    """The same, waiting after each line that moves, until somebody lets it go on. The motion rests there."""
    lines = program.line
    ends = np.flatnonzero(lines[:-1] != lines[1:])
    steps = [ProgramEvent(int(k), "stop", STEP, int(lines[k])) for k in ends if lines[k]]

    def order(each: ProgramEvent) -> tuple[int, bool, bool]:
        """What a line does itself comes before its end."""
        return each.sample, each.line != lines[each.sample], each.kind == "stop" and each.value == STEP

    happenings = sorted((*program.happenings, *steps), key=order)
    return replace(program, happenings=tuple(happenings), steps=True)
