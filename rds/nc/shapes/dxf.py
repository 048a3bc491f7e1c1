"""DXF drawings (ASCII): lines, arcs, circles, polylines with bulges, ellipses, splines, points, and blocks.

Our own, because `ezdxf` reads whole documents; here curves on layers are wanted, and what a drawing from
elsewhere may cost is limited as it is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan, atan2, cos, hypot, pi, radians, sin
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.nc.shapes.curves import (
    CHORD_ERROR,
    MOST_POINTS,
    Curve,
    Drawing,
    arc_points,
    assembled,
    circle_curve,
    polyline_curve,
    steps_of,
)
from rds.nc.shapes.dxf_groups import (
    Pairs,
    clips_of,
    entities_of,
    number_of,
    numbers_of,
    places_of,
    sections_of,
    text_of,
    value_of,
)

_LARGEST = 128 << 20  # bytes
_MM = {
    1: 25.4,
    2: 304.8,
    4: 1.0,
    5: 10.0,
    6: 1000.0,
    8: 25.4e-6,
    9: 0.0254,
    10: 914.4,
    13: 0.001,
    14: 100.0,
}  # $INSUNITS
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
_PASSED_OVER = {
    **dict.fromkeys(
        ("TEXT", "MTEXT", "ATTRIB", "ATTDEF"), "text (explode it into lines, or use `rds nc make job`'s text)"
    ),
    **dict.fromkeys(("DIMENSION", "LEADER", "MULTILEADER", "TOLERANCE"), "dimensions"),
    "HATCH": "hatches",
}
_ONE_POINT = 1e-9  # of the longest chord of a spline: fit points nearer than this are one
_FARTHEST = 1e12  # that a spline's fit points may lie from the origin, in the drawing's unit
DEEPEST = 16  # blocks within one another
_MESH, _FRAME, _SPACE = 16 | 64, 16, 8  # flags of a POLYLINE and of its VERTEX: meshes, control points, in space
_IN_SPACE = ("LINE", "POINT", "ELLIPSE", "SPLINE")  # their places are those of the drawing, whatever their extrusion


def read_dxf(path: Path, unit: str | None = None) -> Drawing:
    """The curves of an ASCII DXF file, on its layers, seen from above (Z is left out).

    Lengths are in the unit that the header names ($INSUNITS), or in `unit` (mm, cm, m or in), which has to be given
    where it names none. Lines and arcs of a layer whose ends meet become one curve. Text, dimensions and hatches are
    passed over and told; so is what is hidden, on layers that are switched off, on the paper's sheets, or tilted out of
    the plane. InputError for what is no such file.
    """
    name = str(path)
    if unit is not None and unit not in UNITS:
        raise InputError(f"unit {unit!r} is unknown; known: {', '.join(UNITS)}", name)
    try:
        data = read_limited(path, _LARGEST, "a DXF drawing", "leave out what is not machined")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}; name a drawing", name) from error
    if data.startswith(b"AutoCAD Binary DXF"):
        raise InputError("is a binary DXF; save it as ASCII DXF (R12 or later)", name)
    sections = sections_of(data, name)
    if "ENTITIES" not in sections:
        raise InputError("has no ENTITIES section; save it as ASCII DXF (R12 or later)", name)
    scale = UNITS[unit] if unit else _scale(sections.get("HEADER", []), name)
    reader = _Reader(name, scale, _blocks(sections.get("BLOCKS", [])), _off(sections.get("TABLES", [])))
    reader.clips = clips_of(sections.get("OBJECTS", []))
    reader.take(entities_of(sections["ENTITIES"]), np.array([[scale, 0.0, 0.0], [0.0, scale, 0.0]]), None, 0)
    return assembled(reader.curves, name, reader.passed_over)


def _scale(header: Pairs, name: str) -> float:
    for k, (code, value) in enumerate(header):
        if code == 9 and value == "$INSUNITS" and k + 1 < len(header):
            units = int(number_of([header[k + 1]], header[k + 1][0]))
            if units in _MM:
                return _MM[units]
            if units:
                raise InputError(
                    f"$INSUNITS = {units} is no unit of drawings of parts; give its unit (unit: mm, cm, m or in)",
                    name,
                )
    raise InputError("does not say its unit ($INSUNITS); give it (unit: mm, cm, m or in)", name)


def _blocks(pairs: Pairs) -> dict[str, tuple[tuple[float, float], list[tuple[str, Pairs]]]]:
    found: dict[str, tuple[tuple[float, float], list[tuple[str, Pairs]]]] = {}
    inside: list[tuple[str, Pairs]] | None = None
    for kind, body in entities_of(pairs):
        if kind == "BLOCK":
            inside = []
            base = (number_of(body, 10, 0.0), number_of(body, 20, 0.0))
            found[text_of(body, 2).lower()] = (base, inside)  # names of DXF differ by more than their case
        elif kind == "ENDBLK":
            inside = None
        elif inside is not None:
            inside.append((kind, body))
    return found


def _off(tables: Pairs) -> set[str]:
    """Layers that are switched off or frozen, in lower case."""
    return {
        text_of(body, 2).lower()
        for kind, body in entities_of(tables)
        if kind == "LAYER" and (number_of(body, 62, 7.0) < 0 or int(number_of(body, 70, 0.0)) & 1)
    }


def _sweep(first: float, last: float) -> float:
    """From one angle to the next, rad: a whole turn where they are equal, which programs write with a rounding."""
    sweep = (last - first) % (2 * pi)
    return sweep if 1e-6 < sweep < 2 * pi - 1e-6 else 2 * pi


def _size(m: np.ndarray) -> float:
    """How many mm a unit of the entity becomes at most: its curves have chords for that size."""
    return float(np.linalg.norm(m[:, :2], 2))


class _Reader:
    def __init__(self, name: str, scale: float, blocks: dict, off: set[str]):
        self.name, self.scale, self.blocks, self.off = name, scale, blocks, off
        self.curves: list[Curve] = []
        self.passed_over: dict[str, int] = {}
        self.clips: set[str] = set()
        self.taken = 0  # points of the curves so far; an insert counts as fifty

    def _pass_over(self, what: str) -> None:
        self.passed_over[what] = self.passed_over.get(what, 0) + 1

    def _count(self, more: int) -> None:
        self.taken += more
        if self.taken > MOST_POINTS:
            raise InputError(
                f"has more than {MOST_POINTS} points, blocks included; leave out what is not cut", self.name
            )

    def take(
        self, entities: Iterator[tuple[str, Pairs]] | list[tuple[str, Pairs]], m: np.ndarray, on: str | None, depth: int
    ) -> None:
        """Entities under the transformation m (2 × 3, to mm); `on`: the layer of the insert, for what is on layer 0."""
        line, line_layer = None, ""  # type: Pairs | None, str  # a POLYLINE, whose VERTEX entities follow it
        vertices: list[tuple[float, float, float]] = []
        for kind, body in entities:
            layer = text_of(body, 8, "0")
            layer = on if on is not None and layer == "0" else layer
            if kind == "VERTEX":
                if line is not None and not int(number_of(body, 70)) & _FRAME:
                    vertices.append((number_of(body, 10), number_of(body, 20), number_of(body, 42)))
            elif kind == "SEQEND":
                if line is not None and vertices:
                    self._polyline(vertices, line, line_layer, m)
                line = None
            elif layer.lower() in self.off:
                self._pass_over("objects of hidden layers")
            elif int(number_of(body, 67)) == 1:
                if kind != "VIEWPORT":
                    self._pass_over("objects on sheets of paper (draw in model space what is to be cut)")
            elif int(number_of(body, 60)) == 1:
                self._pass_over("hidden objects")
            elif (kind not in _IN_SPACE or kind == "ELLIPSE") and self._tilted(kind, body):
                self._pass_over("objects that do not lie in the plane XY")
            elif kind == "POLYLINE":
                if int(number_of(body, 70)) & _MESH:
                    self._pass_over("meshes")
                else:
                    line, vertices, line_layer = body, [], layer
            else:
                self._entity(kind, body, layer, m, depth)

    def _tilted(self, kind: str, body: Pairs) -> bool:
        if kind == "POLYLINE" and int(number_of(body, 70)) & _SPACE:
            return False
        return hypot(number_of(body, 210), number_of(body, 220)) > 1e-6

    def _polyline(self, vertices: list[tuple[float, float, float]], body: Pairs, layer: str, m: np.ndarray) -> None:
        flags = int(number_of(body, 70))
        m = m if flags & _SPACE else _mirrored(body, m)
        self._add(_bulged(vertices, bool(flags & 1), _size(m)), bool(flags & 1), layer, m)

    def _entity(self, kind: str, body: Pairs, layer: str, m: np.ndarray, depth: int) -> None:
        x, y = number_of(body, 10), number_of(body, 20)
        if kind not in _IN_SPACE:
            m = _mirrored(body, m)
        if kind == "LINE":
            self._add(np.array([[x, y], [number_of(body, 11), number_of(body, 21)]]), False, layer, m)
        elif kind == "POINT":
            self._circle(x, y, 0.0, layer, m)
        elif kind == "CIRCLE":
            self._circle(x, y, abs(number_of(body, 40)), layer, m)
        elif kind == "ARC":
            first, last = radians(number_of(body, 50)), radians(number_of(body, 51))
            self._add(_arc(x, y, number_of(body, 40), first, _sweep(first, last), _size(m)), False, layer, m)
        elif kind == "LWPOLYLINE":
            closed = bool(int(number_of(body, 70)) & 1)
            self._add(_bulged(_lightweight(body), closed, _size(m)), closed, layer, m)
        elif kind == "ELLIPSE":
            self._add(_ellipse(body, _size(m)), False, layer, m)
        elif kind == "SPLINE":
            self._add(_spline(body, _size(m), self.name), bool(int(number_of(body, 70)) & 1), layer, m)
            if not len(places_of(body, 10)):
                self._pass_over("control points, which a spline lacks: a cubic goes through its fit points")
        elif kind == "INSERT":
            self._insert(body, layer, m, depth)
        else:
            self._pass_over(_PASSED_OVER.get(kind, f"{kind} (no curve of the plane)"))

    def _insert(self, body: Pairs, layer: str, m: np.ndarray, depth: int) -> None:
        block = self.blocks.get(text_of(body, 2).lower())
        if block is None or depth >= DEEPEST:
            self._count(50)
            self._pass_over("inserts of blocks that are not in the file")
            return
        if not self.clips.isdisjoint(value for code, value in body if code == 360):
            self._pass_over("a clip (XCLIP): its block is drawn whole; explode and trim it, if less is to be cut")
        (bx, by), entities = block
        angle, sx, sy = radians(number_of(body, 50)), number_of(body, 41, 1.0), number_of(body, 42, 1.0)
        c, s = cos(angle), sin(angle)
        turn = np.array([[c * sx, -s * sy], [s * sx, c * sy]])
        place = np.array([number_of(body, 10), number_of(body, 20)]) - turn @ np.array([bx, by])
        columns, rows = (max(int(number_of(body, code, 1.0)), 1) for code in (70, 71))
        for k in range(columns * rows):  # an array: its distances turn with the insert, and are not scaled by it
            self._count(50)
            dx, dy = k % columns * number_of(body, 44), k // columns * number_of(body, 45)
            at = place + np.array([c * dx - s * dy, s * dx + c * dy])
            self.take(entities, np.column_stack((m[:, :2] @ turn, m[:, :2] @ at + m[:, 2])), layer, depth + 1)

    def _circle(self, x: float, y: float, r: float, layer: str, m: np.ndarray) -> None:
        a = m[:, :2]
        size = float(np.sqrt(abs(np.linalg.det(a))))
        if np.allclose(a.T @ a, size**2 * np.eye(2), rtol=1e-9, atol=1e-12):
            cx, cy = a @ (x, y) + m[:, 2]
            self.curves.append(circle_curve(float(cx), float(cy), r * size, layer))
            self._count(len(self.curves[-1].points))
        else:
            self._add(_arc(x, y, r, 0.0, 2 * pi, _size(m)), True, layer, m)

    def _add(self, points: np.ndarray, closed: bool, layer: str, m: np.ndarray) -> None:
        self._count(len(points))
        curve = polyline_curve(points @ m[:, :2].T + m[:, 2], closed, layer)
        if curve is not None:
            self.curves.append(curve)


def _mirrored(body: Pairs, m: np.ndarray) -> np.ndarray:
    """m for an entity in a plane of its own: one that is seen from below (its extrusion goes down) has X mirrored."""
    return np.column_stack((-m[:, 0], m[:, 1:])) if number_of(body, 230, 1.0) < 0 else m


def _arc(x: float, y: float, r: float, first: float, sweep: float, size: float) -> np.ndarray:
    return arc_points(x * size, y * size, abs(r) * size, first, sweep) / size if size else np.empty((0, 2))


def _lightweight(body: Pairs) -> list[tuple[float, float, float]]:
    found: list[list[float]] = []
    for code, value in body:
        if code == 10:
            found.append([value_of(code, value), 0.0, 0.0])
        elif code in (20, 42) and found:
            found[-1][1 if code == 20 else 2] = value_of(code, value)
    return [(x, y, bulge) for x, y, bulge in found]


def _bulged(vertices: list[tuple[float, float, float]], closed: bool, scale: float) -> np.ndarray:
    """Points of a polyline whose bulge is the tangent of a quarter of each arc's angle."""
    points: list[tuple[float, float]] = []
    n = len(vertices)
    for k, (x, y, bulge) in enumerate(vertices):
        points.append((x, y))
        if bulge == 0.0 or (k == n - 1 and not closed):
            continue
        ex, ey, _ = vertices[(k + 1) % n]
        chord, sweep = hypot(ex - x, ey - y), 4.0 * atan(bulge)
        if chord == 0.0 or abs(bulge) * chord * scale / 2.0 < CHORD_ERROR / 1000.0:  # as good as straight
            continue
        r = chord / 2.0 / abs(sin(sweep / 2.0))
        away = chord / 2.0 / np.tan(sweep / 2.0)
        cx, cy = (x + ex) / 2.0 - away * (ey - y) / chord, (y + ey) / 2.0 + away * (ex - x) / chord
        first, count = atan2(y - cy, x - cx), steps_of(r * scale, sweep)
        points += [
            (cx + r * cos(first + sweep * i / count), cy + r * sin(first + sweep * i / count)) for i in range(1, count)
        ]
    if closed and vertices and vertices[-1][2]:
        points.append(vertices[0][:2])
    return np.array(points).reshape(-1, 2)


