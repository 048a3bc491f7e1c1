"""Drawings in a session: cells or a picture, traced to an outline, written as a part program. Without widgets."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.panels.program.made import MadePrograms
from rds.panels.program.text import check_name
from rds.panels.session.fields import Choice, Field, Flag, Number, Text
from rds.panels.session.latest import Latest
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.nc.paths.outlines import Outline

PANEL = "drawing"
CELLS, PICTURE = "cells", "picture"
PICTURES = (".png", ".jpg", ".jpeg", ".pgm", ".pbm", ".ppm", ".pnm", ".txt")
MOST_CELLS = 96  # across and up
_LEAST = 5  # rows and columns that can be chosen
LARGEST = 20 << 20  # bytes of a picture that is taken into the folder
_NO_PICTURE = ""
_START = "\n".join(
    [
        "." * 28,
        "." * 28,
        *(["....." + "#" * 8 + "." * 15] * 6),
        *(["....." + "#" * 18 + "." * 5] * 6),
        "." * 28,
        "." * 28,
    ]
)


def check_cells(text: str) -> None:
    """InputError unless `text` is rows of . and #, all equally long, and not too many."""
    rows = text.split("\n")
    if len(rows) > MOST_CELLS or len(rows[0]) > MOST_CELLS or not rows[0]:
        raise InputError(f"a drawing has 1 to {MOST_CELLS} rows and columns")
    if any(len(row) != len(rows[0]) or set(row) - {".", "#"} for row in rows):
        raise InputError("a drawing's rows are of . and #, and equally long")


def _fields(folder: Path) -> Iterable[Field]:
    yield Choice("source", "Drawing", "cells that you fill, or a picture", CELLS, {CELLS: "Cells", PICTURE: "Picture"})
    yield Text("cells", "Cells", "rows of . and #", _START, longest=MOST_CELLS * (MOST_CELLS + 1), refuse=check_cells)
    yield Number("columns", "Columns", "of cells", 28, low=_LEAST, high=MOST_CELLS, whole=True)
    yield Number("rows", "Rows", "of cells", 16, low=_LEAST, high=MOST_CELLS, whole=True)
    yield picture_field(folder)
    yield Number("pixel", "Size of a cell or pixel", "the side of one", 1.0, unit="mm", above=0.0, high=50.0)
    yield Number(
        "level", "Darkness of the shape", "0 white, 1 black: what is darker belongs to it", 0.5, above=0.0, high=1.0
    )
    yield Flag("invert", "Light on dark", "whether the shape is the light part", False)
    yield Number(
        "specks",
        "Leave out specks of up to",
        "islands and holes so small",
        0,
        unit="cells",
        low=0,
        high=100000,
        whole=True,
    )
    holes = {"refuse": "Refuse", "fill": "Fill", "cut": "Cut too"}
    yield Choice("holes", "Holes", "refused, filled (the outer outline alone), or cut before it", "refuse", holes)
    yield Choice(
        "method",
        "Trace",
        "between the cells (contour), or through the centres of those on the boundary (blob)",
        "contour",
        {"contour": "Contour", "blob": "Blob"},
    )
    yield Number(
        "tolerance",
        "Smoothing",
        "how far the cut may be from the traced outline; 0: not smoothed",
        0.5,
        unit="mm",
        low=0.0,
        high=50.0,
    )
    yield Flag("arcs", "Arcs as well as lines", "fit arcs to the smoothed outline", False)
    yield Number("feed", "Feed", "along the path", 300.0, unit="mm/min", above=0.0, high=100000.0)
    yield Number("depth", "Depth", "below z = 0", 1.0, unit="mm", low=0.0, high=1000.0)
    yield Number("passes", "Passes", "equal steps to the depth", 1, low=1, high=100, whole=True)
    yield Number("safe", "Safe height", "z of rapid moves to and from the path", 5.0, unit="mm", above=0.0, high=1000.0)
    yield Number(
        "spindle",
        "Spindle",
        "clockwise; empty: it is not switched",
        3000.0,
        unit="rev/min",
        above=0.0,
        high=1e5,
        optional=True,
    )
    yield Number(
        "x", "Left edge at X", "empty: the drawing's middle is at 0", None, unit="mm", low=-1e4, high=1e4, optional=True
    )
    yield Number(
        "y",
        "Lower edge at Y",
        "empty: the drawing's middle is at 0",
        None,
        unit="mm",
        low=-1e4,
        high=1e4,
        optional=True,
    )
    yield Text(
        "program",
        "Name of the program",
        "where the part program is written",
        "drawing.ngc",
        "drawing.ngc",
        120,
        check_name,
        needed=True,
    )


