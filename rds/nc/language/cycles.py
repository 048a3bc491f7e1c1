"""Canned cycles G73, G74 and G81 to G89: drilling, tapping and boring, move for move as LinuxCNC makes them.

The hole is drilled along the third axis of the plane (Z in G17, Y in G18, X in G19): by rapid to the place of the hole,
by rapid to R, then what the cycle does down to the depth, and out. G98 goes out to where the series of cycles began,
when that is above R, G99 (in force at the start) to R.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rds.nc.language.arcs import AXES_OF, CENTRES_OF, LETTERS_OF
from rds.nc.language.blocks import Block
from rds.nc.language.canon import FEED, TRAVERSE
from rds.nc.language.context import Context
from rds.nc.language.expressions import Fault
from rds.nc.language.state import INVERSE_TIME, PER_MINUTE

CLEARANCE = 0.010  # inch: how far above the last depth a peck begins again (LinuxCNC's G83_RAPID_DELTA)
_DWELLING = frozenset((820, 860, 880, 890))  # P is wanted when the cycle begins
_PECKING = frozenset((730, 830))
_MOST = 100_000  # holes, and pecks of all of them, by one line


class _Hole(NamedTuple):
    """One hole, along the plane's first, second and third axis, in program units."""

    first: float
    second: float
    retract: float  # R
    clear: float  # where the cycle ends
    bottom: float


def cycle(m: Context, block: Block) -> None:
    """One line of a canned cycle: L holes, or one. Raises Fault."""
    state, words, code = m.state, block.words, block.motion
    key = f"g{code}"
    name = f"G{code // 10}"
    began = state.motion != code
    _check(m, block, key)
    first, second, third = AXES_OF[state.plane]
    deep = LETTERS_OF[state.plane][2]
    position = state.position()
    if "r" not in words and began:
        raise Fault(f"{name} without R; write where the rapid down ends and the feed begins", key)
    if deep not in words and began:
        raise Fault(f"{name} without {deep.upper()}; write how deep the hole is", key)
    repeats = int(words.get("l", 1.0))
    if repeats == 0:
        raise Fault(f"L0 would repeat {name} no time; write how many times, from 1", "l")
    level = words.get("r", state.cycle_r)
    depth = words.get(deep, state.cycle_depth)
    here = position[third]
    if not state.cycle_series:
        state.cycle_start, state.cycle_series = here, 1
    start = state.cycle_start
    at, by = _places(m, words, position)
    retract, bottom = (level, depth) if state.absolute else (level + start, level + start + depth)
    if retract < bottom:
        raise Fault(
            f"R is below the depth: it lies at {retract:.4f}, the hole's bottom at {bottom:.4f}; correct R or"
            f" {deep.upper()}",
            "r" if "r" in words else key,
        )
    if start < retract:
        position[third] = retract
        m.out.straight(TRAVERSE, tuple(position))  # type: ignore[arg-type]
        start = here = retract
    clear = start if state.retract_high else retract
    mode, tolerance, collinear = state.path_mode, state.path_tolerance, state.path_collinear
    if mode != "EXACT_PATH":
        m.out.call("SET_MOTION_CONTROL_MODE", "EXACT_PATH")
    _settle_words(m, words, code, began, key)
    pecks = (retract - bottom) / state.cycle_peck if code in _PECKING else 1.0
    if repeats > _MOST:
        raise Fault(f"more than {_MOST:,} holes by one line; write a smaller L", "l")
    if repeats * pecks > _MOST:
        raise Fault(f"more than {_MOST:,} pecks by one line; write a larger Q", "q" if "q" in words else key)
    for repeat in range(repeats):
        at = _next(at, by, key)
        hole = _Hole(*at, retract, clear, bottom)
        if repeat == 0 and here > retract:
            _go(m, TRAVERSE, hole.first, hole.second, here)
            _go(m, TRAVERSE, hole.first, hole.second, retract)
        else:
            _go(m, TRAVERSE, hole.first, hole.second, clear)
            if clear > retract:
                _go(m, TRAVERSE, hole.first, hole.second, retract)
        _ACTIONS[code](m, hole, code)
    end = state.position()
    end[first], end[second], end[third] = *at, clear
    state.move_to(end)
    state.cycle_r, state.cycle_depth, state.motion = level, depth, code
    if mode != "EXACT_PATH":
        scale = 25.4 if state.inches else 1.0
        m.out.call("SET_MOTION_CONTROL_MODE", mode, *((tolerance / scale,) if mode == "CONTINUOUS" else ()))
        m.out.call("SET_NAIVECAM_TOLERANCE", collinear / scale)


