"""What an interpolation leaves: position, velocity and acceleration of each axis, errors, steps; saved and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.geometry import length
from rds.core.types import Segment
from rds.interpolators.acceleration import Acceleration
from rds.interpolators.reference_word import Steps

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.results import Result


@dataclass(frozen=True)
class Interpolation:
    """Samples k = 0 (at rest at the start) to N of a path, N T s long.

    `position` (mm), `velocity` (mm/s), `acceleration_rows` (mm/s²) have the shape (N + 1, axes). `segment` is the index
    of the segment of each sample; `path_error` its distance from the programmed path and `chord_error` that of the
    middle between it and the sample before, mm. `steps` says per segment how a reference word method took it. With
    `blu` (mm), positions are whole BLU, `theory` is the path before that, `pulses` (int, shape (N, axes)) the commands.
    """

    T: float  # s
    axes: tuple[str, ...]
    segments: tuple[Segment, ...]
    methods: tuple[str, str]  # of lines and of arcs
    acceleration: Acceleration | None
    position: np.ndarray
    velocity: np.ndarray
    acceleration_rows: np.ndarray
    segment: np.ndarray
    path_error: np.ndarray
    chord_error: np.ndarray
    steps: tuple[Steps | None, ...]
    blu: float | None
    theory: np.ndarray
    pulses: np.ndarray | None

    def __repr__(self) -> str:
        by = " and ".join(dict.fromkeys(self.methods))
        of = f"{len(self.segments)} {'segment' if len(self.segments) == 1 else 'segments'}"
        return f"<Interpolation of {of} by {by}: {', '.join(self.axes)}, {self.samples} samples of {self.T:g} s>"

    @property
    def samples(self) -> int:
        """N."""
        return len(self.position) - 1

    @property
    def duration(self) -> float:
        """N T, s."""
        return self.samples * self.T

    @property
    def time(self) -> np.ndarray:
        """k T, s."""
        return np.arange(self.samples + 1) * self.T

    @cached_property
    def programmed_length(self) -> float:
        """mm."""
        return sum(length(segment) for segment in self.segments)

    @cached_property
    def length(self) -> float:
        """Of the straight pieces between the samples, mm."""
        return float(np.linalg.norm(np.diff(self.theory, axis=0), axis=1).sum())

    @cached_property
    def generation_error(self) -> np.ndarray | None:
        """Commanded minus theoretical position (mm, shape (N + 1, axes)), by the pulses; None without them."""
        from rds.interpolators.reference_pulse import generation_error

        return None if self.pulses is None or self.blu is None else generation_error(self.theory, self.pulses, self.blu)

    @property
    def worst_steps(self) -> Steps | None:
        """Of the arcs that a reference word method took, the one with the largest error in BLU."""
        known = [each for each in self.steps if each is not None]
        return max(known, key=lambda each: max(each.radial_error, each.chord_error) / each.blu) if known else None

    @property
    def within(self) -> bool:
        """Whether one BLU is kept: by arcs (reference word), and by commands (reference pulse)."""
        error = self.generation_error
        pulses = error is None or float(np.abs(error).max()) <= (self.blu or 0.0)
        return pulses and all(each.within for each in self.steps if each is not None)

    def to_json(self) -> dict[str, Any]:
        """The summary: no samples."""
        error, worst = self.generation_error, self.worst_steps
        return {
            "method": self.methods[0] if self.methods[0] == self.methods[1] else list(self.methods),
            "acceleration": None if self.acceleration is None else self.acceleration.name,
            "sample_period_s": self.T,
            "axes": list(self.axes),
            "segments": len(self.segments),
            "samples": self.samples,
            "time_s": self.duration,
            "programmed_length_mm": self.programmed_length,
            "length_mm": self.length,
            "path_error_mm": float(self.path_error.max()),
            "chord_error_mm": float(self.chord_error.max()),
            "largest_velocity_mm_s": dict(zip(self.axes, np.abs(self.velocity).max(axis=0).tolist(), strict=True)),
            "largest_acceleration_mm_s2": dict(
                zip(self.axes, np.abs(self.acceleration_rows).max(axis=0).tolist(), strict=True)
            ),
            "steps": None if worst is None else worst.to_json(),
            "blu_mm": self.blu,
            "generation_error_mm": None if error is None else float(np.abs(error).max()),
            "within": self.within,
        }

    def result(self) -> Result:
        """As a table with units, which `rds.results` saves, reopens and compares."""
        from rds.results import Result

        columns: dict[str, np.ndarray] = {"time": self.time, "segment": self.segment + 1}
        units = {"segment": "", "path_error": "mm", "chord_error": "mm"}
        for k, axis in enumerate(self.axes):
            columns[f"{axis}_reference"] = self.position[:, k]
            columns[f"{axis}_reference_velocity"] = self.velocity[:, k]
            columns[f"{axis}_reference_acceleration"] = self.acceleration_rows[:, k]
            if self.pulses is not None and self.generation_error is not None:
                columns[f"{axis}_pulses"] = np.concatenate([[0], self.pulses[:, k]])
                columns[f"{axis}_generation_error"] = self.generation_error[:, k]
                units |= {f"{axis}_pulses": "BLU", f"{axis}_generation_error": "mm"}
        columns |= {"path_error": self.path_error, "chord_error": self.chord_error}
        about = {
            "axes": list(self.axes),
            "sample_period": self.T,
            "mode": "interpolation",
            "interpolation": self.to_json(),
        }
        return Result(columns, units, about)

    def save(self, path: str | Path) -> Path:
        """The table to a .csv, .mat or .parquet file, or all three in a folder; InputError where it can't."""
        return self.result().save(path)

    def plot(self) -> Picture:
        """Position, velocity and acceleration of each axis over time."""
        from rds.interpolators.plots import motion

        return motion(self)
