"""Circles: from the words of G2 and G3 to a centre and a number of turns, with LinuxCNC's tolerances."""

from __future__ import annotations

import math

from rds.nc.language.expressions import Fault
from rds.nc.language.state import XY, XZ, YZ, State

RADIUS_TOLERANCE = (0.00005 * 25.4, 0.00005)  # mm, inch: no arc has a smaller radius; how much too small R may be
SPIRAL_TOLERANCE = (
    2 * 0.01 * math.sqrt(2.0),
    2 * 0.001 * math.sqrt(2.0),
)  # mm, inch: difference of start and end radius
SPIRAL_RELATIVE = 0.001  # of the larger radius
SPIRAL_MOST = 100.0  # times SPIRAL_TOLERANCE, whatever the radius
SEMICIRCLE = 1e-12  # half chord this close to the radius is the radius
QUARTER = math.pi / 2
QUARTER_REST = 6.123233995736766e-17  # π/2 less QUARTER: LinuxCNC works with more digits here

# By plane: the position's index and letter of the first, second and third axis, and the letters of the centre.
AXES_OF = {XY: (0, 1, 2), XZ: (2, 0, 1), YZ: (1, 2, 0)}
LETTERS_OF = {XY: "xyz", XZ: "zxy", YZ: "yzx"}
CENTRES_OF = {XY: "ijk", XZ: "kij", YZ: "jki"}
_GIVEN = {XY: "G17", XZ: "G18", YZ: "G19"}


def centre_offsets(words: dict[str, float], state: State, key: str) -> tuple[float, float] | None:
    """The words of the centre along the plane's two axes; None when the arc is given by R. Raises Fault."""
    first, second, third = tuple(CENTRES_OF[state.plane])
    plane, names = _GIVEN[state.plane], f"{first.upper()} and {second.upper()}"
    by_centre = "i" in words or "j" in words or "k" in words
    if "r" in words:
        if by_centre:
            letter = next(letter for letter in words if letter in "ijk")
            raise Fault("an arc has either R or I J K; leave one away", letter)
        letters = LETTERS_OF[state.plane][:2]
        if letters[0] not in words and letters[1] not in words:
            raise Fault(
                f"an arc with R and no end in the plane of {plane}; write {letters.upper()} or a circle by {names}",
                key,
            )
        return None
    if not by_centre:
        raise Fault(f"an arc needs its centre ({names} in {plane}) or its radius R; add them", key)
    if third in words:
        use = "leave it out" if first in words or second in words else f"use {names}"
        raise Fault(
            f"{third.upper()} is no centre of an arc in the plane of {plane}; {use}, or another plane before", third
        )
    if state.arc_absolute:
        for letter in (first, second):
            if letter not in words:
                raise Fault(f"{letter.upper()} is missing; an absolute centre (G90.1) needs {names}", key)
    return words.get(first, 0.0), words.get(second, 0.0)


def by_centre(
    start: tuple[float, float], end: tuple[float, float], offsets: tuple[float, float], state: State
) -> tuple[float, float]:
    """The centre, when the end is on the circle to within the tolerances. Raises Fault."""
    centre = offsets if state.arc_absolute else (start[0] + offsets[0], start[1] + offsets[1])
    radius = math.hypot(centre[0] - start[0], centre[1] - start[1])
    end_radius = math.hypot(centre[0] - end[0], centre[1] - end[1])
    smallest, spiral = RADIUS_TOLERANCE[state.inches], SPIRAL_TOLERANCE[state.inches]
    if radius < smallest or end_radius < smallest:
        raise Fault(
            f"the arc's radius is {radius:.5f} at its start and {end_radius:.5f} at its end, where {smallest:g} is the"
            f" least ({_places(start, end, centre, state)}); correct the centre"
        )
    error = abs(radius - end_radius)
    relative = error / max(radius, end_radius)
    if error > spiral * SPIRAL_MOST or (relative > SPIRAL_RELATIVE and error > spiral):
        raise Fault(
            f"the arc's end is off its circle by {error:.4f} ({100 * relative:.2f} %), more than {spiral:.4f} and"
            f" {100 * SPIRAL_RELATIVE:g} %: its radius is {radius:.4f} at the start and {end_radius:.4f} at the end"
            f" ({_places(start, end, centre, state)}); correct the end or the centre"
            f"{_otherwise(start, end, offsets, state)}"
        )
    return centre


def _otherwise(start: tuple[float, float], end: tuple[float, float], offsets: tuple[float, float], state: State) -> str:
    """What to write where the end is on the circle if the centre is read the other way."""
    other = (start[0] + offsets[0], start[1] + offsets[1]) if state.arc_absolute else offsets
    radius = math.hypot(other[0] - start[0], other[1] - start[1])
    off = abs(radius - math.hypot(other[0] - end[0], other[1] - end[1]))
    if off > SPIRAL_TOLERANCE[state.inches] or radius < RADIUS_TOLERANCE[state.inches]:
        return ""
    if state.arc_absolute:
        return ", or write G91.1 before, if the centre is counted from the start"
    return ", or write G90.1 before, if these are the coordinates of the centre itself"


def _places(start: tuple[float, float], end: tuple[float, float], centre: tuple[float, float], state: State) -> str:
    first, second = tuple(LETTERS_OF[state.plane][:2].upper())
    return ", ".join(
        f"{name} {first}{point[0]:.4f} {second}{point[1]:.4f}"
        for name, point in (("start", start), ("end", end), ("centre", centre))
    )


def by_radius(
    start: tuple[float, float], end: tuple[float, float], radius: float, clockwise: bool, state: State
) -> tuple[float, float]:
    """The centre of an arc of a radius; a negative one takes the longer way. Raises Fault with key "r"."""
    if start == end:
        raise Fault("an arc with R that ends where it starts has no one centre; give the centre by I, J, K", "r")
    size = abs(radius)
    middle = (end[0] + start[0]) / 2.0, (end[1] + start[1]) / 2.0
    way = middle[0] - end[0], middle[1] - end[1]
    half = math.sqrt(way[0] * way[0] + way[1] * way[1])  # unlike hypot the same to the last bit in the fast lane
    if half - size > RADIUS_TOLERANCE[state.inches] or size == 0.0:
        raise Fault(f"the radius must be at least half of the way to the end, {half:.4f}; write a larger one", "r")
    if half / size > 1 - SEMICIRCLE:
        half = size
    chord = math.atan2(end[1] - start[1], end[0] - start[0])
    side = -1.0 if clockwise == (radius > 0.0) else 1.0
    direction = chord + side * QUARTER + side * QUARTER_REST
    offset = size * math.cos(math.asin(half / size))
    return middle[0] + offset * math.cos(direction), middle[1] + offset * math.sin(direction)


def swept(start: tuple[float, float], centre: tuple[float, float], turns: int, end: tuple[float, float]) -> float:
    """The angle in rad from start to end, + counter-clockwise, full turns included."""
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    last = math.atan2(end[1] - centre[1], end[0] - centre[0])
    if turns > 0:
        if last <= first:
            last += 2 * math.pi
        return last - first + (turns - 1) * 2 * math.pi
    if first <= last:
        first += 2 * math.pi
    return last - first + (turns + 1) * 2 * math.pi