def _check(m: Context, block: Block, key: str) -> None:
    """Raises Fault for modes and words that do not go with a cycle."""
    state = m.state
    if state.feed_mode == INVERSE_TIME:
        raise Fault("canned cycles do not go with inverse time (G93); write G94 and F before", key)
    if state.feed_rate == 0.0 and not (m.dialect.default_feed and state.feed_mode == PER_MINUTE):
        raise Fault("no feed rate is set; write F, in units per minute", key)
    if state.comp_side:
        raise Fault("canned cycles do not go with cutter compensation; write G40 before", key)
    if state.tcp:
        raise Fault("canned cycles do not go with tool centre point control (G43.4); write G49 before", key)


def _places(
    m: Context, words: dict[str, float], position: list[float]
) -> tuple[tuple[float, float], tuple[float, float, float, float]]:
    """Where the first hole is (in G91: what it counts from), and by how much the next ones are further: along the
    plane's axes, of radius and of angle (rad).
    """
    state = m.state
    first, second, _ = AXES_OF[state.plane]
    one, two = LETTERS_OF[state.plane][0], LETTERS_OF[state.plane][1]
    if not state.absolute:
        turn = words.get("^", 0.0) * math.pi / 180.0
        return (position[first], position[second]), (
            words.get(one, 0.0),
            words.get(two, 0.0),
            words.get("@", 0.0),
            turn,
        )
    if "@" in words or "^" in words:
        radius = words["@"] if "@" in words else math.hypot(state.y, state.x)
        angle = words["^"] * math.pi / 180.0 if "^" in words else math.atan2(state.y, state.x)
        return (radius * math.cos(angle), radius * math.sin(angle)), (0.0, 0.0, 0.0, 0.0)
    return (words.get(one, position[first]), words.get(two, position[second])), (0.0, 0.0, 0.0, 0.0)


def _next(at: tuple[float, float], by: tuple[float, float, float, float], key: str) -> tuple[float, float]:
    first, second, further, turn = by
    x, y = at[0] + first, at[1] + second
    if (further or turn) and x == 0.0 and y == 0.0:
        raise Fault("a radius or angle counts from the tool's place, which is the origin; write X and Y", key)
    if further:
        angle, radius = math.atan2(y, x), math.hypot(y, x) + further
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    if turn:
        angle, radius = math.atan2(y, x) + turn, math.hypot(y, x)
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    return x, y


def _settle_words(m: Context, words: dict[str, float], code: int, began: bool, key: str) -> None:
    """P, Q, I, J, K: of this line, or as the cycle had them before. Raises Fault."""
    state = m.state
    if code in _PECKING:
        if began and "q" not in words:
            raise Fault(f"G{code // 10} without Q; write how deep each peck goes", key)
        state.cycle_peck = words.get("q", state.cycle_peck)
        if state.cycle_peck <= 0.0:
            raise Fault(f"a peck of {state.cycle_peck:g} goes nowhere; write Q above 0", "q" if "q" in words else key)
    if code in _DWELLING and began and "p" not in words:
        raise Fault(f"G{code // 10} without P; write the dwell at the bottom in seconds, P0.5", key)
    if code in _DWELLING or code in (740, 840):
        state.cycle_dwell = words.get("p", state.cycle_dwell)
        if state.cycle_dwell < 0.0:
            raise Fault(f"a dwell of {state.cycle_dwell:g} s is negative; write seconds from 0", "p")
    if code == 870:
        for letter in "ijk":
            if began and letter not in words:
                raise Fault(f"G87 without {letter.upper()}; write the way beside the hole and the height", key)
            setattr(state, f"cycle_{letter}", words.get(letter, getattr(state, f"cycle_{letter}")))


def _go(m: Context, kind: int, first: float, second: float, third: float) -> None:
    """A straight move to a place along the plane's axes."""
    state = m.state
    rotary = state.a, state.b, state.c
    place = {0: (first, second, third), 1: (second, third, first), 2: (third, first, second)}[state.plane]
    m.out.straight(kind, place + rotary)


def _turning(m: Context, code: int) -> int:
    """The spindle's direction, 1 clockwise. Raises Fault where the cycle wants another."""
    spindle, key = m.state.spindle, f"g{code}"
    if not spindle:
        raise Fault(f"the spindle stands still; G{code // 10} wants it turning: write M3 or M4, and S, before", key)
    if code == 840 and spindle < 0:
        raise Fault("the spindle turns counter-clockwise; G84 cuts right-hand threads: write M3 before", key)
    if code == 740 and spindle > 0:
        raise Fault("the spindle turns clockwise; G74 cuts left-hand threads: write M4 before", key)
    return spindle


def _spin(m: Context, direction: int) -> None:
    m.out.call("START_SPINDLE_CLOCKWISE" if direction > 0 else "START_SPINDLE_COUNTERCLOCKWISE", 0)


