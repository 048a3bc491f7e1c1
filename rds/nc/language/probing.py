"""G38.2 to G38.5: probing, against a surface that is simulated where the dialect has one."""

from __future__ import annotations

import math

from rds.nc.language.blocks import Block
from rds.nc.language.context import Context, check_feed
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import in_machine
from rds.nc.language.parameters import PROBED
from rds.nc.language.state import PER_REVOLUTION
from rds.nc.language.targets import target


def probe(m: Context, block: Block) -> None:
    """G38.2 to G38.5: toward a workpiece until contact, or away from it; #5061 to #5066 then tell where.

    Without a surface (option probe_surface) the contact is at the move's end, and the tool stands a little before it,
    as `rs274` has it.
    """
    state, words, out = m.state, block.words, m.out
    key = f"g{block.motion}"
    if state.comp_side:
        raise Fault("probing does not go with cutter compensation; write G40 before", key)
    check_feed(m, words, key)
    if state.feed_mode == PER_REVOLUTION:
        raise Fault("probing does not go with a feed per revolution (G95); write G94 and F before", key)
    start, end = state.position(), target(state, words)
    if block.motion in (382, 384) and start == end:
        raise Fault("the probe is where it is to go already; write a place away from it", key)
    found, touched = _contact(m, block.motion, start, end)
    out.call("TURN_PROBE_ON")
    out.call("STRAIGHT_PROBE", *end, *found)
    out.call("TURN_PROBE_OFF")
    state.motion = block.motion
    numbers = m.parameters.numbers
    numbers[PROBED : PROBED + 6] = found
    numbers[PROBED + 9] = float(touched)
    if m.dialect.probe_surface is None:
        way = math.dist(start[:3], end[:3])
        if way:
            back = 0.01 if state.inches else 0.254
            found = [there + back * ((begin - there) / way) for begin, there in zip(start[:3], end[:3], strict=True)]
            found += end[3:]
    state.move_to(list(found))


def _contact(m: Context, code: int, start: list[float], end: list[float]) -> tuple[list[float], bool]:
    """Where the probing move ends, and whether the probe touched (or left) the surface. Raises Fault."""
    surface = m.dialect.probe_surface
    if surface is None:
        return end, False
    high, low = (in_machine(m, place)[2] for place in (start, end))
    level = surface / (25.4 if m.state.inches else 1.0)
    toward = code in (382, 383)
    crosses = (high > level >= low) if toward else (high <= level < low)
    if not crosses:
        if code in (382, 384):
            what = "touch" if toward else "leave"
            raise Fault(
                f"the probe does not {what} the surface, which lies at Z {level:g} of the machine; move further, or"
                f" write G{(code + 1) / 10:g}, which lets that be",
                f"g{code}",
            )
        return end, False
    part = (high - level) / (high - low)
    return [begin + part * (there - begin) for begin, there in zip(start, end, strict=True)], True
