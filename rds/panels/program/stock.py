"""The stock of a program, and what the program, or a run of it, makes of it: with the shapes of all its tools."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.compiling import COMPILED
from rds.core.errors import InputError
from rds.interpolators.motion.segments import JOINTS
from rds.nc.active import Modes, modes_at
from rds.nc.extent import extents
from rds.nc.language.tool_library import ShapedTool, read_library
from rds.nc.language.tools import read_tools
from rds.nc.path_block import PathBlock
from rds.nc.stock.cut import Carving, CutFault, Difference, ToolLoad
from rds.nc.stock.stock import Stock

if TYPE_CHECKING:
    from rds.nc.run.prepare import Prepared
    from rds.results import Result

TOOL = 6.0  # mm, the diameter of a tool that no table names
SHOWN = 160  # cells along the longer side that the browser cuts
FINE = 3 if COMPILED else 1  # cells of the judgement along one of those; odd, so that the middles meet
WALLS = 0.02  # mm that a part may differ, as `rds nc cut` has it
_BELOW = 3.0  # mm of stock below the deepest cut
_LEAST = 0.01  # mm: what does not go so deep below the top cuts nothing
_RINGS = 8  # of a tool's end as it is drawn
_PROFILE = 64  # parts of the squared radius, as the browser cuts with


@dataclass(frozen=True)
class Cut:
    """What a program, or a run of it, makes of its stock. `top`: z of the uncut stock, mm; `part`: the heights that
    were meant, over the same cells; `by_line`: the tool of each line; `assumed`: tools that no table gives a shape."""

    stock: Stock
    top: float
    part: np.ndarray
    tools: Mapping[int, ShapedTool]
    by_line: np.ndarray
    loads: tuple[ToolLoad, ...]
    faults: tuple[CutFault, ...]
    assumed: tuple[int, ...] = ()
    part_name: str = ""  # the file of the intended part; none: as programmed

    @property
    def difference(self) -> Difference:
        """What differs from the part by more than WALLS."""
        return Difference.of(self.stock, self.part, WALLS)

    def shown(self) -> tuple[dict[str, Any], np.ndarray]:
        """The stock before it is cut, and the intended heights, on the cells that the browser cuts."""
        middle = FINE // 2
        heights = self.part[middle::FINE, middle::FINE]
        stock, cell = self.stock, self.stock.cell * FINE
        rows, columns = heights.shape
        low = [stock.x0, stock.y0, stock.floor]
        high = [stock.x0 + columns * cell, stock.y0 + rows * cell, self.top]
        return {"low": low, "high": high, "cell": cell, "columns": columns, "rows": rows}, heights

    def tool_of(self, line: np.ndarray) -> np.ndarray:
        """The number of the tool that each of these lines moves."""
        return np.asarray(self.by_line[np.clip(line.astype(int), 0, len(self.by_line) - 1)])


def shapes(table: Path | None) -> dict[int, ShapedTool]:
    """The tools of a library, or of LinuxCNC's table, where a remark says *ball* or *drill*. RdsError as its reader."""
    if table is None:
        return {}
    if table.suffix.lower() == ".toml":
        return {tool.number: tool for tool in read_library(table)}
    found = {}
    for tool in read_tools(table):
        shape = next((name for name in ("ball", "drill") if name in tool.comment.lower()), "flat")
        if tool.diameter > 0.0:
            found[tool.number] = ShapedTool(
                tool.number, tool.diameter, shape, tool.comment[:60], length=float(tool.offset[2])
            )
    return found


def drawn(tools: Mapping[int, ShapedTool]) -> dict[str, Any]:
    """Tools as the browser cuts with them, and draws them: [radius, z] from the tip up, mm."""
    return {str(number): _drawn(tool) for number, tool in tools.items()}


def _drawn(tool: ShapedTool) -> dict[str, Any]:
    radius = tool.diameter / 2.0
    profile = tool.height(np.sqrt(np.linspace(0.0, radius**2, _PROFILE + 1)))
    at = radius * np.sin(np.linspace(0.0, np.pi / 2.0, _RINGS + 1))
    rings = [[float(r), float(z)] for r, z in zip(at, tool.height(at), strict=True)]
    if np.isfinite(tool.cutting_length):
        rings += [[radius, float(tool.cutting_length)]]
        rings += [[(tool.shank_diameter or tool.diameter) / 2.0, float(tool.cutting_length)]]
    if np.isfinite(tool.reach):
        rings += [[rings[-1][0], float(tool.reach)], [(tool.holder_diameter or tool.diameter) / 2.0, float(tool.reach)]]
    rings = [[r, max(z, rings[k - 1][1] if k else z)] for k, (r, z) in enumerate(rings)]
    return {"radius": radius, "profile": profile.tolist(), "length": tool.length, "rings": rings, "is": tool.said}


def assumed(number: int) -> ShapedTool:
    """The tool that stands in for one without a shape."""
    return ShapedTool(number, TOOL, name=f"end mill {TOOL:g} mm, assumed")


