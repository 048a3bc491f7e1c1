"""The tool library: tools with their shapes, as a TOML file. LinuxCNC's table has lengths and diameters only."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, radians, tan
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Choice, Quantity, Table, Tables, Text
from rds.core.toml_file import parse_toml
from rds.core.toml_table import TomlTable

_LOOKED_AT = 1 << 16  # bytes of a file that may be a library
SHAPES = ("flat", "ball", "bull", "vee", "drill")
TOOL = Table(
    "a tool",
    {
        "number": Quantity("number that T calls it by", "", 1, 99999, whole=True),
        "name": Text("what it is, as in 'end mill 3 mm'", default=""),
        "shape": Choice(
            "of its end: flat, ball, bull (flat with rounded corners), vee (a cone), drill", SHAPES, "flat"
        ),
        "diameter": Quantity("of its cutting part", "mm", above=0.0, high=1000.0),
        "corner_radius": Quantity("of a bull-nosed mill", "mm", low=0.0, default=0.0),
        "angle": Quantity("of the whole tip of a vee or a drill", "degrees", above=0.0, high=179.0, default=118.0),
        "tip_diameter": Quantity("flat of the tip of a vee", "mm", low=0.0, default=0.0),
        "flutes": Quantity("number of cutting edges", "", 1, 100, default=2, whole=True),
        "cutting_length": Quantity("of its edges from the tip", "mm", above=0.0, default=inf, infinite=True),
        "shank_diameter": Quantity("above its edges; by default the cutting diameter", "mm", above=0.0),
        "reach": Quantity("from the tip to the holder", "mm", above=0.0, default=inf, infinite=True),
        "holder_diameter": Quantity("of what holds it", "mm", above=0.0),
        "length": Quantity("offset that G43 takes", "mm", default=0.0),
        "feed": Quantity("feed rate when it cuts", "mm/min", above=0.0),
        "plunge": Quantity("feed rate downwards; by default a third of the feed", "mm/min", above=0.0),
        "spindle": Quantity("spindle speed, clockwise", "rev/min", above=0.0),
        "most_feed": Quantity("highest feed rate that it stands", "mm/min", above=0.0),
        "most_spindle": Quantity("highest speed that it stands", "rev/min", above=0.0),
    },
    needed=("number", "diameter"),
)
LIBRARY = Table("a tool library", {"tool": Tables("tools", TOOL, least=1)})


@dataclass(frozen=True)
class ShapedTool:
    """A tool with its shape; mm, degrees, mm/min, rev/min; None where the library does not say."""

    number: int
    diameter: float
    shape: str = "flat"
    name: str = ""
    corner_radius: float = 0.0
    angle: float = 118.0
    tip_diameter: float = 0.0
    flutes: int = 2
    cutting_length: float = inf
    shank_diameter: float | None = None
    reach: float = inf
    holder_diameter: float | None = None
    length: float = 0.0
    feed: float | None = None
    plunge: float | None = None
    spindle: float | None = None
    most_feed: float | None = None
    most_spindle: float | None = None

    @property
    def said(self) -> str:
        """Its name, or what it is."""
        kinds = {"flat": "end mill", "ball": "ball mill", "bull": "bull-nosed mill", "vee": "vee bit", "drill": "drill"}
        return self.name or f"{kinds[self.shape]} {self.diameter:g} mm"

    def height(self, r: np.ndarray) -> np.ndarray:
        """How far above its tip the surface of the tool is, at the distance `r` (mm) from its axis; inf beyond it."""
        r = np.asarray(r, dtype=float)
        radius = self.diameter / 2.0
        if self.shape == "flat":
            z = np.zeros_like(r)
        elif self.shape in ("ball", "bull"):
            corner = radius if self.shape == "ball" else self.corner_radius
            beyond = np.clip(r - (radius - corner), 0.0, corner)
            z = corner - np.sqrt(corner**2 - beyond**2)
        else:
            flat = self.tip_diameter / 2.0 if self.shape == "vee" else 0.0
            z = np.clip(r - flat, 0.0, None) / tan(radians(self.angle / 2.0))
        return np.where(r <= radius * (1 + 1e-12), z, inf)


def is_library(path: Path) -> bool:
    """Whether a TOML file looks like a tool library, and is not an experiment or a machine."""
    try:
        with path.open("rb") as stream:
            return re.search(rb"^\s*\[\[\s*tool\s*\]\]", stream.read(_LOOKED_AT), re.MULTILINE) is not None
    except OSError:
        return False


def read_library(path: Path) -> list[ShapedTool]:
    """The tools of a library, `[[tool]]` each. InputError with the line for a key or a value that will not do."""
    return _tools(TomlTable.open(path, LIBRARY), str(path))


def library_of(text: str, name: str) -> list[ShapedTool]:
    """The tools of a library's text; `name` is where faults are said to be. InputError as `read_library`."""
    return _tools(TomlTable(parse_toml(text, name), LIBRARY, text, name), name)


def _tools(top: TomlTable, name: str) -> list[ShapedTool]:
    tools: list[ShapedTool] = []
    for table in top.tables("tool"):
        given = {key: value for key in TOOL.keys if (value := table.read(key)) is not None}
        table.done()
        tool = ShapedTool(**given)
        if any(tool.number == other.number for other in tools):
            raise table.fault("number", "comes twice; give each tool a number of its own")
        if tool.shape == "bull" and not 0.0 < tool.corner_radius <= tool.diameter / 2.0:
            raise table.fault("corner_radius", "must be more than 0 and at most half the diameter of a bull-nosed mill")
        if tool.shape == "vee" and tool.tip_diameter >= tool.diameter:
            raise table.fault("tip_diameter", "must be less than the diameter")
        tools.append(tool)
    top.done()
    if not tools:
        raise InputError("has no tools; write [[tool]] with number and diameter", name)
    return tools
