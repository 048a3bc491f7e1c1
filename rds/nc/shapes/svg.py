"""SVG drawings: paths and shapes with their transforms, layers and units, in mm with Y upwards."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import cos, radians, sin, tan
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.nc.shapes.curves import CHORD_ERROR, Curve, Drawing, circle_curve, joined, polyline_curve
from rds.nc.shapes.svg_path import polylines

_LARGEST = 64 << 20  # bytes
_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "px": 25.4 / 96, "": 25.4 / 96}
_LENGTH = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(mm|cm|in|pt|pc|px|%|)\s*")
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^)]*)\)")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_PASSED_OVER = {
    "text": "text (Path > Object to Path in Inkscape makes curves of it)",
    "image": "a pixel image (`rds nc make outline` traces one)",
    "use": "a clone (Edit > Clone > Unlink in Inkscape makes a shape of it)",
    "foreignObject": "foreign content",
}
_NOT_DRAWN = ("defs", "metadata", "clipPath", "mask", "marker", "pattern", "symbol", "style", "title", "desc")
DEEPEST = 100  # groups within one another
Matrix = np.ndarray  # 2 × 3


def read_svg(path: Path) -> Drawing:
    """The curves of an SVG file. Its size and viewBox say what is a mm; without a unit a user unit is 1/96 inch.

    The layer of a curve is the label of the Inkscape layer that it is in, or the id of its outermost group with one.
    What is hidden, and text and images, is passed over and told. InputError for what is no SVG.
    """
    name = str(path)
    try:
        data = read_limited(path, _LARGEST, "an SVG drawing", "leave out embedded images")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}; name a drawing", name) from error
    if b"<!ENTITY" in data:
        raise InputError("defines entities; save it as plain SVG", name)
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise InputError(f"is no SVG: {error}; save it as plain SVG", name) from error
    if _tag(root) != "svg":
        raise InputError(f"is XML, but its first element is <{_tag(root)}>, not <svg>; save it as plain SVG", name)
    reader = _Reader(name)
    reader.walk(root, _to_mm(root, name), "", 0)
    notes = [f"passed over: {count} × {what}" for what, count in reader.passed_over.items()]
    return Drawing(joined(reader.curves), name, notes)


def _to_mm(root: ElementTree.Element, name: str) -> Matrix:
    """From user units to mm with Y upwards and the lower left corner of the page at 0."""
    box = [float(value) for value in _NUMBER.findall(root.get("viewBox", ""))]
    width, height = (_length(root.get(side), name) for side in ("width", "height"))
    if len(box) == 4 and box[2] > 0 and box[3] > 0:
        x = width / box[2] if width else (height / box[3] if height else _MM["px"])
        y = height / box[3] if height else x
        return np.array([[x, 0.0, -box[0] * x], [0.0, -y, (box[1] + box[3]) * y]])
    scale = _MM["px"]
    return np.array([[scale, 0.0, 0.0], [0.0, -scale, height or 0.0]])


def _length(text: str | None, name: str, per_unit: float | None = None) -> float:
    """mm, or user units where `per_unit` (mm for each) is given; 0 where there is none, or per cent."""
    if text is None:
        return 0.0
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise InputError(f"{text!r} is no length; write a number with mm, cm, in, pt, pc or px", name)
    if match[2] == "%":
        return 0.0
    if per_unit is None:
        return float(match[1]) * _MM[match[2]]
    return float(match[1]) * (1.0 if match[2] in ("", "px") else _MM[match[2]] / _MM["px"])


class _Reader:
    def __init__(self, name: str):
        self.name = name
        self.curves: list[Curve] = []
        self.passed_over: dict[str, int] = {}

    def walk(self, element: ElementTree.Element, matrix: Matrix, layer: str, depth: int) -> None:
        tag = _tag(element)
        if tag in _NOT_DRAWN or depth > DEEPEST:
            return
        style = dict(part.split(":", 1) for part in element.get("style", "").split(";") if ":" in part)
        shown = {key.strip(): value.strip() for key, value in style.items()}
        if shown.get("display", element.get("display")) == "none":
            self._pass_over("hidden objects")
            return
        if tag in _PASSED_OVER:
            self._pass_over(_PASSED_OVER[tag])
            return
        if element.get("transform"):
            matrix = _times(matrix, _transform(element.get("transform", ""), self.name))
        if tag in ("g", "a", "svg", "switch"):
            label = element.get(f"{_INKSCAPE}label") if element.get(f"{_INKSCAPE}groupmode") == "layer" else None
            inner = label or layer or (element.get("id") or "" if tag == "g" else "")
            for child in element:
                self.walk(child, matrix, inner, depth + 1)
            return
        for points, closed, circle in self._shape(tag, element, matrix):
            curve = circle_curve(*circle, layer) if circle else polyline_curve(_moved(points, matrix), closed, layer)
            if curve is not None:
                self.curves.append(curve)

    def _pass_over(self, what: str) -> None:
        self.passed_over[what] = self.passed_over.get(what, 0) + 1

    def _shape(
        self, tag: str, element: ElementTree.Element, matrix: Matrix
    ) -> Iterator[tuple[np.ndarray, bool, tuple[float, float, float] | None]]:
        """Points in user units, whether closed, and the circle in mm where it is one."""
        scale = float(np.sqrt(abs(np.linalg.det(matrix[:, :2])))) or 1.0
        error = CHORD_ERROR / scale
        per_unit = _MM["px"]

        def number(key: str) -> float:
            return _length(element.get(key), self.name, per_unit)

        if tag == "path":
            for points, closed in polylines(element.get("d", ""), error, self.name):
                yield points, closed, None
        elif tag == "rect":
            x, y, w, h = number("x"), number("y"), number("width"), number("height")
            rx = min(number("rx") or number("ry"), w / 2)
            ry = min(number("ry") or rx, h / 2)
            if w > 0 and h > 0:
                d = f"M{x + rx} {y}H{x + w - rx}A{rx} {ry} 0 0 1 {x + w} {y + ry}V{y + h - ry}"
                d += f"A{rx} {ry} 0 0 1 {x + w - rx} {y + h}H{x + rx}A{rx} {ry} 0 0 1 {x} {y + h - ry}V{y + ry}"
                d += f"A{rx} {ry} 0 0 1 {x + rx} {y}Z"
                for points, closed in polylines(d, error, self.name):
                    yield points, closed, None
        elif tag in ("circle", "ellipse"):
            cx, cy = number("cx"), number("cy")
            rx, ry = (number("r"),) * 2 if tag == "circle" else (number("rx"), number("ry"))
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


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else "comment"


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
            raise InputError(f"transform {kind}({inner}) has too few numbers", name) from None
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
