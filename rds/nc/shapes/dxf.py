"""DXF drawings (ASCII): lines, arcs, circles, polylines with bulges, ellipses, splines, points, and blocks."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import atan, atan2, cos, hypot, pi, radians, sin
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.nc.shapes.curves import CHORD_ERROR, Curve, Drawing, arc_points, circle_curve, joined, polyline_curve, steps_of

_LARGEST = 128 << 20  # bytes
_MM = {1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0, 13: 0.001}  # by $INSUNITS
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
_PASSED_OVER = {
    **dict.fromkeys(
        ("TEXT", "MTEXT", "ATTRIB", "ATTDEF"), "text (explode it into lines, or use `rds nc make job`'s text)"
    ),
    **dict.fromkeys(("DIMENSION", "LEADER", "MULTILEADER", "TOLERANCE"), "dimensions"),
    "HATCH": "hatches",
}
DEEPEST = 16  # blocks within one another
Pairs = list[tuple[int, str]]


def read_dxf(path: Path, unit: str | None = None) -> Drawing:
    """The curves of an ASCII DXF file, on its layers, seen from above (Z is left out).

    Lengths are in the unit that the header names ($INSUNITS), or in `unit` (mm, cm, m or in), which has to be given
    where it names none. Lines and arcs of a layer whose ends meet become one curve. Text, dimensions and hatches are
    passed over and told; so is what is on layers that are switched off. InputError for what is no such file.
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
    pairs = _pairs(data.decode("utf-8", "replace"), name)
    sections = _sections(pairs)
    if "ENTITIES" not in sections:
        raise InputError("has no ENTITIES section; save it as ASCII DXF (R12 or later)", name)
    scale = UNITS[unit] if unit else _scale(sections.get("HEADER", []), name)
    reader = _Reader(name, scale, _blocks(sections.get("BLOCKS", [])), _off(sections.get("TABLES", [])))
    reader.take(_entities(sections["ENTITIES"]), np.array([[scale, 0.0, 0.0], [0.0, scale, 0.0]]), None, 0)
    notes = [f"passed over: {count} × {what}" for what, count in reader.passed_over.items()]
    return Drawing(joined(reader.curves), name, notes)


def _pairs(text: str, name: str) -> Pairs:
    lines = text.splitlines()
    found: Pairs = []
    for k in range(0, len(lines) - 1, 2):
        code = lines[k].strip()
        if not code.lstrip("-").isdigit():
            raise InputError(f"{code[:40]!r} is no group code; save it as ASCII DXF (R12 or later)", f"{name}:{k + 1}")
        found.append((int(code), lines[k + 1].strip()))
    if not found:
        raise InputError("is empty; save it as ASCII DXF (R12 or later)", name)
    return found


def _sections(pairs: Pairs) -> dict[str, Pairs]:
    found: dict[str, Pairs] = {}
    current: Pairs | None = None
    for k, (code, value) in enumerate(pairs):
        if code == 0 and value == "SECTION":
            current = found.setdefault(pairs[k + 1][1] if k + 1 < len(pairs) else "", [])
        elif code == 0 and value in ("ENDSEC", "EOF"):
            current = None
        elif current is not None:
            current.append((code, value))
    return found


def _scale(header: Pairs, name: str) -> float:
    for k, (code, value) in enumerate(header):
        if code == 9 and value == "$INSUNITS" and k + 1 < len(header):
            units = int(header[k + 1][1])
            if units in _MM:
                return _MM[units]
            if units:
                raise InputError(f"$INSUNITS = {units} is no unit of drawings of parts; save it in mm or inch", name)
    raise InputError("does not say its unit ($INSUNITS); give it (unit: mm, cm, m or in)", name)


def _entities(pairs: Pairs) -> Iterator[tuple[str, Pairs]]:
    kind, body = "", []  # type: str, Pairs
    for code, value in pairs:
        if code == 0:
            if kind:
                yield kind, body
            kind, body = value, []
        else:
            body.append((code, value))
    if kind:
        yield kind, body