def picture_field(folder: Path) -> Choice:
    """The pictures that are in the folder now."""
    try:
        found = sorted(each.name for each in folder.iterdir() if each.suffix.lower() in PICTURES and each.is_file())
    except OSError:
        found = []
    options = {_NO_PICTURE: "choose one"} | {name: name for name in found}
    return Choice("picture", "Picture", "PNG, JPEG, PGM, or text of # and . in your folder", _NO_PICTURE, options)


@dataclass(frozen=True)
class Traced:
    """An outline, the part program along it, and its numbers (lengths in mm, times in s)."""

    outline: Outline
    text: str
    summary: dict[str, Any]
    smoothed: bool

    @property
    def sentence(self) -> str:
        """What came of it, in one line."""
        found, rings = self.summary, len(self.outline.rings)
        off = f"; at most {self.outline.deviation:.3f} mm off the traced outline" if self.smoothed else ""
        size = ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, (low, high) in found["extent_mm"].items())
        return (
            f"{rings} outline{'s' * (rings > 1)}, lines: {found['lines']}, arcs: {found['arcs']}, "
            f"{found['length_mm']:.1f} mm, {found['cutting_time_s']:.0f} s at the feed{off}; {size} mm"
        )

    def rings_in_cells(self) -> list[list[list[float]]]:
        """The outlines as cut, as (column, row) from the upper left corner of the drawing."""
        (x, y), size, rows = self.outline.at, self.outline.pixel, self.outline.darkness.shape[0]
        return [
            np.column_stack(((ring[:, 0] - x) / size, rows - (ring[:, 1] - y) / size)).round(3).tolist()
            for ring in self.outline.rings
        ]