def _ellipse(body: Pairs, scale: float) -> np.ndarray:
    x, y, mx, my = (number_of(body, code) for code in (10, 20, 11, 21))
    ratio, first, last = number_of(body, 40, 1.0), number_of(body, 41), number_of(body, 42, 2 * pi)
    if number_of(body, 230, 1.0) < 0:
        ratio = -ratio
    sweep = _sweep(first, last)
    angle = first + np.linspace(0.0, sweep, steps_of(hypot(mx, my) * scale, sweep) + 1)
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack((x + c * mx - s * ratio * my, y + c * my + s * ratio * mx))


def _through(fit: np.ndarray, body: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """Knots and control points of a cubic spline through `fit` (n, 2), as CAD programs draw it: over the lengths of its
    chords, with the tangents that the entity states at its ends, natural where it states none.
    """
    from scipy.interpolate import make_interp_spline  # takes half a second to import

    is_closed = bool(int(number_of(body, 70)) & 1)
    points = np.vstack((fit, fit[:1])) if is_closed else fit
    steps = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.append(True, steps > _ONE_POINT * steps.max())]  # a point twice has no chord
    if is_closed:
        points[-1] = points[0]
    chords = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    if is_closed:
        spline = make_interp_spline(chords, points, bc_type="periodic")
    else:
        ends = []
        for code in (12, 13):
            tangent = np.array([number_of(body, code), number_of(body, code + 10)])
            length = float(np.hypot(*tangent))
            ends.append([(1, tangent / length)] if length else [(2, np.zeros(2))])
        spline = make_interp_spline(chords, points, bc_type=tuple(ends))  # type: ignore[arg-type]  # as scipy's page says
    return spline.t, spline.c