def _blocks(pairs: Pairs) -> dict[str, tuple[tuple[float, float], list[tuple[str, Pairs]]]]:
    found: dict[str, tuple[tuple[float, float], list[tuple[str, Pairs]]]] = {}
    inside: list[tuple[str, Pairs]] | None = None
    for kind, body in _entities(pairs):
        if kind == "BLOCK":
            inside = []
            base = (_number(body, 10, 0.0), _number(body, 20, 0.0))
            found[_text(body, 2)] = (base, inside)
        elif kind == "ENDBLK":
            inside = None
        elif inside is not None:
            inside.append((kind, body))
    return found


def _off(tables: Pairs) -> set[str]:
    """Layers that are switched off or frozen."""
    return {
        _text(body, 2)
        for kind, body in _entities(tables)
        if kind == "LAYER" and (_number(body, 62, 7.0) < 0 or int(_number(body, 70, 0.0)) & 1)
    }


def _text(body: Pairs, code: int, default: str = "") -> str:
    return next((value for key, value in body if key == code), default)


def _number(body: Pairs, code: int, default: float = 0.0) -> float:
    text = _text(body, code)
    try:
        return float(text) if text else default
    except ValueError:
        raise InputError(f"group {code} of a DXF entity is {text[:40]!r}, not a number") from None


def _all(body: Pairs, code: int) -> list[float]:
    return [float(value) for key, value in body if key == code]


class _Reader:
    def __init__(self, name: str, scale: float, blocks: dict, off: set[str]):
        self.name, self.scale, self.blocks, self.off = name, scale, blocks, off
        self.curves: list[Curve] = []
        self.passed_over: dict[str, int] = {}

    def _pass_over(self, what: str) -> None:
        self.passed_over[what] = self.passed_over.get(what, 0) + 1

    def take(
        self, entities: Iterator[tuple[str, Pairs]] | list[tuple[str, Pairs]], m: np.ndarray, on: str | None, depth: int
    ) -> None:
        """Entities under the transformation m (2 × 3, to mm); `on`: the layer of the insert, for what is on layer 0."""
        vertices: list[tuple[float, float, float]] | None = None
        closed, poly_layer = False, ""
        for kind, body in entities:
            layer = _text(body, 8, "0")
            layer = on if on is not None and layer == "0" else layer
            if kind == "POLYLINE":
                vertices, closed, poly_layer = [], bool(int(_number(body, 70)) & 1), layer
            elif kind == "VERTEX" and vertices is not None:
                vertices.append((_number(body, 10), _number(body, 20), _number(body, 42)))
            elif kind == "SEQEND":
                if vertices:
                    self._add(_bulged(vertices, closed, self.scale), closed, poly_layer, m)
                vertices = None
            elif layer in self.off:
                self._pass_over("objects of hidden layers")
            else:
                self._entity(kind, body, layer, m, depth)

    def _entity(self, kind: str, body: Pairs, layer: str, m: np.ndarray, depth: int) -> None:
        x, y = _number(body, 10), _number(body, 20)
        mirror = -1.0 if _number(body, 230, 1.0) < 0 else 1.0  # an extrusion downwards mirrors X
        if mirror < 0:
            m = np.column_stack((m[:, 0] * -1.0, m[:, 1], m[:, 2])) if kind not in ("LINE", "ELLIPSE", "SPLINE") else m
        if kind == "LINE":
            self._add(np.array([[x, y], [_number(body, 11), _number(body, 21)]]), False, layer, m)
        elif kind == "POINT":
            self._circle(x, y, 0.0, layer, m)
        elif kind == "CIRCLE":
            self._circle(x, y, _number(body, 40), layer, m)
        elif kind == "ARC":
            first, last = radians(_number(body, 50)), radians(_number(body, 51))
            r = _number(body, 40)
            sweep = (last - first) % (2 * pi) or 2 * pi
            self._add(
                arc_points(x * self.scale, y * self.scale, r * self.scale, first, sweep) / self.scale, False, layer, m
            )
        elif kind == "LWPOLYLINE":
            closed = bool(int(_number(body, 70)) & 1)
            self._add(_bulged(_lightweight(body), closed, self.scale), closed, layer, m)
        elif kind == "ELLIPSE":
            self._add(_ellipse(body, self.scale), False, layer, m)
        elif kind == "SPLINE":
            self._add(_spline(body, self.scale, self.name), bool(int(_number(body, 70)) & 1), layer, m)
        elif kind == "INSERT":
            self._insert(body, layer, m, depth)
        else:
            self._pass_over(_PASSED_OVER.get(kind, f"{kind} (no curve of the plane)"))

    def _insert(self, body: Pairs, layer: str, m: np.ndarray, depth: int) -> None:
        block = self.blocks.get(_text(body, 2))
        if block is None or depth >= DEEPEST:
            self._pass_over("inserts of blocks that are not in the file")
            return
        (bx, by), entities = block
        angle, sx, sy = radians(_number(body, 50)), _number(body, 41, 1.0), _number(body, 42, 1.0)
        c, s = cos(angle), sin(angle)
        turn = np.array([[c * sx, -s * sy], [s * sx, c * sy]])
        place = np.array([_number(body, 10), _number(body, 20)]) - turn @ np.array([bx, by])
        self.take(entities, np.column_stack((m[:, :2] @ turn, m[:, :2] @ place + m[:, 2])), layer, depth + 1)

    def _circle(self, x: float, y: float, r: float, layer: str, m: np.ndarray) -> None:
        a = m[:, :2]
        size = float(np.sqrt(abs(np.linalg.det(a))))
        if np.allclose(a.T @ a, size**2 * np.eye(2), rtol=1e-9, atol=1e-12):
            cx, cy = a @ (x, y) + m[:, 2]
            self.curves.append(circle_curve(float(cx), float(cy), r * size, layer))
        else:
            self._add(arc_points(x, y, r, 0.0, 2 * pi), True, layer, m)

    def _add(self, points: np.ndarray, closed: bool, layer: str, m: np.ndarray) -> None:
        curve = polyline_curve(points @ m[:, :2].T + m[:, 2], closed, layer)
        if curve is not None:
            self.curves.append(curve)


