"""Text as outlines, from matplotlib's own font or a font file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.nc.shapes.curves import CHORD_ERROR, Curve, Drawing, checked, polyline_curve
from rds.nc.shapes.svg_path import bezier

MOST_CHARACTERS = 1000


def text_drawing(text: str, height: float, font: Path | None = None) -> Drawing:
    """The outlines of a text whose capitals are `height` mm high, its baseline from x = 0 along y = 0.

    `font`: a TrueType or OpenType file; without one DejaVu Sans, which comes with matplotlib. Lines are 1.5 times the
    height apart. InputError for text without outlines, and characters that the font does not have.
    """
    from matplotlib import font_manager
    from matplotlib.ft2font import FT2Font
    from matplotlib.textpath import TextPath

    if not height > 0.0:
        raise InputError(f"text height = {height!r} must be more than 0 mm")
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"text of {len(text)} characters is too long; at most {MOST_CHARACTERS}")
    file = str(font) if font is not None else font_manager.findfont("DejaVu Sans")
    try:
        known = FT2Font(file).get_charmap()
    except (OSError, RuntimeError) as error:
        raise InputError("is no font that can be read; name a .ttf or .otf file", file) from error
    if lost := sorted({letter for letter in text if letter != "\n" and ord(letter) not in known}):
        raise InputError(f"the font has no {' '.join(lost)}; name another font, or leave them out", file)
    properties = font_manager.FontProperties(fname=file)
    size = 100.0
    capital = TextPath((0, 0), "H", size=size, prop=properties, usetex=False).get_extents().height
    scale = height / capital
    curves: list[Curve] = []
    for row, line in enumerate(text.split("\n")):
        if not line.strip():
            continue
        path = TextPath((0, 0), line.replace("$", r"\$"), size=size, prop=properties, usetex=False)
        for points in _outlines(path, CHORD_ERROR / scale):
            curve = polyline_curve(points * scale - (0.0, 1.5 * height * row), True, "text")
            if curve is not None and curve.closed:
                curves.append(curve)
    return checked(Drawing(curves, f"text {text!r:.40}"))


def _outlines(path: Any, chord_error: float) -> list[np.ndarray]:
    from matplotlib.path import Path as MplPath

    found: list[np.ndarray] = []
    points: list[complex] = []
    for values, code in path.iter_segments(simplify=False, curves=True):
        v = [complex(values[k], values[k + 1]) for k in range(0, len(values), 2)]
        if code in (MplPath.MOVETO, MplPath.CLOSEPOLY):
            if len(points) > 2:
                found.append(np.array([(p.real, p.imag) for p in points]))
            points = [v[0]] if code == MplPath.MOVETO else []
        elif code == MplPath.LINETO:
            points.append(v[0])
        elif code == MplPath.CURVE3:
            a, c, b = points[-1], v[0], v[1]
            points += bezier([a, a + 2 / 3 * (c - a), b + 2 / 3 * (c - b), b], chord_error)
        else:
            points += bezier([points[-1], *v], chord_error)
    return found