def _spline(body: Pairs, scale: float, name: str) -> np.ndarray:
    """A (rational) B-spline by de Boor's recursion; one of fit points alone as a cubic through them."""
    degree = int(number_of(body, 71, 3.0))
    knots, weights = np.array(numbers_of(body, 40)), np.array(numbers_of(body, 41))
    control, fit = places_of(body, 10), places_of(body, 11)
    if not len(control) and len(fit):
        if len(fit) < 3 or np.ptp(fit, axis=0).max() == 0.0:
            return fit
        if np.abs(fit).max() > _FARTHEST:
            raise InputError(f"a spline goes through a place beyond {_FARTHEST:g}; save the drawing again", name)
        degree, knots, control, weights = 3, *_through(fit, body), np.array([])
    n = len(control)
    if n <= degree or degree < 1 or len(knots) != n + degree + 1 or (len(weights) not in (0, n)):
        raise InputError("a spline's knots and control points do not belong together; explode it into lines", name)
    w = weights if len(weights) else np.ones(n)
    rows = np.column_stack((control * w[:, None], w))
    spans = np.unique(knots[degree : n + 1])
    bend = np.abs(np.diff(control, n=2, axis=0)).max() * scale if n > 2 else 0.0
    per_span = int(min(max(np.ceil(np.sqrt(degree * degree * bend / (8 * CHORD_ERROR))), 2), 2000))
    if len(spans) * per_span > MOST_POINTS:
        raise InputError(f"a spline takes more than {MOST_POINTS} points; explode it into lines", name)
    u = np.append((spans[:-1, None] + np.diff(spans)[:, None] * np.arange(per_span) / per_span).ravel(), spans[-1])
    k = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, n - 1)
    d = [rows[k - degree + j] for j in range(degree + 1)]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            low, high = knots[j + k - degree], knots[j + 1 + k - r]
            width = high - low
            share = np.divide(u - low, width, out=np.zeros_like(u), where=width > 0)[:, None]
            d[j] = (1 - share) * d[j - 1] + share * d[j]
    found: np.ndarray = d[degree][:, :2] / d[degree][:, 2:]
    return found
