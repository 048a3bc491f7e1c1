"""Paths made without G-code: parametric objects, files of points, drawings; each written as a part program too."""

from __future__ import annotations

from rds.core.face import face

__getattr__, __dir__ = face(
    __name__,
    {
        "arc": "arcs",
        "line": "lines",
        "outline": "outlines",
        "part_program": "program",
        "path_of_points": "points",
        "picture": "pictures",
        "polyline": "lines",
        "quadrilateral": "lines",
        "quadrilateral_by_moves": "lines",
        "read_points": "points",
        "spiral_cone": "cone",
    },
)
