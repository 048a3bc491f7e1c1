"""Flatness of a machined face, from a dial gauge's readings on a grid, relative or set by gauge blocks.

Largest relative error: highest less lowest reading; the standard deviation is that of the sample. Flatness (ISO 1101)
is the distance of two parallel planes that hold all readings; here they are parallel to the plane of least squares,
which bounds the least such distance from above. Source: dcs-thesis, section 5.5, experiment III, figures 5.13 to 5.16:
largest relative error 0.126 mm, standard deviation 0.0520 mm.

Of a run by methods (path.csv and gauges-*.csv) the face is what the tool has left: at each place of a grid the lowest
that it went within its radius. The grid lies where the lowest level feeds of the program do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.gauges import PATH, STRAIGHT, Readings, Segment, read_gauges
from rds.results.reports.reading import columns_in, names_of, read_columns
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "tolerance": Setting("flatness that is allowed", "mm", more_than=0),
    "grid": Setting("of a run by methods: from reading to reading", "mm", 5.0, more_than=0),
    "tool": Setting("of a run by methods: the tool's diameter (dcs-thesis, table 5.3)", "mm", 6.0, more_than=0),
}
_FACE = ("x", "y", "z")
_MOST = 10_000  # readings of a grid
_THESIS = ["dcs-thesis, figure 5.13", None, None, 0.126, 0.052, None, None, None]
_LEAST = 4  # readings: three are always in one plane


@dataclass(frozen=True)
class Face:
    """Readings (n × 3, mm) on a face, and its plane of least squares z = a + b x + c y."""

    name: str
    points: np.ndarray
    plane: np.ndarray  # a, b, c

    @property
    def off_plane(self) -> np.ndarray:
        """How far each reading is from the plane, mm, at right angles to it."""
        x, y, z = self.points.T
        a, b, c = self.plane
        found: np.ndarray = (z - a - b * x - c * y) / np.sqrt(1.0 + b * b + c * c)
        return found

    @property
    def flatness(self) -> float:
        """Between two planes parallel to that of least squares, mm."""
        return float(np.ptp(self.off_plane))


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Flatness of each file's face. InputError for data or options that will not do."""
    by_methods = any(set(PATH) <= {column.heading for column in read_columns(path)} for path in files)
    if by_methods:
        faces = _cut_faces(files, settings)
    else:
        faces = [_read(path, name) for path, name in zip(files, names_of(files), strict=True)]
    columns = ["face", "readings", "mean height [mm]", "largest relative error [mm]", "std [mm]", "flatness [mm]"]
    columns += ["slope in x [mm/m]", "slope in y [mm/m]"]
    rows = [_row(face) for face in faces] + ([_THESIS] if by_methods else [])
    note = (
        "Flatness: between two planes parallel to that of least squares, without the slope of how the part was set up."
    )
    digits = dict.fromkeys(columns[2:6], 4) | dict.fromkeys(columns[6:], 2)
    return Report(
        "flatness",
        "Flatness of machined faces",
        [path.name for path in files],
        settings,
        [Table("Flatness", columns, rows, note, digits)],
        {"faces": lambda: _picture(faces)},
        [_finding(face, settings["tolerance"]) for face in faces],
    )


def _read(path: Path, name: str) -> Face:
    found = {
        column.name: column
        for column in columns_in(path, read_columns(path), ("mm",), "a grid of readings", "x_mm, y_mm, z_mm")
    }
    if missing := [name for name in _FACE if name not in found]:
        raise InputError(f"there is no column {missing[0]}_mm; a face needs x_mm, y_mm and z_mm", str(path))
    points = np.column_stack([found[name].numbers(_LEAST) for name in _FACE])
    return _face(name, points, path)


def _face(name: str, points: np.ndarray, path: Path) -> Face:
    matrix = np.column_stack([np.ones(len(points)), points[:, :2]])
    plane, _, rank, _ = np.linalg.lstsq(matrix, points[:, 2], rcond=None)
    if rank < 3:
        raise InputError("all readings are on one line in x and y; a face needs readings beside it", str(path))
    return Face(name, points, plane)


