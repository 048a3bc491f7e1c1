"""Part programs: the language (RS274NGC as LinuxCNC documents it), and what its programs tell a machine to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rds.core.face import face

if TYPE_CHECKING:
    from rds.nc.language.dialect import Dialect as Dialect
    from rds.nc.language.errors import ProgramError as ProgramError
    from rds.nc.language.interpreter import interpret as interpret

__getattr__, __dir__ = face(
    __name__,
    {
        "Dialect": "language.dialect",
        "ProgramError": "language.errors",
        "Setup": "setup",
        "ToolCentre": "tool_centre",
        "arc": "paths.arcs",
        "canon_text": "language.canon_text:text",
        "check_program": "check",
        "interpret": "language.interpreter",
        "line": "paths.lines",
        "machine_motion": "check:motion",
        "open_compiled": "compiled_file",
        "outline": "paths.outlines",
        "part_program": "paths.program",
        "path_of_points": "paths.points",
        "picture": "paths.pictures",
        "polyline": "paths.lines",
        "program_time": "cycle_time:cycle_time",
        "proof": "compensation.proof",
        "quadrilateral": "paths.lines",
        "quadrilateral_by_moves": "paths.lines",
        "read_drawing": "paths.drawing",
        "read_points": "paths.points",
        "spiral_cone": "paths.cone",
        "steps": "stepping",
    },
)
