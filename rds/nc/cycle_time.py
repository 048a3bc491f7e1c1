"""How long a program takes: the samples of the planner that runs it, counted by what is done and by tool."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from rds.interpolators.motion.certificate import Certificate
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.profiles import motion_of
from rds.interpolators.motion.samples import SampleBlock
from rds.machines import Machine
from rds.nc.path_block import PathBlock


@dataclass
class Share:
    """Seconds at feed, in rapids and in dwells (G4)."""

    cutting: float = 0.0
    rapid: float = 0.0
    dwell: float = 0.0

    @property
    def total(self) -> float:
        return self.cutting + self.rapid + self.dwell

    @property
    def seconds(self) -> tuple[float, float, float, float]:
        """Cutting, rapid, dwell, total."""
        return self.cutting, self.rapid, self.dwell, self.total

    def to_json(self) -> dict[str, float]:
        return {"cutting_s": self.cutting, "rapid_s": self.rapid, "dwell_s": self.dwell, "total_s": self.total}


@dataclass(frozen=True)
class CycleTime:
    """The predicted time of a program: `samples` of `T` s, which are those that are run; stops (M0, M1) end at once.

    by_tool: the shares of each tool, in the order of use (0: before the first one). certificate: of all samples.
    """

    samples: int
    T: float
    by_tool: dict[int, Share]
    certificate: Certificate

    @property
    def total(self) -> float:
        """s."""
        return self.samples * self.T

    @property
    def whole(self) -> Share:
        """The shares of all tools together."""
        shares = self.by_tool.values()
        return Share(*(sum(getattr(share, name) for share in shares) for name in ("cutting", "rapid", "dwell")))

    def to_json(self) -> dict[str, Any]:
        """As plain dicts and numbers, times in s."""
        tools = {str(tool): share.to_json() for tool, share in self.by_tool.items()}
        return {
            "samples": self.samples,
            "sample_period_s": self.T,
            **self.whole.to_json(),
            "by_tool": tools,
            "certificate": self.certificate.to_dict(),
        }


def cycle_time(
    blocks: Iterable[PathBlock], machine: Machine, T: float | None = None, profile: str = "planned"
) -> CycleTime:
    """Plan the motion, and count. T: sample period, s, by default the machine's. In bounded memory.

    Raises ProgramError and InputError as the blocks and the planner do.
    """
    T = machine.sample_period if T is None else T
    tools = _Tools()
    counts: dict[int, list[int]] = {}
    dwells: list[tuple[int, int, int]] = []  # samples, from and up to, and the tool
    samples = 0
    limits = Limits.of(machine)
    motion, certificate = motion_of(profile, tools.watch(blocks), limits, T, start=np.zeros(6))
    for block in motion:
        number = np.arange(block.first, block.first + len(block))
        for at, event in block.events:
            if event.kind == "dwell":
                dwells.append((at + 1, at + 1 + ceil(event.value / T - 1e-9), tools.of_dwells.popleft()))
        kind, tool = np.where(_rapid(block), 1, 0), tools.at(block.segment)
        for begin, end, waiting in dwells:
            rows = (number >= begin) & (number < end)
            kind[rows], tool[rows] = 2, waiting
        dwells = [dwell for dwell in dwells if dwell[1] > block.first + len(block)]
        for used in np.unique(tool).tolist():
            mine = counts.setdefault(used, [0, 0, 0])
            for what, count in enumerate(np.bincount(kind[tool == used], minlength=3).tolist()):
                mine[what] += count
        samples += len(block)
    return CycleTime(
        samples, T, {tool: Share(*(count * T for count in mine)) for tool, mine in counts.items()}, certificate
    )


def _rapid(block: SampleBlock) -> np.ndarray:
    """Which samples are of rapids. Without any segment (a program that only waits) none."""
    if not len(block.path):
        return np.zeros(len(block), bool)
    return block.path["rapid"][np.clip(block.segment - block.path_first, 0, len(block.path) - 1)]


class _Tools:
    """Which tool is in the spindle for which segments; grows with the number of tool changes only."""

    def __init__(self) -> None:
        self._first = [0]
        self._tool = [0]
        self._segments = 0
        self.of_dwells: deque[int] = deque()  # the tools that are in the spindle during the dwells to come

    def watch(self, blocks: Iterable[PathBlock]) -> Iterator[PathBlock]:
        for block in blocks:
            if block.tool != self._tool[-1]:
                self._first.append(self._segments)
                self._tool.append(block.tool)
            self._segments += len(block)
            self.of_dwells.extend(block.tool for event in block.events if event.kind == "dwell")
            yield block

    def at(self, segments: np.ndarray) -> np.ndarray:
        """The tool of each of these segments, by their numbers in the program."""
        return np.array(self._tool)[np.searchsorted(self._first, segments, side="right") - 1]
