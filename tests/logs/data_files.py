"""Logs made for tests: an axis with friction under a voltage, and files of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

T = 0.001  # s


def axis(samples: int = 4000, amplitude: float = 4.0, resolution: float = 0.001) -> dict[str, np.ndarray]:
    """Time (s), voltage (V) of three amplitudes, position (mm, in encoder steps) of an axis like the mini CNC's X."""
    k = np.arange(samples)
    levels = amplitude * np.array([0.4, -0.4, 0.7, -0.7, 1.0, -1.0])
    voltage = levels[(k // 250) % len(levels)]
    tau, gain, friction = 0.01, 1.764, 0.4
    position = np.empty(samples)
    x = v = 0.0
    for i in range(samples):
        position[i] = x
        drive = gain * voltage[i]
        drive = drive - friction * np.sign(v or drive) if abs(drive) > friction or v else 0.0
        v += T / tau * (drive - v)
        x += T * v
    return {"time": k * T, "voltage": voltage, "position": np.round(position / resolution) * resolution}


def write(path: Path, columns: Mapping[str, np.ndarray], delimiter: str = ",", decimal: str = ".") -> Path:
    """A CSV file with the columns as headed."""
    rows = [delimiter.join(columns)]
    rows += [
        delimiter.join(f"{v:.12g}".replace(".", decimal) for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def headed(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns of `axis` with their units in the headings."""
    units = {"time": "s", "voltage": "V", "position": "mm"}
    return {f"{name} [{units[name]}]": values for name, values in columns.items()}


MAP = """
[time]
column = "time"
unit = "s"
[axis.X]
command = { column = "voltage", unit = "V" }
position = { column = "position", unit = "mm" }
"""
