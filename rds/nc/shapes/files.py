"""Vector drawings by the ending of their name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.nc.shapes.curves import Drawing, checked
from rds.nc.shapes.dxf import read_dxf
from rds.nc.shapes.svg import read_svg


def read_vector_drawing(file: str, unit: str | None = None) -> Drawing:
    """The drawing in an SVG or DXF file, by the ending of its name. `unit`: mm, cm, m or in, of a DXF file.

    InputError for a file that is neither, damaged, or has nothing to machine, and for a unit beside an SVG file.
    """
    path = Path(file)
    ending = path.suffix.lower()
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # which `checked` looks for
            if ending == ".svg":
                if unit is not None:
                    raise InputError("is an SVG, which says its own size; leave the unit out")
                return checked(read_svg(path))
            if ending == ".dxf":
                return checked(read_dxf(path, unit))
    except ArithmeticError as error:
        raise InputError("holds a number too large for a drawing; correct it, or save it again", str(path)) from error
    except InputError as error:
        raise error if error.where else InputError(str(error), str(path)) from error
    raise InputError(f"{ending or 'a name without an ending'} is no vector drawing; known: .svg, .dxf", str(path))
