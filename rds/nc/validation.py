"""What a validation found: faults and warnings by line, reach and lengths; as a text, and as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rds.interpolators.motion.segments import AXES
from rds.nc.language.errors import ProgramError

UNITS_OF_AXES = ("mm", "mm", "mm", "degrees", "degrees", "degrees")


@dataclass(frozen=True)
class Validation:
    """What became of a program: `faults` in the order of files and lines; `more` of them were counted only.

    `low` and `high` are how far the path reaches along the axes that move (machine coordinates, mm and degrees);
    lengths are in mm. `stopped`: the fault that ended the program; the lines after it, if any, were only read.
    """

    program: str
    machine: str
    faults: tuple[ProgramError, ...] = ()
    more: int = 0
    segments: int = 0
    cutting: float = 0.0
    rapid: float = 0.0
    low: Mapping[str, float] = field(default_factory=dict)
    high: Mapping[str, float] = field(default_factory=dict)
    tools: tuple[int, ...] = ()
    spindle: float = 0.0  # rev/min, the fastest
    stopped: ProgramError | None = None
    read_on: bool = False  # there are lines after that
    warnings: tuple[ProgramError, ...] = ()  # what is no fault and worth a look

    @property
    def ok(self) -> bool:
        """Whether the machine can run it."""
        return not self.faults

    def to_json(self) -> dict[str, Any]:
        """As plain dicts, lists, strings and numbers."""
        return {
            "program": self.program,
            "machine": self.machine,
            "ok": self.ok,
            "faults": [_to_json(fault) for fault in self.faults],
            "warnings": [_to_json(warning) for warning in self.warnings],
            "more_faults": self.more,
            "segments": self.segments,
            "cutting_mm": self.cutting,
            "rapid_mm": self.rapid,
            "reach": {axis: [self.low[axis], self.high[axis]] for axis in self.low},
            "tools": list(self.tools),
            "fastest_spindle_rev_min": self.spindle,
            "stopped": self.stopped and {"file": self.stopped.file, "line": self.stopped.line},
        }

    def __str__(self) -> str:
        lines = [_as_warning(warning) for warning in self.warnings]
        if self.ok:
            reach = ", ".join(
                f"{axis} {plain(self.low[axis])} to {plain(self.high[axis])} {UNITS_OF_AXES[AXES.index(axis)]}"
                for axis in self.low
            )
            lines.append(
                f"{self.program}: {self.machine} can run it: {self.segments} move{'s' * (self.segments != 1)}, "
                f"{self.cutting:.6g} mm at feed, {self.rapid:.6g} mm rapid; {reach or 'nothing moves'}"
            )
            return "\n".join(lines)
        lines += [str(fault) for fault in self.faults]
        if self.more:
            lines.append(f"and {self.more} faults more")
        count = len(self.faults) + self.more
        if self.stopped and self.stopped.line and self.read_on:
            lines.append(f"{self.program}: not run from line {self.stopped.line} on: the words after it were only read")
        lines.append(f"{self.program}: {self.machine} can't run it: {count} fault{'s' * (count > 1)}")
        return "\n".join(lines)


def _to_json(fault: ProgramError) -> dict[str, Any]:
    return {
        "file": fault.file,
        "line": fault.line,
        "column": fault.column,
        "word": fault.word,
        "message": fault.reason,
    }


def _as_warning(found: ProgramError) -> str:
    said = f"{found.word}: warning" if found.word else "warning"
    return str(ProgramError(f"{said}: {found.reason}", file=found.file, line=found.line, column=found.column))


def plain(value: float) -> str:
    """A number as people write it: up to four decimals, and as many as it takes to be anything."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return text if float(text) or not value else f"{value:.2g}"