def block_of(text: str) -> tuple[list[float], list[float]]:
    """Low and high corner from `X Y Z X Y Z`, mm. InputError for anything else."""
    try:
        corners = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        corners = []
    if len(corners) != 6 or not np.isfinite(corners).all():
        raise InputError(f"the stock {text!r:.60} is not six numbers: X Y Z of its lower and of its upper corner, mm")
    if not all(b > a for a, b in zip(corners[:3], corners[3:], strict=True)):
        raise InputError(f"the stock {text!r:.60} has no volume; write its lower corner first, then the upper one")
    return corners[:3], corners[3:]


def cut(
    blocks: Sequence[PathBlock],
    modes: Mapping[int, Modes],
    tools: Mapping[int, ShapedTool],
    block: str = "",
    part: Path | None = None,
    between: Callable[[], None] = lambda: None,
) -> Cut | None:
    """What a program makes of its stock (`block`: X Y Z X Y Z in machine coordinates of the tip, mm; by default as
    large as what it cuts, from the work's zero down). None where it cuts nothing, and for moves of rotary axes or of
    the tip.

    InputError for a stock or a part that is none. `between` is called now and then, and may raise.
    """
    moved = [each for each in blocks if len(each)]
    for each in moved:
        rows = each.segments
        if (rows["tip"] != JOINTS).any() or (rows["start"][:, 3:] != rows["end"][:, 3:]).any():
            return None
    missing = sorted({each.tool for each in moved if (~each.segments["rapid"]).any()} - set(tools))
    tools = {**tools, **{number: assumed(number) for number in missing}}
    corners = block_of(block) if block.strip() else _about(moved, modes, tools)
    if corners is None:
        return None
    low, high = corners
    cell = max(high[0] - low[0], high[1] - low[1]) / SHOWN / FINE
    carving = Carving(Stock.block(low, high, cell), tools)
    for each in blocks:
        between()
        carving.program([each])
    stock = carving.stock
    wanted = stock.heights.copy() if part is None else stock.part(part)
    return Cut(
        *(stock, float(high[2]), wanted, tools, _by_line(moved), tuple(carving.loads.values())),
        *(_sorted(carving.faults), tuple(missing), "" if part is None else part.name),
    )


def _about(
    blocks: Sequence[PathBlock], modes: Mapping[int, Modes], tools: Mapping[int, ShapedTool]
) -> tuple[list[float], list[float]] | None:
    """Corners about what is cut, with room for the tools, up to the work's zero."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for block in blocks:
        feeds = block.segments[~block.segments["rapid"]]
        if not len(feeds):
            continue
        tool = tools[block.tool]
        room, length = np.array([0.75, 0.75, 0.0]) * tool.diameter, np.array([0.0, 0.0, tool.length])
        a, b = extents(feeds)
        low = np.minimum(low, a[:, :3].min(axis=0) - length - room)
        high = np.maximum(high, b[:, :3].max(axis=0) - length + room)
    last = modes_at(modes, max(modes, default=0))
    top = 0.0 if last is None else last.origin[2] + last.g92[2]
    if not low[2] < top - _LEAST:
        return None
    return [*low[:2].tolist(), float(low[2]) - _BELOW], [*high[:2].tolist(), top]


def _by_line(blocks: Sequence[PathBlock]) -> np.ndarray:
    lines = max((int(block.segments["line"].max()) for block in blocks), default=0)
    first = next((block.tool for block in blocks if (~block.segments["rapid"]).any()), 0)
    found = np.full(lines + 1, first)
    for block in blocks:
        found[block.segments["line"]] = block.tool
    return found


def cut_of_run(planned: Cut, result: Result, prepared: Prepared) -> Cut | None:
    """What the measured positions of a run make of the same stock; None where the run has none of planned motion."""
    axes = [name for name in "XYZ" if f"{name}_measured" in result]
    if "program_sample" not in result or not axes or not len(prepared.segment) or not len(result):
        return None
    points = np.column_stack([result[f"{name}_measured"] if name in axes else np.zeros(len(result)) for name in "XYZ"])
    sample = np.round(result["program_sample"]).astype(int).clip(0, len(prepared.segment) - 1)
    rapid = prepared.path["rapid"][prepared.segment[sample]]
    line = result["program_line"].astype(int)
    tool = planned.tool_of(line)
    stock = replace(planned.stock, heights=np.full_like(planned.stock.heights, planned.top))
    carving = Carving(stock, planned.tools)
    edges = [0, *(np.flatnonzero(np.diff(tool)) + 1).tolist(), len(tool)]
    for a, b in pairwise(edges):
        if (shape := planned.tools.get(int(tool[a]))) is not None:
            carving.positions(shape, points[a:b], line[a:b], rapid[a:b], prepared.T)
    return replace(planned, stock=stock, loads=tuple(carving.loads.values()), faults=_sorted(carving.faults))


def _sorted(faults: list[CutFault]) -> tuple[CutFault, ...]:
    return tuple(sorted(faults, key=lambda fault: fault.line))
