"""The filled region of a drawing: whether it has one closed outline, and what to do where it has not."""

from __future__ import annotations

from typing import Literal

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

Holes = Literal["refuse", "cut", "fill"]
HOLES: tuple[Holes, ...] = ("refuse", "cut", "fill")
_ALL_EIGHT = np.ones((3, 3), dtype=int)


def single_region(cells: np.ndarray, holes: Holes = "refuse", name: str = "drawing") -> np.ndarray:
    """The cells (boolean, shape (rows, columns)) if they are one region whose outline a tool can follow.

    With holes "fill" the cells within are filled, so that a drawn outline counts as the shape within it; with "cut"
    they stay; with "refuse" they are an error. InputError, with the place (row and column from 1, first row on top),
    for a drawing that is empty or full, reaches the border, has several islands, hangs together at a corner only, or is
    one pixel wide somewhere: a line, or an outline that does not close.
    """
    if holes not in HOLES:
        raise InputError(f"holes = {holes!r} must be one of: {', '.join(HOLES)}")
    if cells.ndim != 2 or cells.dtype != bool:
        raise InputError(
            f"is an array of shape {cells.shape} and type {cells.dtype}; give rows × columns of bool", name
        )
    _check_border(cells, name)
    _check_islands(cells, name)
    filled = _without_holes(cells, holes, name)
    _check_corners(filled, name)
    _check_width(filled, name)
    return filled


def without_specks(cells: np.ndarray, largest: int, name: str = "drawing") -> tuple[np.ndarray, int]:
    """The cells without islands, and holes, of at most `largest` cells: what dust and JPEG leave; and their number.

    InputError where `largest` is no whole number from 0.
    """
    if not isinstance(largest, int) or largest < 0:
        raise InputError(f"specks = {largest!r} must be a whole number of pixels, 0 for none", name)
    if largest == 0:
        return cells, 0
    cleaned, removed = cells, 0
    for of_shape, structure in ((True, _ALL_EIGHT), (False, None)):
        labels, _ = _label(cleaned == of_shape, structure)
        sizes = np.bincount(labels.ravel())
        small = sizes <= largest
        small[0] = False
        cleaned = np.where(small[labels], not of_shape, cleaned)
        removed += int(small.sum())
    return cleaned, removed


def mended(cells: np.ndarray) -> np.ndarray:
    """The cells without parts one cell wide, and without places where two hang together at a corner only.

    What a threshold makes of a photograph: first an opening by 2 × 2 cells, then each pair that touches at a corner is
    joined by the two empty cells beside it, until none is left.
    """
    with needed_for("cleaning a photograph"):
        from scipy.ndimage import binary_opening

    found = np.asarray(binary_opening(cells, np.ones((2, 2), bool)))
    while True:
        a, b, c, d = found[:-1, :-1], found[:-1, 1:], found[1:, :-1], found[1:, 1:]
        touching = (a & d & ~b & ~c) | (b & c & ~a & ~d)
        if not touching.any():
            return found
        grown = np.pad(touching, ((0, 1), (0, 1)))
        found = found | grown | np.roll(grown, 1, 0) | np.roll(grown, 1, 1) | np.roll(grown, (1, 1), (0, 1))


def _check_border(cells: np.ndarray, name: str) -> None:
    if not cells.any():
        raise InputError("has nothing filled: there is no outline to trace", name)
    if cells.all():
        raise InputError("is filled all over: there is no outline to trace", name)
    edge = np.ones_like(cells)
    edge[1:-1, 1:-1] = False
    if (cells & edge).any():
        raise InputError(
            f"reaches the border of the drawing {_place(cells & edge)}: its outline is open there; "
            "leave an empty row or column around the shape",
            name,
        )


def _without_holes(cells: np.ndarray, holes: Holes, name: str) -> np.ndarray:
    with needed_for("filling the holes of a drawing"):
        from scipy.ndimage import binary_fill_holes

    filled = binary_fill_holes(cells)
    inside = filled & ~cells
    if not inside.any() or holes == "cut":
        return cells
    if holes == "fill":
        return filled
    count = _label(inside)[1]
    raise InputError(
        f"has {_count(count, 'hole')}, the first {_place(inside)}; fill them (a drawn outline counts as the shape "
        "within it) or cut them too (holes: fill or cut)",
        name,
    )


def _check_islands(cells: np.ndarray, name: str) -> None:
    labels, count = _label(cells, _ALL_EIGHT)
    if count < 2:
        return
    sizes = np.bincount(labels.ravel())[1:]
    shown = ", ".join(f"{_count(int(sizes[k]), 'pixel')} {_place(labels == k + 1)}" for k in range(min(count, 3)))
    more = ", ..." if count > 3 else ""
    raise InputError(
        f"has {count} islands ({shown}{more}); one outline has one: join them, trace each "
        "from a drawing of its own, or leave out small ones as specks",
        name,
    )


def _check_corners(cells: np.ndarray, name: str) -> None:
    a, b, c, d = cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]
    touching = (a & d & ~b & ~c) | (b & c & ~a & ~d)
    if touching.any():
        raise InputError(
            f"hangs together at a corner only {_place(touching)}: the tool cannot tell which way round; "
            "fill or clear one of the cells there",
            name,
        )


def _check_width(cells: np.ndarray, name: str) -> None:
    """Yokoi's connectivity number of each cell: how often the boundary passes through it; twice is one pixel wide."""
    thin = cells & (_passages(cells) > 1)
    if cells.sum() < 3:
        thin = cells
    if thin.any():
        raise InputError(
            f"is one pixel wide {_place(thin)}: a line, or an outline that does not close, whose outline would run "
            "back over itself; close it, or draw it two pixels wide or more",
            name,
        )


def _passages(cells: np.ndarray) -> np.ndarray:
    """S. Yokoi, J. Toriwaki, T. Fukumura (1975), the connectivity number for regions that connect over eight."""
    empty = np.pad(~cells, 1, constant_values=True)
    rows, columns = cells.shape
    offsets = [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1)]
    x = [empty[1 + r : 1 + r + rows, 1 + c : 1 + c + columns] for r, c in offsets]
    return sum(
        ((x[k] & ~(x[k + 1] & x[k + 2])).astype(np.int8) for k in (0, 2, 4, 6)), np.zeros(cells.shape, dtype=np.int8)
    )


def _label(cells: np.ndarray, structure: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    with needed_for("filling the holes of a drawing"):
        from scipy.ndimage import label

    labels, count = label(cells, structure=structure)
    return labels, int(count)


def _place(cells: np.ndarray) -> str:
    row, column = np.unravel_index(int(np.argmax(cells)), cells.shape)
    return f"at row {row + 1}, column {column + 1}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"
