"""Drawings traced into closed outlines, counter-clockwise, and the path along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.quantities import Quantity
from rds.core.types import LineSegment, Segment
from rds.nc.paths.arc_fit import fit
from rds.nc.paths.boundary import boundary_cells
from rds.nc.paths.deviation import hausdorff
from rds.nc.paths.measure import signed_area, trace
from rds.nc.paths.needs import needed
from rds.nc.paths.numbers import COORDINATE, FEED_RATE, NOT_NEGATIVE, POSITIVE, number, point
from rds.nc.paths.region import Holes, mended, single_region, without_specks
from rds.nc.paths.smoothing import are_simple, smoothed, without_idle_points

Trace = Literal["contour", "blob"]
TRACES: tuple[Trace, ...] = ("contour", "blob")
LEVEL = Quantity("darkness from 0 to 1 where the shape begins", above=0.0)
MOST_PASSES = 1000
_ARC_SHARE = 0.25  # of the tolerance, for fitting arcs to the smoothed outline
_BLUR_BEFORE_ARCS = 0.95  # of the rest; arcs are fitted to points that are dense
_CHORD_ERROR = 1e-5  # mm: of the chords that stand for arcs while their deviation is measured


@dataclass(frozen=True)
class Outline:
    """A traced drawing: the path to cut, and what it was made from. Lengths in mm."""

    segments: list[Segment]
    rings: list[np.ndarray]  # as cut: closed, shape (n, 2); the outer one counter-clockwise, holes clockwise
    traced: list[np.ndarray]  # as traced, before smoothing
    deviation: float  # Hausdorff distance between the two, measured
    tolerance: float  # what it was allowed to be
    darkness: np.ndarray  # the drawing, shape (rows, columns)
    pixel: float
    at: tuple[float, float]  # lower left corner of the drawing
    specks: int = 0  # islands and holes that were left out

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the drawing, as matplotlib's `extent` wants them."""
        rows, columns = self.darkness.shape
        x, y = self.at
        return (x, x + columns * self.pixel, y, y + rows * self.pixel)


def outline(
    drawing: np.ndarray,
    pixel: float,
    feed_rate: float,
    *,
    method: Trace = "contour",
    holes: Holes = "refuse",
    level: float | None = 0.5,
    invert: bool = False,
    specks: int = 0,
    blur: float = 0.0,
    photo: bool = False,
    tolerance: float = 0.0,
    arcs: bool = False,
    at: Sequence[float] = (0.0, 0.0),
    depth: float = 0.0,
    passes: int = 1,
    name: str = "drawing",
) -> Outline:
    """The outline of the shape in a drawing, counter-clockwise, as a path at z = -depth.

    `drawing`: boolean cells, or darkness from 0 to 1, shape (rows, columns), first row on top; what is at least `level`
    dark is the shape, with `invert` what is less. `pixel` is the size of a cell in mm, `at` the place of the drawing's
    lower left corner, `feed_rate` in mm/s.

    `method` "contour" follows the line where the darkness is `level`, between the centres of the cells (marching
    squares, scikit-image's `find_contours`); "blob" goes from centre to centre of the cells on the boundary, as
    three-axis-mill does. With a `tolerance` (mm) the outline is smoothed and may be that far from the traced one; with
    `arcs` it is cut in arcs as well as lines. `holes`: "refuse", "fill" (the outer outline alone) or "cut" (clockwise,
    before the outer one; not for a blob). Islands and holes of at most `specks` cells are left out first.
    The depth is reached in `passes` equal steps, each closed before the next.

    `blur` (cells) is the width (standard deviation) of a Gaussian that the darkness is smoothed by; `level` None is
    Otsu's, which parts light from dark best. `photo` cleans what a camera saw: parts one cell wide are left out, and
    parts that hang together at a corner joined, so that neither is refused.

    InputError names the place of what cannot be followed: see `region.single_region`.
    """
    size = number(pixel, "pixel", name, POSITIVE)
    feed = number(feed_rate, "feed rate", name, FEED_RATE)
    allowed = number(tolerance, "tolerance", name, NOT_NEGATIVE)
    x, y, _ = point(at, "at", name, sizes=(2,))
    bottom = number(depth, "depth", name, COORDINATE)
    if method not in TRACES:
        raise InputError(f"{name}: trace = {method!r} must be one of: {', '.join(TRACES)}")
    if method == "blob" and holes == "cut":
        raise InputError(f"{name}: a blob has one outline, without its holes; fill them, or trace the contour")
    if not isinstance(passes, int) or not 1 <= passes <= MOST_PASSES:
        raise InputError(f"{name}: passes = {passes!r} must be a whole number from 1 to {MOST_PASSES}")
    if passes > 1 and bottom <= 0:
        raise InputError(f"{name}: {passes} passes need a depth to divide; give a depth of more than 0 mm")
    if arcs and allowed == 0:
        raise InputError(f"{name}: arcs need a tolerance to fit them with; give one (half a pixel is {size / 2:g} mm)")
    darkness = _blurred(_darkness(drawing, invert, name), number(blur, "blur", name, NOT_NEGATIVE))
    threshold = _otsu(darkness) if level is None else LEVEL.check(level, "level", name)
    cells = darkness >= threshold
    if not cells.any() or cells.all():
        found = "nowhere as dark as" if not cells.any() else "nowhere lighter than"
        raise InputError(
            f"is {found} level {threshold:g} (its darkness goes from {darkness.min():.2g} to {darkness.max():.2g}): "
            "there is no outline to trace; choose another level, or invert",
            name,
        )
    clean, left_out = without_specks(mended(cells) if photo else cells, specks, name)
    region = single_region(clean, holes, name)

    pixels = [boundary_cells(region)] if method == "blob" else _contours(darkness, region, threshold, name)
    rows = darkness.shape[0]
    placed = [np.column_stack([(p[:, 1] + 0.5) * size + x, (rows - 0.5 - p[:, 0]) * size + y]) for p in pixels]
    traced = _oriented([without_idle_points(_closed(ring)) for ring in placed])
    cut, deviation, flat = _shaped(traced, allowed, arcs, feed, name)
    levels = [0.0 - bottom * (k + 1) / passes for k in range(passes)]
    # holes first: once the outer outline is cut, the part may come loose
    segments = [s for ring in [*flat[1:], flat[0]] for s in _in_passes(ring, levels)]
    return Outline(segments, cut, traced, deviation, allowed, darkness, size, (x, y), left_out)


