"""A machining job as a TOML file (a drawing or a text, a tool library, operations), and the program that it makes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import AnyValue, Choice, Items, Quantity, Table, Tables, Text
from rds.core.toml_table import TomlTable
from rds.core.types import Segment
from rds.nc.language.tool_library import read_library
from rds.nc.machining.operations import OPERATIONS, Cut, operate
from rds.nc.paths.numbers import BLEND, HEIGHT
from rds.nc.paths.program import MoveWriter, comment, written
from rds.nc.shapes.curves import Curve, Drawing
from rds.nc.shapes.files import read_vector_drawing
from rds.nc.shapes.lettering import text_drawing

TEXT = Table(
    "a text instead of a drawing",
    {
        "text": Text("what is written"),
        "height": Quantity("of capitals", "mm", above=0.0, default=10.0),
        "font": Text("a .ttf or .otf file; by default DejaVu Sans"),
    },
    needed=("text",),
)
JOB = Table(
    "a machining job",
    {
        "title": Text("first comment of the program", default=""),
        "drawing": Text("an SVG or DXF file, beside the job"),
        "text": TEXT,
        "unit": Text("of a DXF that does not say its own: mm, cm, m or in"),
        "origin": Choice("what of the drawing is at X 0 Y 0", ("drawing", "lower-left", "centre"), "drawing"),
        "at": Items("shift of the drawing", Quantity("shift", "mm"), "[x, y], two lengths in mm", 2),
        "tools": Text("the tool library, beside the job"),
        "safe": Quantity("z of rapid moves, above the material", "mm", default=5.0),
        "clearance": Quantity("above the material, where feeding down begins", "mm", above=0.0, default=0.5),
        "tolerance": Quantity("of the ways from the drawing", "mm", above=0.0, default=0.01),
        "blend": BLEND,
        "operation": Tables("operations, in their order", Table("an operation", others=AnyValue("see its kind")), 1),
    },
    needed=("tools",),
)


@dataclass
class Job:
    """What a job file makes: the cuts in their order; mm."""

    title: str
    cuts: list[Cut]
    drawing: Drawing | None
    safe: float
    clearance: float
    blend: float | None
    notes: list[str] = field(default_factory=list)

    def program(self, decimals: int = 4) -> str:
        """The part program, with a comment before each operation. It needs the library as its tool table."""
        return "\n".join([*self._lines(decimals), ""])

    def segments(self) -> list[Segment]:
        """All ways at feed."""
        return [segment for cut in self.cuts for piece in cut.pieces for segment in piece]

    def _lines(self, decimals: int) -> Iterator[str]:
        for text in self.title.splitlines():
            yield comment(text)
        yield "G17 G21 G40 G49 G54 G80 G90 G91.1 G94"
        if self.blend is not None:
            yield f"G64 P{written(self.blend, 6)}"
        tool = spindle = None
        safe = written(self.safe, decimals)
        writer = MoveWriter(decimals)
        for number, cut in enumerate(self.cuts, start=1):
            yield comment(f"operation {number}: {cut.title}")
            if cut.tool.number != tool:
                if tool is not None:
                    yield "M5"
                yield f"T{cut.tool.number} M6"
                yield "G43"
                tool, spindle, writer = cut.tool.number, None, MoveWriter(decimals)
            if cut.spindle is not None and cut.spindle != spindle:
                yield f"S{written(cut.spindle, 3)} M3"
                spindle = cut.spindle
            yield f"G0 Z{safe}"
            if cut.holes is not None:
                yield from self._holes(cut, decimals)
                writer = MoveWriter(decimals)
            for piece in cut.pieces:
                yield from writer.descend(piece, cut.top + self.clearance, cut.plunge / 60.0)
                yield f"G0 Z{safe}"
        if spindle is not None:
            yield "M5"
        yield "M2"

    def _holes(self, cut: Cut, decimals: int) -> Iterator[str]:
        holes = cut.holes
        assert holes is not None
        word = "G81"
        if holes.peck:
            word = f"G83 Q{written(holes.peck, 6)}"
        elif holes.dwell:
            word = f"G82 P{written(holes.dwell, 6)}"
        above, bottom = written(cut.top + self.clearance, decimals), written(holes.bottom, decimals)
        depths = f" Z{bottom} R{above} F{written(cut.plunge, 6)}"
        for k, place in enumerate(holes.places.tolist()):
            x, y = (written(value, decimals) for value in place)
            yield f"X{x} Y{y}" if k else f"G99 {word} X{x} Y{y}{depths}"
        yield "G80"
        yield f"G0 Z{written(self.safe, decimals)}"


def read_job(path: Path) -> Job:
    """The job in a TOML file, with its cuts made. InputError, with the line, for what cannot be."""
    top = TomlTable.open(path, JOB)
    folder = path.parent
    drawing = _drawing(top, folder)
    tools = {tool.number: tool for tool in read_library(folder / top.read("tools"))}
    tolerance = top.read("tolerance")
    cuts = []
    for table in top.tables("operation"):
        kind = table.any("do")
        if kind not in OPERATIONS:
            raise table.fault("do", f"is no operation; known: {', '.join(OPERATIONS)}")
        table.declared = OPERATIONS[kind]
        given = {key: table.read(key) for key in OPERATIONS[kind].keys}
        table.done()
        if given["tool"] not in tools:
            raise table.fault("tool", f"is not in the library, which has {', '.join(map(str, tools))}")
        try:
            cuts.append(operate(kind, given, drawing, tools[given["tool"]], tolerance))
        except InputError as error:
            raise error if error.where else InputError(str(error), table.place()) from None
    job = Job(
        top.read("title") or f"rds nc make job {path.name}",
        *(cuts, drawing, top.read("safe"), top.read("clearance"), top.read("blend")),
    )
    top.done()
    if not cuts:
        raise InputError("has no operations; write [[operation]] with do, tool and depth", str(path))
    highest = max(cut.top for cut in cuts) + job.clearance
    HEIGHT.check(job.safe, "safe", str(path))
    if job.safe < highest:
        raise InputError(
            f"safe = {job.safe:g} mm is below the clearance above the material, z = {highest:g} mm", str(path)
        )
    if drawing is not None:
        job.notes += drawing.notes
    return job


def _drawing(top: TomlTable, folder: Path) -> Drawing | None:
    text, file = top.inner("text"), top.read("drawing")
    if text is not None and file is not None:
        raise top.fault("drawing", "and [text] are two drawings; leave one out")
    for key in ("unit",) if text is not None else () if file is not None else ("unit", "origin", "at"):
        if key in top:
            raise top.fault(key, f"is of a drawing{' in a file' * (text is not None)}, and there is none; leave it out")
    unit = top.read("unit")
    found: Drawing | None = None
    if text is not None:
        font = text.read("font")
        found = text_drawing(text.read("text"), text.read("height"), folder / font if font else None)
        text.done()
    elif file is not None:
        found = read_vector_drawing(str(folder / file), unit)
    origin, shift = top.read("origin"), np.array(top.read("at") or (0.0, 0.0))
    if found is None:
        return None
    low = np.min([curve.points.min(axis=0) for curve in found.curves], axis=0)
    high = np.max([curve.points.max(axis=0) for curve in found.curves], axis=0)
    shift = shift - {"drawing": np.zeros(2), "lower-left": low, "centre": (low + high) / 2.0}[origin]
    return replace(found, curves=[_moved(curve, shift) for curve in found.curves])


def _moved(curve: Curve, shift: np.ndarray) -> Curve:
    circle: Any = curve.circle and (curve.circle[0] + shift[0], curve.circle[1] + shift[1], curve.circle[2])
    return replace(curve, points=curve.points + shift, circle=circle)