def _cut_faces(files: Sequence[Path], settings: Mapping[str, Any]) -> list[Face]:
    """The faces that runs by methods have cut."""
    path, runs = read_gauges(files)
    level = [each for each in path if not each.rapid and each.start[2] == each.end[2] and len(_extent(each))]
    if not level:
        raise InputError(
            "the path has no level feed moves, and so no face; take a program like face.ngc", str(files[0])
        )
    lowest = min(each.start[2] for each in level)
    corners = np.concatenate([_extent(each) for each in level if each.start[2] == lowest])
    low, high, grid = corners.min(0), corners.max(0), settings["grid"]
    if (count := float(np.prod(np.floor((high - low) / grid) + 1.0))) > _MOST:
        raise InputError(f"grid = {grid:g} mm makes {count:.6g} readings, and {_MOST} can be shown; take more")
    axes = (np.arange(begin, end + 1e-9, grid) for begin, end in zip(low, high, strict=True))
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return [_face(run.name, _left(run, path, places, 0.5 * settings["tool"]), files[0]) for run in runs]


def _extent(segment: Segment) -> np.ndarray:
    """Places (n × 2) between which a level move is: its ends, or the square about its circle; none if vertical."""
    if segment.plane == STRAIGHT:
        return (
            np.array([segment.start, segment.end])[:, :2] if np.any(segment.start != segment.end) else np.empty((0, 2))
        )
    return np.array([segment.centre - segment.radius, segment.centre + segment.radius])[:, :2]


def _left(run: Readings, path: Sequence[Segment], places: np.ndarray, radius: float) -> np.ndarray:
    """At each of the places (n × 2) that a feed came over, the lowest that it went there (m × 3), mm."""
    feeds = np.array([not each.rapid for each in path])
    tool = run.position[feeds[run.segment]]
    found = []
    for place in places:
        over = np.hypot(*(tool[:, :2] - place).T) <= radius
        if over.any():
            found.append([*place, tool[over, 2].min()])
    if len(found) < _LEAST:
        raise InputError(
            f"{run.name}: {len(found)} places of the grid were cut, and a face needs {_LEAST}; take a finer grid"
        )
    return np.array(found)


def _row(face: Face) -> list[Any]:
    z = face.points[:, 2]
    slopes = [1e3 * float(value) for value in face.plane[1:]]
    return [face.name, len(z), float(z.mean()), float(np.ptp(z)), float(z.std(ddof=1)), face.flatness, *slopes]


def _finding(face: Face, tolerance: float | None) -> str:
    said = f"{face.name}: largest relative error {np.ptp(face.points[:, 2]):.3f} mm, flatness {face.flatness:.3f} mm"
    if tolerance is None:
        return f"{said}."
    return f"{said}, {'within' if face.flatness <= tolerance else 'more than'} the {tolerance:g} mm allowed."


def _picture(faces: Sequence[Face]) -> Picture:
    """Height over the plane of least squares along x, a line for each row of the grid."""
    from rds.core.figure import CYCLE, Picture, dress, legend

    drawn = Picture(0.8 + 2.8 * len(faces))
    for axes, face in zip(np.atleast_1d(drawn.subplots(len(faces), 1)), faces, strict=True):
        x, y, _ = face.points.T
        for number, row in enumerate(np.unique(y)):
            here = np.flatnonzero(y == row)
            here = here[np.argsort(x[here])]
            style = {"color": CYCLE[number % len(CYCLE)], "linestyle": ("-", "--", ":", "-.")[number % 4]}
            axes.plot(x[here], 1e3 * face.off_plane[here], marker="o", label=f"y = {row:g} mm", **style)
        dress(axes, f"{face.name} off its plane [µm]", "x [mm]")
        legend(axes)
    return drawn