class Drawing:
    """What is drawn and how it is cut. `latest` is the last outline, `refusal` why there is none; `tick()` goes on."""

    def __init__(self, session: Session):
        self.session = session
        self.choices = session.choices(PANEL, _fields(session.folder))
        self.latest: Traced | None = None
        self.refusal = ""
        self._fitting = False  # rows and columns follow the cells, and not the other way round
        self._made = MadePrograms(session, "drawing")
        self._traces = Latest(self._begin, self._file)
        self.choices.watch(self._changed)

    def _changed(self, name: str) -> None:
        if name in ("columns", "rows") and not self._fitting:
            self._resize()
        elif name == "cells":
            rows = str(self.choices["cells"]).split("\n")
            self._fitting = True
            try:
                self.choices.set("rows", max(len(rows), _LEAST))
                self.choices.set("columns", max(len(rows[0]), _LEAST))
            finally:
                self._fitting = False
        if name != "program":
            self._traces.again()

    def _resize(self) -> None:
        """Cells keep their place from the upper left corner."""
        rows = str(self.choices["cells"]).split("\n")
        wide, high = int(self.choices["columns"]), int(self.choices["rows"])
        if (len(rows), len(rows[0])) != (high, wide):
            fitted = [row[:wide].ljust(wide, ".") for row in rows[:high]]
            self.choices.set("cells", "\n".join(fitted + ["." * wide] * (high - len(fitted))))

    @property
    def tracing(self) -> bool:
        """Whether `latest` is not yet of what is chosen."""
        return self._traces.going_on

    def tick(self) -> bool:
        """Ten times a second: begin to trace where something has changed; true when there is something new to show."""
        task = self._traces.tick()
        if task is None:
            return False
        self.latest, self.refusal = task.result, ""
        if task.error is not None:
            self.refusal = str(task.error) if isinstance(task.error, InputError) else f"tracing failed: {task.error}"
        return True

    def take_picture(self, name: str, data: bytes) -> None:
        """A picture from elsewhere into the folder, and chosen; InputError where that will not do."""
        plain = Path(name.replace("\\", "/")).name
        if Path(plain).suffix.lower() not in PICTURES or plain.startswith(".") or not plain.isprintable():
            known = f"{', '.join(PICTURES)} can"
            if Path(plain).suffix.lower() in (".svg", ".dxf"):
                known += f"; a drawing of lines is cut as it is: `rds nc make job {shlex.quote(plain)}` in a terminal"
            raise InputError(f"{plain!r:.60} is no picture that can be traced; {known}")
        if len(data) > LARGEST:
            raise InputError(f"{plain} has more than {LARGEST >> 20} MB; scale it down")
        path = self.session.folder / plain
        if path.exists() and path.read_bytes() != data:
            raise InputError(f"there is another {plain} in your folder already; rename one of them")
        write_whole(path, data)
        self.refresh()
        self.choices.set("picture", plain)
        self.choices.set("source", PICTURE)

    def refresh(self) -> None:
        """Look for pictures that have come or gone."""
        self.choices.replace([picture_field(self.session.folder)])

    def clear(self) -> None:
        """All cells empty."""
        self.choices.set("cells", "\n".join(["." * int(self.choices["columns"])] * int(self.choices["rows"])))

    def _file(self) -> Path | None:
        name = str(self.choices["picture"]) if self.choices["source"] == PICTURE else ""
        return self.session.folder / name if name else None

    def _begin(self) -> Task[Traced]:
        values, folder = self.choices.values(), self.session.folder
        return self.session.work("trace a drawing", lambda task: traced(values, folder))

    def write(self) -> str:
        """Write the part program, and open it in the program panel; its name.

        InputError where there is no outline, or a file of that name that was not written from here.
        """
        if self.refusal or self.latest is None or self.tracing:
            raise InputError(self.refusal or "the outline is not traced yet; wait a moment")
        name = str(self.choices["program"])
        self._made.write(name, self.latest.text)
        return name


def traced(values: dict[str, Any], folder: Path) -> Traced:
    """The outline of what is chosen and its part program; InputError with the place of what cannot be followed."""
    from rds.nc.paths.drawing import parse_text_drawing, read_drawing
    from rds.nc.paths.measure import summary
    from rds.nc.paths.outlines import outline
    from rds.nc.paths.program import part_program

    if values["source"] == PICTURE:
        name = str(values["picture"])
        if not name:
            raise InputError("choose a picture of your folder, or take one into it")
        darkness = read_drawing(folder / name)
    else:
        name = "your drawing"
        darkness = parse_text_drawing(values["cells"], name)
    rows, columns = darkness.shape
    size = float(values["pixel"])
    at = [-0.5 * n * size if values[key] is None else values[key] for key, n in (("x", columns), ("y", rows))]
    made = outline(
        darkness,
        size,
        values["feed"] / 60.0,
        method=values["method"],
        holes=values["holes"],
        level=values["level"],
        invert=values["invert"],
        specks=values["specks"],
        tolerance=values["tolerance"],
        arcs=values["arcs"],
        at=at,
        depth=values["depth"],
        passes=values["passes"],
        name=name,
    )
    smoothed = values["tolerance"] > 0.0
    title = f"outline of {name}, {columns} x {rows} cells of {size:g} mm"
    title += f"\ndeviation {made.deviation:.4f} mm" if smoothed else ""
    text = part_program(made.segments, title, safe_height=values["safe"], spindle=values["spindle"])
    return Traced(made, text, summary(made.segments), smoothed)