def _darkness(drawing: np.ndarray, invert: bool, name: str) -> np.ndarray:
    array = np.asarray(drawing)
    if array.ndim != 2 or not array.size or array.dtype.kind not in "bf":
        raise InputError(
            f"{name}: an array of shape {array.shape} and type {array.dtype}; give rows × columns of bool, or of "
            "darkness from 0 to 1"
        )
    darkness = array.astype(float)
    if not np.all((darkness >= 0) & (darkness <= 1)):
        raise InputError(f"{name}: darkness must be from 0 (white) to 1 (black); divide the drawing by its black")
    return 1.0 - darkness if invert else darkness


def _blurred(darkness: np.ndarray, width: float) -> np.ndarray:
    if width == 0.0:
        return darkness
    with needed_for("blurring a drawing"):
        from scipy.ndimage import gaussian_filter

    return np.clip(gaussian_filter(darkness, width, mode="nearest"), 0.0, 1.0)


def _otsu(darkness: np.ndarray) -> float:
    """N. Otsu (1979): the level that makes the classes on its two sides as different as can be."""
    if darkness.min() == darkness.max():
        return 0.5
    return float(needed("skimage.filters").threshold_otsu(darkness))


def _contours(darkness: np.ndarray, region: np.ndarray, level: float, name: str) -> list[np.ndarray]:
    """Rings of (row, column) where the darkness crosses the level, the longest first."""
    # what was filled counts as black, what was left out as white
    field = np.where(region & (darkness < level), 1.0, np.where(~region & (darkness >= level), 0.0, darkness))
    # no pixel is exactly at the level that is followed, so that the line is nowhere degenerate
    used = level if not np.any(field == level) else (level + float(field[field < level].max())) / 2
    rings = needed("skimage.measure").find_contours(field, used, fully_connected="low")
    if not rings or any(not np.array_equal(ring[0], ring[-1]) for ring in rings):
        raise InputError("its outline does not close; leave an empty row or column around the shape", name)
    return sorted(rings, key=lambda ring: abs(signed_area(ring)), reverse=True)


def _closed(ring: np.ndarray) -> np.ndarray:
    return ring if np.array_equal(ring[0], ring[-1]) else np.vstack([ring, ring[:1]])


def _oriented(rings: list[np.ndarray]) -> list[np.ndarray]:
    """The first counter-clockwise, the others clockwise: the shape is always on the left."""
    return [ring if (signed_area(ring[:-1]) > 0) == (k == 0) else ring[::-1] for k, ring in enumerate(rings)]


def _shaped(
    traced: list[np.ndarray], tolerance: float, arcs: bool, feed: float, name: str
) -> tuple[list[np.ndarray], float, list[list[Segment]]]:
    """Rings as cut, their deviation from the traced ones, and their segments at z = 0."""
    if not are_simple(traced):
        raise InputError("its outline touches itself; draw it two pixels wide or more there", name)
    if tolerance == 0:
        return traced, 0.0, [_lines(ring, feed) for ring in traced]
    if not arcs:
        rings, deviation = smoothed(traced, tolerance)
        return rings, deviation, [_lines(ring, feed) for ring in rings]
    share = _ARC_SHARE
    for _ in range(6):
        rounded, _ = smoothed(traced, (1 - share) * tolerance, blur=_BLUR_BEFORE_ARCS)
        flat = [fit(np.column_stack([r, np.zeros(len(r))]), share * tolerance, feed)[0] for r in rounded]
        rings = [trace(ring, _CHORD_ERROR)[:, :2] for ring in flat]
        deviation = hausdorff(traced, rings) + _CHORD_ERROR
        if are_simple(rings) and deviation <= tolerance:
            return rings, deviation, flat
        share /= 2
    raise InputError(f"no arcs fit the outline within {tolerance:g} mm; take another tolerance, or lines", name)


def _lines(ring: np.ndarray, feed: float) -> list[Segment]:
    points = [(float(px), float(py), 0.0) for px, py in ring]
    return [LineSegment(a, b, feed) for a, b in pairwise(points)]


def _in_passes(ring: list[Segment], levels: list[float]) -> list[Segment]:
    """A closed ring at each of the levels (z, mm), with a plunge between them."""
    segments: list[Segment] = []
    x, y, _ = ring[0].start
    for k, z in enumerate(levels):
        if k:
            segments.append(LineSegment((x, y, levels[k - 1]), (x, y, z), ring[0].feed_rate))
        segments += [_at_height(segment, z) for segment in ring]
    return segments


def _at_height(segment: Segment, z: float) -> Segment:
    moved: dict[str, Any] = {"start": (*segment.start[:2], z), "end": (*segment.end[:2], z)}
    if not isinstance(segment, LineSegment):
        moved["centre"] = (*segment.centre[:2], z)
    return replace(segment, **moved)
