"""A program cut in simulation, and the same from the positions of a run: what each tool takes, and what goes wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.segments import JOINTS
from rds.nc.language.tool_library import ShapedTool
from rds.nc.path_block import PathBlock
from rds.nc.stock.carving import BELOW, DEPTH, HOLDER, RAPID, SHANK, VOLUME
from rds.nc.stock.stock import Stock
from rds.nc.trace import sample

ARC_STEP = 0.02  # rad of an arc from point to point
LEAST_VOLUME = 1e-3  # mm³ that a rapid must take to be a fault: cells are not exact
LEAST_DEPTH = 1e-3  # mm that something must be too deep


@dataclass(frozen=True)
class CutFault:
    """Something that a cut must not do: its line of the program, what, and how much (mm, or mm³ in rapids)."""

    line: int
    kind: str  # "spindle", "rapid", "table", "shank", "holder"
    value: float

    def __str__(self) -> str:
        said = {
            "spindle": f"the spindle stands still, and the tool takes {self.value:.3g} mm³; start it before (S, M3)",
            "rapid": f"a rapid move goes through material and takes {self.value:.3g} mm³; lift the tool before it",
            "table": f"the tool cuts {self.value:.3g} mm below the stock, into what is under it; cut less deep",
            "shank": f"material is {self.value:.3g} mm above the cutting edges; cut in passes, or take a longer tool",
            "holder": f"the holder goes {self.value:.3g} mm into the material; take a longer tool",
        }
        return f"line {self.line}: {said[self.kind]}"


@dataclass
class ToolLoad:
    """What a tool did: volume (mm³), way in material and its time (mm, s), deepest cut (mm), highest rate of a move
    (mm³/s, its line), highest feed per tooth (mm; 0 where the spindle's speed is not known)."""

    tool: ShapedTool
    volume: float = 0.0
    length: float = 0.0
    seconds: float = 0.0
    depth: float = 0.0
    rate: float = 0.0
    rate_line: int = 0
    feed_per_tooth: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """As plain numbers, with units in the names."""
        return {
            "tool": self.tool.number,
            "is": self.tool.said,
            "volume_mm3": self.volume,
            "cutting_mm": self.length,
            "cutting_s": self.seconds,
            "deepest_mm": self.depth,
            "highest_rate_mm3_s": self.rate,
            "highest_rate_line": self.rate_line,
            "mean_rate_mm3_s": self.volume / self.seconds if self.seconds else 0.0,
            "highest_feed_per_tooth_mm": self.feed_per_tooth,
        }


@dataclass
class Carving:
    """A stock that is cut: the loads of its tools in the order of use, and the faults."""

    stock: Stock
    tools: Mapping[int, ShapedTool]
    loads: dict[int, ToolLoad] = field(default_factory=dict)
    faults: list[CutFault] = field(default_factory=list)
    spindle: float = 0.0  # rev/min
    _known: dict[tuple[int, str], int] = field(default_factory=dict)  # places in `faults`, by line and kind

    def tool(self, number: int, line: int = 0) -> ShapedTool:
        """A tool of the library. InputError where it has none of this number."""
        if number not in self.tools:
            known = ", ".join(map(str, self.tools)) or "none"
            where = f"line {line}: " if line else ""
            raise InputError(f"{where}cuts with tool {number}, and the library has {known}; add it with its shape")
        return self.tools[number]

    def program(self, blocks: Iterable[PathBlock]) -> None:
        """Cut along a program's motion. InputError for a tool without a shape, and for moves of rotary axes."""
        for block in blocks:
            spindle = np.full(len(block), self.spindle)
            for event in block.events:
                if event.kind == "spindle":
                    self.spindle = abs(float(event.value))
                    spindle[event.after + 1 :] = self.spindle
            if len(block.segments):
                self._block(block, spindle)

    def _block(self, block: PathBlock, spindle: np.ndarray) -> None:
        rows = block.segments
        turns = (rows["tip"] != JOINTS) | (rows["start"][:, 3:] != rows["end"][:, 3:]).any(axis=1)
        if turns.any():
            line = int(rows["line"][turns.argmax()])
            raise InputError(f"line {line}: rotary axes move; a height field is cut from above, by X, Y and Z alone")
        if block.tool not in self.tools and not (~rows["rapid"]).any():
            return  # before the first tool change
        tool = self.tool(block.tool, int(rows["line"][(~rows["rapid"]).argmax()]))
        points, owner = sample(rows, ARC_STEP)
        points = np.vstack((rows["start"][0, :3], points)) - (0.0, 0.0, tool.length)
        owner = np.concatenate((owner[:1], owner))
        found = self.stock.cut(tool, points, owner, rows["rapid"][owner], len(rows))
        seconds = np.where(rows["rapid"], 0.0, rows["length"] / np.maximum(rows["rate"], 1e-9))
        self._judge(
            tool, found, rows["line"], seconds, rows["length"], np.where(rows["rapid"], 0.0, rows["rate"]), spindle
        )

    def positions(self, tool: ShapedTool, points: np.ndarray, line: np.ndarray, rapid: np.ndarray, T: float) -> None:
        """Cut along measured positions of the machine (n × 3, mm), T s apart, with the program's line of each."""
        if not len(points):
            return
        owner = np.concatenate(([0], np.cumsum(line[1:] != line[:-1])))
        tip = points - (0.0, 0.0, tool.length)
        count = int(owner[-1]) + 1
        found = self.stock.cut(tool, tip, owner, rapid, count)
        seconds = np.bincount(owner, minlength=count) * T
        way = np.concatenate(([0.0], np.sqrt((np.diff(tip, axis=0) ** 2).sum(axis=1))))
        length = np.bincount(owner, way, minlength=count)
        first = np.concatenate(([0], np.flatnonzero(np.diff(owner)) + 1))
        self._judge(tool, found, line[first], seconds, length, length / seconds)

    def _judge(
        self,
        tool: ShapedTool,
        found: np.ndarray,
        line: np.ndarray,
        seconds: np.ndarray,
        length: np.ndarray,
        speed: np.ndarray,
        spindle: np.ndarray | None = None,
    ) -> None:
        load = self.loads.setdefault(tool.number, ToolLoad(tool))
        volume = found[:, VOLUME]
        cutting = (volume > LEAST_VOLUME) & (seconds > 0.0)
        load.volume += float(volume.sum())
        load.length += float(length[cutting].sum())
        load.seconds += float(seconds[cutting].sum())
        load.depth = max(load.depth, float(found[:, DEPTH].max(initial=0.0)))
        if cutting.any():
            rate = np.where(cutting, volume / np.maximum(seconds, 1e-12), 0.0)
            k = int(np.argmax(rate))
            if rate[k] > load.rate:
                load.rate, load.rate_line = float(rate[k]), int(line[k])
            if spindle is not None:
                for row in np.flatnonzero(cutting & (spindle == 0.0)).tolist():
                    self._fault(int(line[row]), "spindle", float(volume[row]))
            turns = cutting if spindle is None else cutting & (spindle > 0.0)
            if spindle is not None and turns.any():
                per_tooth = 60.0 * float((speed[turns] / spindle[turns]).max()) / tool.flutes
                load.feed_per_tooth = max(load.feed_per_tooth, per_tooth)
        for column, kind, least in (
            (RAPID, "rapid", LEAST_VOLUME),
            (BELOW, "table", LEAST_DEPTH),
            (SHANK, "shank", LEAST_DEPTH),
            (HOLDER, "holder", LEAST_DEPTH),
        ):
            for row in np.flatnonzero(found[:, column] > least).tolist():
                self._fault(int(line[row]), kind, float(found[row, column]))

    def _fault(self, line: int, kind: str, value: float) -> None:
        """One for each line and kind, with the largest value."""
        k = self._known.setdefault((line, kind), len(self.faults))
        if k == len(self.faults):
            self.faults.append(CutFault(line, kind, value))
        elif value > self.faults[k].value:
            self.faults[k] = CutFault(line, kind, value)


@dataclass(frozen=True)
class Difference:
    """A cut stock against the intended part: material too much and too little (mm³, mm, and where in mm)."""

    left: float
    highest: float
    highest_at: tuple[float, float]
    gouged: float
    deepest: float
    deepest_at: tuple[float, float]

    @classmethod
    def of(cls, stock: Stock, part: np.ndarray, tolerance: float = 0.0) -> Difference:
        """What differs by more than `tolerance` mm."""
        more = stock.heights - part
        area = stock.cell**2

        def place(k: Any) -> tuple[float, float]:
            i, j = np.unravel_index(int(k), more.shape)
            return stock.x0 + (float(j) + 0.5) * stock.cell, stock.y0 + (float(i) + 0.5) * stock.cell

        return cls(
            float(more[more > tolerance].sum()) * area,
            *(float(max(more.max(), 0.0)), place(more.argmax())),
            float(-more[more < -tolerance].sum()) * area,
            *(float(max(-more.min(), 0.0)), place(more.argmin())),
        )

    def to_json(self) -> dict[str, Any]:
        """As plain numbers, with units in the names."""
        return {
            "left_mm3": self.left,
            "highest_mm": self.highest,
            "highest_at_mm": list(self.highest_at),
            "gouged_mm3": self.gouged,
            "deepest_mm": self.deepest,
            "deepest_at_mm": list(self.deepest_at),
        }
