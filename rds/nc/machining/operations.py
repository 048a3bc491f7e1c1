"""The operations of a machining job: pocket, contour, drill, face, engrave; each makes the ways of its tool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Choice, Declaration, Flag, Items, Quantity, Table, Text
from rds.nc.language.tool_library import ShapedTool
from rds.nc.machining.area import area_of, nearest_order, offset, pocket_rings, polygons, rings
from rds.nc.machining.ways import (
    Piece,
    along,
    at_height,
    levels,
    lines,
    path,
    ramp,
    rest_of_tab,
    ring_at,
    ring_with_tabs,
)
from rds.nc.shapes.centre_lines import centre_lines
from rds.nc.shapes.curves import Curve, Drawing

_LAYER = Text("layer of the drawing that it takes; by default all of it")
_POINT = Items("a place", Quantity("coordinate", "mm"), "[x, y], two numbers in mm", 2)
_MOST_HOLES = 100_000  # of a pattern
_COMMON: dict[str, Declaration] = {
    "do": Text("which operation"),
    "name": Text("what comments call it", default=""),
    "tool": Quantity("number of its tool in the library", "", 1, whole=True),
    "depth": Quantity("below z = 0", "mm", above=0.0, high=1000.0),
    "top": Quantity("z at which the material begins", "mm", default=0.0),
    "step_down": Quantity("deepest pass; by default half the tool's diameter", "mm", above=0.0),
    "feed": Quantity("feed rate; by default the tool's", "mm/min", above=0.0),
    "plunge": Quantity("feed rate downwards; by default the tool's, or a third of the feed", "mm/min", above=0.0),
    "spindle": Quantity("spindle speed, clockwise; by default the tool's", "rev/min", above=0.0),
}
_CLIMB = Flag("climb milling (the wall on the right of the tool)", default=True)
_RAMP = Quantity("angle of the way down along the cut; 90 straight down", "degrees", above=0.0, high=90.0, default=5.0)
OPERATIONS = {
    "pocket": Table(
        "clears the area within closed curves; curves within others are islands",
        _COMMON
        | {
            "layer": _LAYER,
            "step_over": Quantity("part of the diameter between ways", "", above=0.0, high=0.5, default=0.4),
            "stock_to_leave": Quantity("left at the walls", "mm", low=0.0, default=0.0),
            "climb": _CLIMB,
            "ramp": _RAMP,
        },
        needed=("tool", "depth"),
    ),
    "contour": Table(
        "cuts along closed curves, beside them or on them",
        _COMMON
        | {
            "layer": _LAYER,
            "side": Choice("where the tool goes", ("outside", "inside", "on"), "outside"),
            "stock_to_leave": Quantity("left beside the curves", "mm", default=0.0),
            "tabs": Quantity("bridges that hold the part, on each curve", "", 0, 100, default=0, whole=True),
            "tab_width": Quantity("of each at the part", "mm", above=0.0, default=3.0),
            "tab_height": Quantity("of each above the depth", "mm", above=0.0, default=1.0),
            "climb": _CLIMB,
            "ramp": _RAMP,
        },
        needed=("tool", "depth"),
    ),
    "drill": Table(
        "holes at circles and points of a layer, or in a pattern",
        _COMMON
        | {
            "layer": _LAYER,
            "peck": Quantity("depth after which the drill goes out for chips (G83)", "mm", above=0.0),
            "dwell": Quantity("time at the bottom (G82)", "s", low=0.0, default=0.0),
            "at": _POINT,
            "grid": Items(
                "a pattern from `at`: holes along x and y, and their distances",
                Quantity("number of holes, or distance", ""),
                "[nx, ny, dx, dy], two whole numbers and two lengths in mm",
                4,
            ),
            "circle": Items(
                "a pattern about `at`: number of holes, radius, angle of the first",
                Quantity("number of holes, radius, angle", ""),
                "[n, radius, angle], a whole number, mm and degrees",
                3,
            ),
        },
        needed=("tool", "depth"),
    ),
    "face": Table(
        "makes a rectangle flat, row by row",
        _COMMON
        | {
            "from": _POINT,
            "to": _POINT,
            "step_over": Quantity("part of the diameter between rows", "", above=0.0, high=0.9, default=0.6),
        },
        needed=("tool", "depth"),
    ),
    "engrave": Table(
        "goes along the curves themselves, open or closed, or along the centre lines of filled shapes",
        _COMMON
        | {
            "layer": _LAYER,
            "centre_lines": Flag("along the middle of the area within closed curves", default=False),
            "cell": Quantity("of the grid on which the middle is found", "mm", above=0.0, default=0.05),
        },
        needed=("tool", "depth"),
    ),
}


@dataclass(frozen=True)
class Holes:
    """Holes of a canned cycle: places (n × 2, mm), bottom z, depth of a peck (mm, or None), dwell (s)."""

    places: np.ndarray
    bottom: float
    peck: float | None
    dwell: float


@dataclass
class Cut:
    """What an operation makes: pieces of ways in z, or holes; mm/min and rev/min; what there is to say of it."""

    kind: str
    title: str
    tool: ShapedTool
    feed: float
    plunge: float
    spindle: float | None
    top: float
    pieces: list[Piece] = field(default_factory=list)
    holes: Holes | None = None
    notes: list[str] = field(default_factory=list)
    uncut: float = 0.0  # mm² that the tool does not reach


def operate(kind: str, given: dict[str, Any], drawing: Drawing | None, tool: ShapedTool, tolerance: float) -> Cut:
    """The ways of one operation; `given`: the keys of its table. InputError for what cannot be cut so."""
    feed = given["feed"] or tool.feed
    owner = f"{kind} {given['name']!r}" if given["name"] else kind
    if feed is None:
        raise InputError(f"{owner}: neither it nor tool {tool.number} has a feed rate; give feed in mm/min")
    plunge = given["plunge"] or tool.plunge or feed / 3.0
    if given["top"] <= -given["depth"]:
        raise InputError(f"{owner}: top = {given['top']:g} mm is not above the bottom, z = {-given['depth']:g} mm")
    title = f"{kind}{' ' + given['name'] if given['name'] else ''}: tool {tool.number}, {tool.said}"
    cut = Cut(kind, title, tool, feed, plunge, given["spindle"] or tool.spindle, given["top"])
    if tool.cutting_length < given["depth"] + given["top"]:
        cut.notes.append(
            f"the tool cuts along {tool.cutting_length:g} mm only, and goes {given['depth'] + given['top']:g} deep"
        )
    if tool.shape == "drill" and kind != "drill":
        cut.notes.append(f"tool {tool.number} is a drill, which cuts along its axis only; take a mill for a {kind}")
    _MAKERS[kind](cut, given, drawing, tolerance, owner)
    return cut


def _curves(given: dict[str, Any], drawing: Drawing | None, owner: str) -> list[Curve]:
    if drawing is None:
        raise InputError(f"{owner}: the job has no drawing; name one (drawing = ...), or write [text]")
    return drawing.on(given["layer"])


def _heights(cut: Cut, given: dict[str, Any]) -> list[float]:
    step = given["step_down"] or cut.tool.diameter / 2.0
    found = levels(given["top"], given["depth"], step)
    count = len(found)
    cut.title += f", {given['depth']:g} mm deep in {count} pass{'es' * (count > 1)}"
    return found


def _pocket(cut: Cut, given: dict[str, Any], drawing: Drawing | None, tolerance: float, owner: str) -> None:
    area = area_of(_curves(given, drawing, owner), owner)
    if given["stock_to_leave"]:
        area = offset(area, -given["stock_to_leave"])
    tool, heights = cut.tool, _heights(cut, given)
    feed, plunge = cut.feed / 60.0, cut.plunge / 60.0
    for polygon in polygons(area):
        try:
            ways, allowed, lost = pocket_rings(
                polygon, tool.diameter / 2.0, given["step_over"] * tool.diameter, given["climb"], owner
            )
        except InputError:
            cut.uncut += float(polygon.area)
            continue
        cut.uncut += lost
        before = given["top"]
        for z in heights:
            cut.pieces += _level(ways, allowed, before, z, given["ramp"], feed, plunge, tolerance)
            before = z
    if not cut.pieces:
        raise InputError(f"{owner}: a tool of {tool.diameter:g} mm fits nowhere; take a thinner one")
    if cut.uncut > 0.01:
        cut.notes.append(f"{cut.uncut:.2f} mm² in corners and narrow places is left, where the tool does not fit")


def _level(
    ways: list[np.ndarray], allowed: Any, before: float, z: float, angle: float, feed: float, plunge: float, tol: float
) -> list[Piece]:
    """The rings of one level, joined by straight cuts where these stay where the tool may be."""
    from shapely import LineString

    within = allowed.buffer(1e-6)
    pieces: list[Piece] = []
    for way in ways:
        linked = bool(pieces) and within.covers(LineString([pieces[-1][-1].end[:2], way[0]]))
        if linked:
            piece, start = lines([pieces[-1][-1].end, (*way[0], z)], feed), 0.0
            pieces[-1] += piece + ring_at(way, start, z, feed, tol)
        else:
            down, start = ramp(way, before, z, angle, plunge)
            pieces.append(down + ring_at(way, start, z, feed, tol))
    return pieces


def _contour(cut: Cut, given: dict[str, Any], drawing: Drawing | None, tolerance: float, owner: str) -> None:
    curves = _curves(given, drawing, owner)
    side, radius = given["side"], cut.tool.diameter / 2.0
    if side == "on":
        if given["stock_to_leave"]:
            raise InputError(f"{owner}: nothing is left beside a curve that is cut on; leave stock_to_leave out")
        found = [
            np.vstack((curve.points, curve.points[:1])) for curve in curves if curve.closed and len(curve.points) > 2
        ]
        if len(found) < len(curves):
            raise InputError(f"{owner}: an open curve has no tabs and no ramp round; engrave it")
    else:
        area = area_of(curves, owner)
        away = (radius + given["stock_to_leave"]) * (1.0 if side == "outside" else -1.0)
        grown = offset(area, away)
        if len(polygons(grown)) < len(polygons(area)):
            many = (
                "the tool does not fit between the curves" if side == "outside" else "the tool does not fit everywhere"
            )
            cut.notes.append(f"{many}: {len(polygons(area))} shapes became {len(polygons(grown))}")
        found = rings(grown, (side == "inside") == given["climb"])
    if not found:
        raise InputError(f"{owner}: a tool of {cut.tool.diameter:g} mm fits nowhere; take a thinner one")
    heights = _heights(cut, given)
    feed, plunge = cut.feed / 60.0, cut.plunge / 60.0
    roof = given["tab_height"] - given["depth"]
    # what is within comes first: once the outside is cut, the part may come loose
    for ring in sorted(found, key=lambda ring: float(np.ptp(ring, axis=0).prod())):
        total = float(np.hypot(*np.diff(ring, axis=0).T).sum())
        width = given["tab_width"] + cut.tool.diameter
        tabs = [((k + 0.5) * total / given["tabs"], width) for k in range(given["tabs"])]
        if tabs and width * len(tabs) > 0.8 * total:
            raise InputError(
                f"{owner}: {len(tabs)} tabs of {width:g} mm do not fit on a way of {total:.1f} mm; take fewer"
            )
        before, start, piece = given["top"], 0.0, []  # type: float, float, Piece
        for z in heights:
            if tabs and z < roof - 1e-9:
                on = rest_of_tab(start, tabs, total)
                if on and piece:  # at the height before, where the ring has been cut
                    piece += path(at_height(along(ring, start, on), before), feed, tolerance)
                start = (start + on) % total
                down = lines([(*_place(ring, start), before), (*_place(ring, start), z)], plunge)
                piece += down + ring_with_tabs(ring, start, z, tabs, roof, feed, plunge, tolerance)
            else:
                down, gone = ramp(
                    np.vstack((_place(ring, start), _turned(ring, start))), before, z, given["ramp"], plunge
                )
                start = (start + gone) % total
                piece += down + ring_at(ring, start, z, feed, tolerance)
            before = z
        cut.pieces.append(piece)


def _place(ring: np.ndarray, start: float) -> np.ndarray:
    return along(ring, start, 1e-6)[0]


def _turned(ring: np.ndarray, start: float) -> np.ndarray:
    """The ring, beginning at the distance `start` along it."""
    return along(ring, start, float(np.hypot(*np.diff(ring, axis=0).T).sum()))


def _drill(cut: Cut, given: dict[str, Any], drawing: Drawing | None, tolerance: float, owner: str) -> None:
    patterns = [key for key in ("grid", "circle") if given[key]]
    if len(patterns) > 1 or (patterns and given["layer"]):
        raise InputError(f"{owner}: a layer, a grid or a circle; leave two of them out")
    if given["at"] and given["layer"]:
        raise InputError(f"{owner}: the holes of a layer are where its circles and points are; leave at out, or layer")
    if given["peck"] and given["dwell"]:
        raise InputError(f"{owner}: the cycle that pecks (G83) does not dwell; leave peck or dwell out")
    x, y = given["at"] or (0.0, 0.0)
    if given["grid"]:
        nx, ny, dx, dy = given["grid"]
        if nx != int(nx) or ny != int(ny) or min(nx, ny) < 1 or nx * ny > _MOST_HOLES:
            raise InputError(
                f"{owner}: grid = {list(given['grid'])} must begin with two whole numbers of holes, from 1, and have"
                f" {_MOST_HOLES} at most"
            )
        places = [
            (x + i * dx, y + (j if i % 2 == 0 else ny - 1 - j) * dy) for i in range(int(nx)) for j in range(int(ny))
        ]
    elif given["circle"]:
        n, radius, angle = given["circle"]
        if n != int(n) or not 1 <= n <= _MOST_HOLES:
            raise InputError(
                f"{owner}: circle = {list(given['circle'])} must begin with a whole number of holes, 1 to {_MOST_HOLES}"
            )
        turns = [angle * pi / 180.0 + 2.0 * pi * k / n for k in range(int(n))]
        places = [(x + radius * cos(turn), y + radius * sin(turn)) for turn in turns]
    elif given["at"] and not given["layer"]:
        places = [(x, y)]
    else:
        found = [curve.circle for curve in _curves(given, drawing, owner) if curve.circle is not None]
        if not found:
            raise InputError(
                f"{owner}: there are no circles or points on this layer; draw some, or give grid or circle"
            )
        odd = {round(2 * r, 3) for _, _, r in found if r > 0.0 and abs(2 * r - cut.tool.diameter) > 0.05}
        if odd:
            sizes = ", ".join(f"{size:g}" for size in sorted(odd))
            cut.notes.append(f"circles of {sizes} mm are drilled with {cut.tool.diameter:g} mm")
        places = [(cx, cy) for cx, cy, _ in found]
        places = [places[k] for k in nearest_order(places)]
    cut.holes = Holes(np.array(places), -given["depth"], given["peck"], given["dwell"])
    cut.title += f", {len(places)} hole{'s' * (len(places) > 1)} {given['depth']:g} mm deep"


def _face(cut: Cut, given: dict[str, Any], drawing: Drawing | None, tolerance: float, owner: str) -> None:
    if given["from"] and given["to"]:
        low, high = np.minimum(given["from"], given["to"]), np.maximum(given["from"], given["to"])
    elif drawing is not None and not given["from"] and not given["to"]:
        low = np.min([curve.points.min(axis=0) for curve in drawing.curves], axis=0)
        high = np.max([curve.points.max(axis=0) for curve in drawing.curves], axis=0)
    else:
        raise InputError(f"{owner}: give both from and to, or a drawing whose extent is faced")
    diameter, feed = cut.tool.diameter, cut.feed / 60.0
    step = given["step_over"] * diameter
    rows = max(int(np.ceil((high[1] - low[1]) / step - 1e-9)), 1) + 1
    ys = np.linspace(low[1], high[1], rows)
    left, right = low[0] - diameter / 2.0, high[0] + diameter / 2.0
    for z in _heights(cut, given):
        points = [(left if (k + e) % 2 == 0 else right, y, z) for k, y in enumerate(ys) for e in (0, 1)]
        cut.pieces.append(lines(points, feed))


def _engrave(cut: Cut, given: dict[str, Any], drawing: Drawing | None, tolerance: float, owner: str) -> None:
    curves = [curve for curve in _curves(given, drawing, owner) if len(curve.points) > 1]
    if given["centre_lines"]:
        ways = centre_lines(curves, given["cell"], max(tolerance, given["cell"] / 2.0))
    else:
        ways = [np.vstack((curve.points, curve.points[:1])) if curve.closed else curve.points for curve in curves]
    if not ways:
        raise InputError(f"{owner}: there is nothing to engrave here; take another layer")
    feed, plunge = cut.feed / 60.0, cut.plunge / 60.0
    heights = _heights(cut, given)
    for k in nearest_order([way[0] for way in ways]):
        way, before, piece = ways[k], given["top"], []  # type: np.ndarray, float, Piece
        for z in heights:
            piece += lines([(*way[0], before), (*way[0], z)], plunge) + path(at_height(way, z), feed, tolerance)
            way, before = way[::-1], z
        cut.pieces.append(piece)


_MAKERS: dict[str, Callable[[Cut, dict[str, Any], Drawing | None, float, str], None]] = {
    "pocket": _pocket,
    "contour": _contour,
    "drill": _drill,
    "face": _face,
    "engrave": _engrave,
}
