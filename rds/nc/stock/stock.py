"""The stock: a block of material as heights over a grid, and tools as the cells below them."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.nc.language.tool_library import ShapedTool
from rds.nc.stock.carving import FOUND, carve, raise_triangles

MOST_CELLS = 25_000_000
PROFILE = 1024  # parts of the squared radius, at which the end of a tool is known
_LARGEST = 256 << 20  # bytes of a part's file


@dataclass
class Stock:
    """Heights (rows of y, columns of x, mm) over cells of `cell` mm; `x0`, `y0`: the lower left corner; `floor`: its
    underside, z in mm."""

    heights: np.ndarray
    x0: float
    y0: float
    cell: float
    floor: float

    @classmethod
    def block(cls, low: Any, high: Any, cell: float) -> Stock:
        """A block from corner to corner (x, y, z; mm). InputError for none, or one of too many cells."""
        if not all(b > a for a, b in zip(low, high, strict=True)):
            raise InputError(f"stock from {list(low)} to {list(high)} mm has no volume; give the lower corner first")
        if not cell > 0.0:
            raise InputError(f"cell = {cell!r} must be more than 0 mm")
        columns, rows = (round((high[k] - low[k]) / cell + 0.499) for k in (0, 1))
        if rows * columns > MOST_CELLS:
            raise InputError(f"cells of {cell:g} mm make {rows} × {columns} of the stock; take larger ones")
        return cls(np.full((rows, columns), float(high[2])), float(low[0]), float(low[1]), cell, float(low[2]))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top, mm."""
        rows, columns = self.heights.shape
        return self.x0, self.x0 + columns * self.cell, self.y0, self.y0 + rows * self.cell

    @property
    def volume(self) -> float:
        """mm³ of what is left above the underside."""
        return float(np.clip(self.heights - self.floor, 0.0, None).sum()) * self.cell**2

    def cut(
        self, tool: ShapedTool, points: np.ndarray, owner: np.ndarray, rapid: np.ndarray, owners: int
    ) -> np.ndarray:
        """Move a tool's tip along points (n × 3, mm); what is found for each number of `owner` (`carving.FOUND`)."""
        found = np.zeros((owners, FOUND))
        if len(points):
            shank = tool.shank_diameter or 0.0
            shank = shank / 2.0 if shank > tool.diameter and tool.cutting_length < inf else 0.0
            holder = tool.holder_diameter / 2.0 if tool.holder_diameter and tool.reach < inf else 0.0
            radius = tool.diameter / 2.0
            profile = tool.height(np.sqrt(np.linspace(0.0, radius**2, PROFILE + 1)))
            carve(
                *(self.heights, self.x0, self.y0, self.cell, self.floor, np.ascontiguousarray(points, float)),
                *(np.ascontiguousarray(owner, np.int64), np.ascontiguousarray(rapid, np.bool_), radius, profile),
                *(float(tool.cutting_length), shank, float(tool.reach), holder, found),
            )
        return found

    def part(self, path: Path) -> np.ndarray:
        """The heights of an intended part over the same cells: an STL model, or heights that a cut has saved (.npz).

        InputError for a file that is neither, or heights of other cells.
        """
        if path.suffix.lower() == ".npz":
            return self._saved(path)
        if path.suffix.lower() != ".stl":
            raise InputError("is no file of a part; give an STL model (.stl), or heights from --save (.npz)", str(path))
        field = np.full_like(self.heights, self.floor)
        raise_triangles(field, self.x0, self.y0, self.cell, _triangles(path))
        return field

    def _saved(self, path: Path) -> np.ndarray:
        try:
            with np.load(path, allow_pickle=False) as saved:
                heights, place = np.asarray(saved["heights"], float), np.asarray(saved["place"], float)
        except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
            raise InputError("holds no heights that a cut has saved; save them again (--save)", str(path)) from error
        if heights.shape != self.heights.shape or not np.allclose(place[:3], [self.x0, self.y0, self.cell]):
            raise InputError("has the heights of other cells; give both cuts the same --stock and --cell", str(path))
        return heights

    def save(self, stream: Any) -> None:
        """The heights as .npz."""
        np.savez_compressed(stream, heights=self.heights, place=np.array([self.x0, self.y0, self.cell, self.floor]))


def _triangles(path: Path) -> np.ndarray:
    """The triangles of an STL model, n × 3 × 3, mm."""
    try:
        data = read_limited(path, _LARGEST, "an STL model", "save it with fewer triangles")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", str(path)) from error
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        rows = np.frombuffer(
            data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]), count, 84
        )
        return np.array(rows["corners"], float)
    words = data.split()
    at = [k for k, word in enumerate(words) if word == b"vertex"]
    try:
        values = np.array([[float(words[k + 1 + i]) for i in range(3)] for k in at])
    except (ValueError, IndexError):
        values = np.empty((0, 3))
    if not len(values) or len(values) % 3:
        raise InputError("is no STL model that can be read; save it as binary STL", str(path))
    return values.reshape(-1, 3, 3)
