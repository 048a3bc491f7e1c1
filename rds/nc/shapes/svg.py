"""SVG drawings: paths and shapes with their transforms, layers and units, in mm with Y upwards.

Our own, because `svgpathtools` gives paths; a part needs their units and layers, and what is hidden left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import cos, hypot, radians, sin, sqrt, tan
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.nc.shapes.curves import CHORD_ERROR, MOST_POINTS, Curve, Drawing, assembled, circle_curve, polyline_curve
from rds.nc.shapes.svg_path import polylines
from rds.nc.shapes.svg_style import NOT_DONE, PAINT, SIMPLE, declared, not_done, rules_of, tag_of

_LARGEST = 64 << 20  # bytes
_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "px": 25.4 / 96, "": 25.4 / 96, "Q": 0.25}
_LENGTH = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(mm|cm|in|pt|pc|px|Q|%|)\s*")
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^)]*)\)")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_PASSED_OVER = {
    **dict.fromkeys(("text", "flowRoot"), "text (Path > Object to Path in Inkscape makes curves of it)"),
    "image": "a pixel image (`rds nc make outline` traces one)",
    "foreignObject": "foreign content",
}
_XLINK = "{http://www.w3.org/1999/xlink}"
_ASPECT = re.compile(r"x(Min|Mid|Max)Y(Min|Mid|Max)(?:\s+(meet|slice))?")
_SHARE = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}  # of the room that is left, before the drawing
_UNSEEN = ("none", "transparent")
_BARE = "objects with fill none and no stroke, which nobody sees; give them a stroke if they are to be cut"
_SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
_NOT_DRAWN = ("defs", "metadata", "clipPath", "mask", "marker", "pattern", "symbol", "style", "title", "desc")
DEEPEST = 100  # groups within one another
_PAINTED = {"fill": "black", "stroke": "none"}  # where nothing is said
Matrix = np.ndarray  # 2 × 3
View = tuple[float, float]  # what per cent are of, in user units


def read_svg(path: Path) -> Drawing:
    """The curves of an SVG file. Its size and viewBox say what is a mm; without a unit a user unit is 1/96 inch.

    The layer of a curve is the label of the Inkscape layer that it is in, or the id of its outermost group with one.
    What is hidden or has neither fill nor stroke, and text and images, is passed over and told; what is clipped or
    masked is drawn whole, and told.
    InputError for what is no SVG.
    """
    name = str(path)
    try:
        data = read_limited(path, _LARGEST, "an SVG drawing", "leave out embedded images")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}; name a drawing", name) from error
    if b"<!ENTITY" in data.replace(b"\0", b""):  # in UTF-16, too
        raise InputError("defines entities; save it as plain SVG", name)
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # the last two: of a coding that it names
        raise InputError(f"is no SVG: {error}; save it as plain SVG in UTF-8", name) from error
    if tag_of(root) != "svg":
        raise InputError(f"is XML, but its first element is <{tag_of(root)}>, not <svg>; save it as plain SVG", name)
    reader = _Reader(name, root)
    matrix, view = _page(root, name)
    for child in root if reader.is_shown(root, True) else ():
        reader.walk(child, matrix, "", 0, view, paint=reader.paint(root, _PAINTED))
    return assembled(reader.curves, name, reader.passed_over)


def _page(root: ElementTree.Element, name: str) -> tuple[Matrix, View]:
    """From user units to mm with Y upwards and the lower left corner of the page at 0; the size in user units."""
    box, px = _box(root), _MM["px"]
    width, height = (_length(root.get(side), name) for side in ("width", "height"))
    if min(width, height) < 0.0:
        raise InputError(f"its size is {width:g} by {height:g} mm; give it width and height above 0", name)
    if box is None:
        return np.array([[px, 0.0, 0.0], [0.0, -px, height or 0.0]]), (width / px, height / px)
    if not (width and height):
        scale = width / box[2] if width else (height / box[3] if height else px)
        width, height = width or box[2] * scale, height or box[3] * scale
    fitted = _fitted(box, width, height, root)
    return np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]) @ np.vstack((fitted, [0, 0, 1])) + [
        [0, 0, 0],
        [0, 0, height],
    ], (box[2], box[3])


def _box(element: ElementTree.Element) -> list[float] | None:
    box = [float(value) for value in _NUMBER.findall(element.get("viewBox", ""))]
    return box if len(box) == 4 and box[2] > 0 and box[3] > 0 else None


def _fitted(box: list[float], width: float, height: float, element: ElementTree.Element) -> Matrix:
    """From a viewBox to a rectangle of this size, as preserveAspectRatio says: in its middle, unless told otherwise."""
    x, y = width / box[2], height / box[3]
    aspect = element.get("preserveAspectRatio", "").strip()
    if aspect == "none":
        return np.array([[x, 0.0, -box[0] * x], [0.0, y, -box[1] * y]])
    match = _ASPECT.match(aspect)
    right, down, how = match.groups() if match else ("Mid", "Mid", None)
    scale = max(x, y) if how == "slice" else min(x, y)
    dx, dy = _SHARE[right] * (width - box[2] * scale), _SHARE[down] * (height - box[3] * scale)
    return np.array([[scale, 0.0, dx - box[0] * scale], [0.0, scale, dy - box[1] * scale]])


def _length(text: str | None, name: str, per_unit: float | None = None, whole: float = 0.0) -> float:
    """mm, or user units where `per_unit` (mm for each) is given; 0 where there is none. `whole`: of per cent."""
    if text is None or text.strip() == "auto":
        return 0.0
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise InputError(f"{text!r} is no length; write a number with mm, cm, in, pt, pc or px", name)
    if match[2] == "%":
        if per_unit is not None and not whole and float(match[1]):
            raise InputError(f"{text!r} is of a size that the drawing does not say; give it a viewBox", name)
        return float(match[1]) / 100.0 * whole
    if per_unit is None:
        return float(match[1]) * _MM[match[2]]
    return float(match[1]) * (1.0 if match[2] in ("", "px") else _MM[match[2]] / _MM["px"])


class _Reader:
    def __init__(self, name: str, root: ElementTree.Element):
        self.name = name
        self.curves: list[Curve] = []
        self.passed_over: dict[str, int] = {}
        self.rules = rules_of(root)
        self.by_id = {element.get("id"): element for element in root.iter() if element.get("id")}
        self.taken = 0  # points so far; an element counts as one, a clone as fifty
        self.cloned: list[ElementTree.Element] = []  # what the clones show that are being drawn
        self.paint_is_known = True
        for selector, said in self.rules.items():
            if SIMPLE.fullmatch(selector):
                continue
            self.paint_is_known &= said.keys().isdisjoint(PAINT)
            if not said.keys() <= set(PAINT):
                self._pass_over(
                    f"the style sheet's rule for {selector[:60]!r} that hides, shows, clips, dashes or transforms; "
                    "write that at the objects"
                )

    def is_shown(self, element: ElementTree.Element, visible: bool) -> bool | None:
        """Whether an element is visible, as what it is in is unless it says otherwise; None: nor anything within it."""
        said = {key: element.get(key, "") for key in ("display", "visibility") if element.get(key)}
        said |= self._ruled(element)
        style = declared(element.get("style", ""))
        said |= {key: value for key, value in style.items() if key in said or key in ("display", "visibility")}
        if said.get("display") == "none":
            return None
        visibility = said.get("visibility", "inherit")
        return visible if visibility == "inherit" else visibility == "visible"

    def paint(self, element: ElementTree.Element, outer: Mapping[str, str]) -> dict[str, str]:
        """Fill and stroke of an element, which are those of what it is in unless it says otherwise."""
        own = {key: element.get(key, "") for key in PAINT} | self._ruled(element)
        own |= declared(element.get("style", ""))
        return {key: outer[key] if own[key] in ("", "inherit") else own[key] for key in PAINT}

    def _ruled(self, element: ElementTree.Element) -> dict[str, str]:
        """What the style sheets say of an element."""
        classes = (f".{word}" for word in element.get("class", "").split())
        said: dict[str, str] = {}
        for selector in (tag_of(element), *classes, f"#{element.get('id')}"):
            said |= self.rules.get(selector, {})
        return said

    def walk(
        self,
        element: ElementTree.Element,
        matrix: Matrix,
        layer: str,
        depth: int,
        view: View,
        visible: bool = True,
        use: ElementTree.Element | None = None,
        paint: Mapping[str, str] = _PAINTED,
    ) -> None:
        """The curves of an element and of those within it; `use`: the clone that it is drawn for."""
        tag = tag_of(element)
        if tag in _NOT_DRAWN and not (use is not None and tag == "symbol"):
            return
        if depth > DEEPEST:
            self._pass_over(f"objects in more than {DEEPEST} groups within one another (ungroup them)")
            return
        self._count(1)
        shown = self.is_shown(element, visible)
        if shown is None or (not shown and not len(element)):
            self._pass_over("hidden objects")
            return
        if tag in _PASSED_OVER:
            self._pass_over(_PASSED_OVER[tag])
            return
        paint = self.paint(element, paint)
        said = {key: element.get(key, "") for key in (*NOT_DONE, "overflow")} | self._ruled(element)
        said |= declared(element.get("style", ""))
        for what in not_done(said, is_stroked=paint["stroke"] not in _UNSEEN):
            self._pass_over(what)
        by_style = said.get("transform", "none")
        if by_style != "none" or element.get("transform-origin"):
            self._pass_over(
                "a transformation by CSS (transform-origin, or transform in a style); write it as transform="
            )
        if element.get("transform"):
            matrix = _times(matrix, _transform(element.get("transform", ""), self.name))
        frame = None
        if tag in ("svg", "symbol"):
            matrix, view, frame = self._nested(element, matrix, view, use)
        if tag in ("g", "a", "svg", "switch", "symbol"):
            label = element.get(f"{_INKSCAPE}label") if element.get(f"{_INKSCAPE}groupmode") == "layer" else None
            inner = label or layer or (element.get("id") or "" if tag == "g" else "")
            before = len(self.curves)
            for child in self._one_of(element) if tag == "switch" else element:
                self.walk(child, matrix, inner, depth + 1, view, shown, paint=paint)
            if frame is not None and said["overflow"] in ("visible", "auto"):
                frame = None
            if frame is not None and any(_reaches_out(curve.points, *frame) for curve in self.curves[before:]):
                self._pass_over("the border of a drawing within the drawing, beyond which it is drawn as well")
            return
        if tag == "use":
            target = self.by_id.get((element.get("href") or element.get(f"{_XLINK}href") or "").strip().lstrip("#"))
            if target is None or target in self.cloned:
                self._pass_over("a clone of what is not in the file, or of itself")
                return
            self._count(50)
            self.cloned.append(target)
            at = [_length(element.get(key), self.name, _MM["px"], size) for key, size in zip("xy", view, strict=True)]
            moved = _times(matrix, np.array([[1.0, 0.0, at[0]], [0.0, 1.0, at[1]]]))
            self.walk(target, moved, layer, depth + 1, view, shown, use=element, paint=paint)
            self.cloned.pop()
            return
        if tag in _SHAPES and self.paint_is_known and all(paint[key] in _UNSEEN for key in PAINT):
            self._pass_over(_BARE)
            return
        if not any(view) and tag == "rect" and {element.get("width"), element.get("height")} == {"100%"}:
            self._pass_over("a background as large as the page, of which the file gives no size")
            return
        for points, closed, circle in self._shape(tag, element, matrix, view):
            curve = circle_curve(*circle, layer) if circle else polyline_curve(_moved(points, matrix), closed, layer)
            if curve is not None:
                self._count(len(curve.points))
                self.curves.append(curve)

    def _count(self, more: int) -> None:
        self.taken += more
        if self.taken > MOST_POINTS:
            raise InputError(
                f"has more than {MOST_POINTS} points, clones included; leave out what is not cut", self.name
            )

    def _nested(
        self, element: ElementTree.Element, matrix: Matrix, view: View, use: ElementTree.Element | None
    ) -> tuple[Matrix, View, tuple[Matrix, View]]:
        """What a drawing within the drawing is placed by, its size in its own units (a clone may set its size), and
        its border: what places it, and its size in the units of what it is in."""

        def number(key: str, whole: float) -> float:
            own = element.get(key, "0" if key in "xy" else "100%")
            given = own if use is None or key in "xy" else use.get(key, own)
            return _length(given, self.name, _MM["px"], whole) if whole or given != "100%" else 0.0

        x, y, width, height = (number(key, view[k % 2]) for k, key in enumerate(("x", "y", "width", "height")))
        matrix = _times(matrix, np.array([[1.0, 0.0, x], [0.0, 1.0, y]]))
        box = _box(element)
        if box is None:
            return matrix, (width, height), (matrix, (width, height))
        if not (width > 0.0 and height > 0.0):
            raise InputError("has a drawing within it without a size; give it width and height", self.name)
        return _times(matrix, _fitted(box, width, height, element)), (box[2], box[3]), (matrix, (width, height))

    def _one_of(self, element: ElementTree.Element) -> list[ElementTree.Element]:
        """The first of the alternatives of a <switch> that asks for nothing, and can be drawn if one can."""
        every = [child for child in element if tag_of(child) not in ("comment", *_NOT_DRAWN)]
        free = [child for child in every if not {"requiredExtensions", "systemLanguage"} & child.attrib.keys()] or every
        drawn = [child for child in free if tag_of(child) not in _PASSED_OVER] or free
        for child in every:
            if child is not drawn[0]:
                self._pass_over(_PASSED_OVER.get(tag_of(child), "other alternatives of a <switch>"))
        return drawn[:1]

    def _pass_over(self, what: str) -> None:
        self.passed_over[what] = self.passed_over.get(what, 0) + 1

    def _shape(
        self, tag: str, element: ElementTree.Element, matrix: Matrix, view: View
    ) -> Iterator[tuple[np.ndarray, bool, tuple[float, float, float] | None]]:
        """Points in user units, whether closed, and the circle in mm where it is one."""
        scale = float(np.sqrt(abs(np.linalg.det(matrix[:, :2])))) or 1.0
        error = CHORD_ERROR / scale
        per_unit = _MM["px"]

        def number(key: str) -> float:
            along = hypot(*view) / sqrt(2.0) if key == "r" else view["y" in key or key == "height"]
            return _length(element.get(key), self.name, per_unit, along)

        def radii() -> tuple[float, float]:
            """rx and ry, of which one that is not given, or negative, is as the other."""
            given = [number(key) if element.get(key, "auto").strip() != "auto" else -1.0 for key in ("rx", "ry")]
            rx, ry = (given[k] if given[k] >= 0 else max(given[1 - k], 0.0) for k in (0, 1))
            return rx, ry

        if tag == "path":
            for points, closed in polylines(element.get("d", ""), error, self.name):
                yield points, closed, None
        elif tag == "rect":
            x, y, w, h = number("x"), number("y"), number("width"), number("height")
            rx, ry = radii()
            rx, ry = (min(rx, w / 2), min(ry, h / 2)) if rx and ry else (0.0, 0.0)
            if w > 0 and h > 0:
                d = f"M{x + rx} {y}H{x + w - rx}A{rx} {ry} 0 0 1 {x + w} {y + ry}V{y + h - ry}"
                d += f"A{rx} {ry} 0 0 1 {x + w - rx} {y + h}H{x + rx}A{rx} {ry} 0 0 1 {x} {y + h - ry}V{y + ry}"
                d += f"A{rx} {ry} 0 0 1 {x + rx} {y}Z"
                for points, closed in polylines(d, error, self.name):
                    yield points, closed, None
        elif tag in ("circle", "ellipse"):
            cx, cy = number("cx"), number("cy")
            rx, ry = (number("r"),) * 2 if tag == "circle" else radii()
            if rx <= 0 or ry <= 0:
                return
            a = matrix[:, :2]
            round_still = abs(rx - ry) < 1e-9 * rx and np.allclose(a.T @ a, scale**2 * np.eye(2), atol=1e-9 * scale**2)
            if round_still:
                centre = _moved(np.array([[cx, cy]]), matrix)[0]
                yield np.empty((0, 2)), True, (float(centre[0]), float(centre[1]), rx * scale)
                return
            d = f"M{cx + rx} {cy}A{rx} {ry} 0 1 1 {cx - rx} {cy}A{rx} {ry} 0 1 1 {cx + rx} {cy}Z"
            for points, closed in polylines(d, error, self.name):
                yield points, closed, None
        elif tag == "line":
            yield np.array([[number("x1"), number("y1")], [number("x2"), number("y2")]]), False, None
        elif tag in ("polyline", "polygon"):
            values = [float(value) for value in _NUMBER.findall(element.get("points", ""))]
            yield np.array(values[: len(values) // 2 * 2]).reshape(-1, 2), tag == "polygon", None


def _reaches_out(points: np.ndarray, matrix: Matrix, size: View) -> bool:
    """Whether points (mm) lie outside of a border of this size, which `matrix` places."""
    if abs(np.linalg.det(matrix[:, :2])) < 1e-12 or min(size) <= 0.0:
        return False
    within = np.linalg.solve(matrix[:, :2], (points - matrix[:, 2]).T).T
    beyond = 1e-3 * max(size)  # chords of what touches the border
    return bool((within < -beyond).any() or (within > np.array(size) + beyond).any())


def _moved(points: np.ndarray, matrix: Matrix) -> np.ndarray:
    moved: np.ndarray = points @ matrix[:, :2].T + matrix[:, 2]
    return moved


def _times(a: Matrix, b: Matrix) -> Matrix:
    return np.column_stack((a[:, :2] @ b[:, :2], a[:, :2] @ b[:, 2] + a[:, 2]))


def _transform(text: str, name: str) -> Matrix:
    matrix = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    if _TRANSFORM.sub("", text).strip(" ,\t\r\n"):
        raise InputError(f"transform {text:.60} is none of matrix, translate, scale, rotate, skewX, skewY", name)
    for kind, inner in _TRANSFORM.findall(text):
        v = [float(value) for value in _NUMBER.findall(inner)]
        try:
            matrix = _times(matrix, _one_transform(kind, v))
        except (ValueError, IndexError):
            raise InputError(f"transform {kind}({inner}) has too few numbers; save it as plain SVG", name) from None
    return matrix


def _one_transform(kind: str, v: list[float]) -> Matrix:
    if kind == "matrix":
        a, b, c, d, e, f = v
        return np.array([[a, c, e], [b, d, f]])
    if kind == "translate":
        return np.array([[1.0, 0.0, v[0]], [0.0, 1.0, v[1] if len(v) > 1 else 0.0]])
    if kind == "scale":
        return np.array([[v[0], 0.0, 0.0], [0.0, v[1] if len(v) > 1 else v[0], 0.0]])
    if kind == "rotate":
        c, s = cos(radians(v[0])), sin(radians(v[0]))
        x, y = (v[1], v[2]) if len(v) > 2 else (0.0, 0.0)
        return np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y]])
    skew = tan(radians(v[0]))
    return np.array([[1.0, skew if kind == "skewX" else 0.0, 0.0], [skew if kind == "skewY" else 0.0, 1.0, 0.0]])
