"""Paths made without G-code: parametric objects, files of points, drawings; each written as a part program too."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rds.nc.paths.arcs import arc as arc
    from rds.nc.paths.cone import spiral_cone as spiral_cone
    from rds.nc.paths.lines import line as line
    from rds.nc.paths.lines import polyline as polyline
    from rds.nc.paths.lines import quadrilateral as quadrilateral
    from rds.nc.paths.lines import quadrilateral_by_moves as quadrilateral_by_moves
    from rds.nc.paths.outlines import outline as outline
    from rds.nc.paths.pictures import picture as picture
    from rds.nc.paths.points import path_of_points as path_of_points
    from rds.nc.paths.points import read_points as read_points
    from rds.nc.paths.program import part_program as part_program

_HOMES = {
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
}

__all__ = [
    "arc",
    "line",
    "outline",
    "part_program",
    "path_of_points",
    "picture",
    "polyline",
    "quadrilateral",
    "quadrilateral_by_moves",
    "read_points",
    "spiral_cone",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