def _lightweight(body: Pairs) -> list[tuple[float, float, float]]:
    found: list[list[float]] = []
    for code, value in body:
        if code == 10:
            found.append([float(value), 0.0, 0.0])
        elif code in (20, 42) and found:
            found[-1][1 if code == 20 else 2] = float(value)
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
        if chord == 0.0:
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
    x, y, mx, my = (_number(body, code) for code in (10, 20, 11, 21))
    ratio, first, last = _number(body, 40, 1.0), _number(body, 41), _number(body, 42, 2 * pi)
    if _number(body, 230, 1.0) < 0:
        ratio = -ratio
    sweep = (last - first) % (2 * pi) or 2 * pi
    angle = first + np.linspace(0.0, sweep, steps_of(hypot(mx, my) * scale, sweep) + 1)
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack((x + c * mx - s * ratio * my, y + c * my + s * ratio * mx))


def _spline(body: Pairs, scale: float, name: str) -> np.ndarray:
    """A (rational) B-spline by de Boor's recursion; one of fit points alone as lines through them."""
    degree = int(_number(body, 71, 3.0))
    knots, weights = np.array(_all(body, 40)), np.array(_all(body, 41))
    control = np.column_stack((_all(body, 10), _all(body, 20)))
    n = len(control)
    if n == 0 and _all(body, 11):
        return np.column_stack((_all(body, 11), _all(body, 21)))
    if n <= degree or len(knots) != n + degree + 1 or (len(weights) not in (0, n)):
        raise InputError("a spline's knots and control points do not belong together; explode it into lines", name)
    w = weights if len(weights) else np.ones(n)
    rows = np.column_stack((control * w[:, None], w))
    spans = np.unique(knots[degree : n + 1])
    bend = np.abs(np.diff(control, n=2, axis=0)).max() * scale if n > 2 else 0.0
    per_span = int(min(max(np.ceil(np.sqrt(degree * degree * bend / (8 * CHORD_ERROR))), 2), 2000))
    parts = [np.linspace(a, b, per_span, endpoint=False) for a, b in pairwise(spans)]
    found = []
    for u in np.append(np.concatenate(parts), spans[-1]):
        k = int(np.clip(np.searchsorted(knots, u, side="right") - 1, degree, n - 1))
        d = rows[k - degree : k + 1].copy()
        for r in range(1, degree + 1):
            for j in range(degree, r - 1, -1):
                low, high = knots[j + k - degree], knots[j + 1 + k - r]
                share = (u - low) / (high - low) if high > low else 0.0
                d[j] = (1 - share) * d[j - 1] + share * d[j]
        found.append(d[degree, :2] / d[degree, 2])
    return np.array(found)