def _drill(m: Context, hole: _Hole, code: int) -> None:
    """G81, G82 (with a dwell): down by feed, out by rapid."""
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    if code == 820:
        m.out.call("DWELL", m.state.cycle_dwell)
    _go(m, TRAVERSE, hole.first, hole.second, hole.clear)


def _peck(m: Context, hole: _Hole, code: int) -> None:
    """G83 (out to R after each peck), G73 (back a little, which breaks the chip)."""
    back = CLEARANCE if m.state.inches else CLEARANCE * 25.4
    depth = hole.retract - m.state.cycle_peck
    while depth > hole.bottom:
        _go(m, FEED, hole.first, hole.second, depth)
        if code == 830:
            _go(m, TRAVERSE, hole.first, hole.second, hole.retract)
        _go(m, TRAVERSE, hole.first, hole.second, depth + back)
        depth = depth - m.state.cycle_peck
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    _go(m, TRAVERSE, hole.first, hole.second, hole.clear)


def _tap(m: Context, hole: _Hole, code: int) -> None:
    """G84 (right-hand), G74 (left-hand): down and out by feed, the spindle turned round in between."""
    out, state = m.out, m.state
    direction = _turning(m, code)
    out.call("DISABLE_FEED_OVERRIDE")
    out.call("DISABLE_SPEED_OVERRIDE", 0)
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    out.call("STOP_SPINDLE_TURNING", 0)
    _spin(m, -direction)
    out.call("DWELL", state.cycle_dwell)
    _go(m, FEED, hole.first, hole.second, hole.clear)
    out.call("STOP_SPINDLE_TURNING", 0)
    _spin(m, direction)
    if state.feed_override:
        out.call("ENABLE_FEED_OVERRIDE")
    if state.speed_override:
        out.call("ENABLE_SPEED_OVERRIDE", 0)


def _bore(m: Context, hole: _Hole, code: int) -> None:
    """G85, G89 (with a dwell): down and out by feed. G86: out by rapid with the spindle standing."""
    out = m.out
    if code == 860:
        _turning(m, code)
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    if code != 850:
        out.call("DWELL", m.state.cycle_dwell)
    if code == 850:
        _go(m, FEED, hole.first, hole.second, hole.retract)
        _go(m, TRAVERSE, hole.first, hole.second, hole.clear)
    elif code == 890:
        _go(m, FEED, hole.first, hole.second, hole.clear)
    else:
        out.call("STOP_SPINDLE_TURNING", 0)
        _go(m, TRAVERSE, hole.first, hole.second, hole.clear)
        _spin(m, m.state.spindle)


def _back_bore(m: Context, hole: _Hole, code: int) -> None:
    """G87: through the hole beside its middle, up by feed to K, and out the same way."""
    out, state = m.out, m.state
    offsets = {letter: getattr(state, f"cycle_{letter}") for letter in "ijk"}
    one, two, up = tuple(CENTRES_OF[state.plane])
    aside = hole.first + offsets[one], hole.second + offsets[two]
    middle = offsets[up] if state.absolute else hole.bottom + offsets[up]
    turning = 2 if _turning(m, code) > 0 else 3  # as LinuxCNC numbers directions
    _go(m, TRAVERSE, *aside, hole.retract)
    out.call("STOP_SPINDLE_TURNING", 0)
    out.call("ORIENT_SPINDLE", 0, 0.0, turning)
    _go(m, TRAVERSE, *aside, hole.bottom)
    _go(m, TRAVERSE, hole.first, hole.second, hole.bottom)
    _spin(m, state.spindle)
    _go(m, FEED, hole.first, hole.second, middle)
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    out.call("STOP_SPINDLE_TURNING", 0)
    out.call("ORIENT_SPINDLE", 0, 0.0, turning)
    _go(m, TRAVERSE, *aside, hole.bottom)
    _go(m, TRAVERSE, *aside, hole.clear)
    _go(m, TRAVERSE, hole.first, hole.second, hole.clear)
    _spin(m, state.spindle)


def _bore_by_hand(m: Context, hole: _Hole, code: int) -> None:
    """G88: down by feed, then the spindle stops and the operator takes the tool out."""
    _turning(m, code)
    _go(m, FEED, hole.first, hole.second, hole.bottom)
    m.out.call("DWELL", m.state.cycle_dwell)
    m.out.call("STOP_SPINDLE_TURNING", 0)
    m.out.call("PROGRAM_STOP")
    m.out.call("RETRACT_BY_HAND")
    _spin(m, m.state.spindle)


_ACTIONS = {
    730: _peck,
    740: _tap,
    810: _drill,
    820: _drill,
    830: _peck,
    840: _tap,
    850: _bore,
    860: _bore,
    870: _back_bore,
    880: _bore_by_hand,
    890: _bore,
}
