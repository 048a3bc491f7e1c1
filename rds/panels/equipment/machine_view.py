"""The machine in motion, in three dimensions: drawn from its links, or, of a machine without, as a mill of three axes.

Drawn with k3d, which costs the kernel a few matrices ten times a second; made only when somebody wants to see it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import ipywidgets as widgets
import k3d
import numpy as np

from rds.machines import Machine
from rds.machines.kinematics.kinematics import TIP, ZERO
from rds.machines.link_table import BED

_FRAME, _TABLE, _HEAD, _TOOL = 0x8A8A8A, 0x56B4E9, 0xE69F00, 0xD55E00
_SLOWER = 20.0  # the spindle is drawn turning this much more slowly, or ten pictures a second would only flicker
_EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))


class MachineView:
    """`begin(traces)` says what the rows hold, `show(row)` moves the machine there. Lengths are in mm."""

    _unit = "mm"

    def __init__(self, machine: Machine):
        self._axes = [name for name, axis in machine.axes.items() if axis.unit == "mm"][:3]
        self._spindle = next((name for name, axis in machine.axes.items() if axis.unit == "rev/min"), None)
        travel = [machine.axes[name].travel for name in self._axes] + [(-50.0, 50.0)] * (3 - len(self._axes))
        self._low, self._high = np.array(travel).T
        self._at: dict[str, int] = {}
        self._time, self._turned = 0.0, 0.0
        self.words = widgets.HTML()
        self._build(machine)
        self.widget = widgets.VBox([self._plot, self.words])
        self._move({})

    def _build(self, machine: Machine) -> None:
        """The parts of the picture."""
        size = float(max(self._high - self._low))
        self._plot = k3d.plot(
            height=340, camera_auto_fit=False, menu_visibility=False, grid_visible=False, axes=["X", "Y", "Z"]
        )
        self._plot += box_lines(self._low, self._high)
        self._table = _solid((0.5 * size, 0.5 * size, 0.04 * size), _TABLE)
        self._head = _solid((0.14 * size, 0.14 * size, 0.3 * size), _HEAD)
        self._tool = _solid((0.09 * size, 0.025 * size, 0.16 * size), _TOOL)
        for part in (self._table, self._head, self._tool):
            self._plot += part
        self._size = size
        self._plot.camera = [1.0 * size, -1.25 * size, 0.8 * size, 0, 0, 0, 0, 0, 1]

    def begin(self, traces: Sequence[tuple[str, str]]) -> None:
        """The columns of the rows to come, after the time."""
        names = [name for name, _ in traces]
        wanted = [*self._axes, *([self._spindle] if self._spindle else [])]
        self._at = {}
        for axis in wanted:
            for kind in ("measured", "modelled", "reference"):
                if f"{axis}_{kind}" in names:
                    self._at[axis] = 1 + names.index(f"{axis}_{kind}")
                    break
        self._time = self._turned = 0.0

    def show(self, row: np.ndarray) -> None:
        """Move to the positions of one row: time in s, then the traces."""
        if not len(row):
            return
        where = {axis: float(row[column]) for axis, column in self._at.items() if column < len(row)}
        step = float(row[0]) - self._time  # also back, where somebody scrubs
        self._time = float(row[0])
        speed = where.get(self._spindle or "", 0.0)
        self._turned += 2.0 * math.pi * speed / 60.0 / _SLOWER * step
        self._move(where)

    def _move(self, where: dict[str, float]) -> None:
        x, y, z = (where.get(name, 0.0) for name in [*self._axes, "", "", ""][:3])
        bottom = float(self._low[2])
        self._table.model_matrix = _placed(x, y, bottom)
        self._head.model_matrix = _placed(0.0, 0.0, z + 0.31 * self._size)
        self._tool.model_matrix = _placed(0.0, 0.0, z + 0.08 * self._size, self._turned)
        self._say(where)

    def _say(self, where: dict[str, float]) -> None:
        said = ", ".join(f"{name} {value:.3f}" for name, value in where.items())
        unit = self._unit
        if self._spindle in where:
            unit += f"; spindle in rev/min, drawn {_SLOWER:g} times slower"
        self.words.value = f"<p>at {self._time:.2f} s: {said} [{unit}]</p>" if said else "<p>nothing has moved yet</p>"


class LinksView(MachineView):
    """A machine drawn from its links, as its kinematics move them: from the bed to the tool's tip and to the work.

    A bar goes from each body to the one that it carries; a block stands where a body's frame is.
    """

    _unit = "mm and degrees"

    def _build(self, machine: Machine) -> None:
        self._kinematics = machine.kinematics
        self._axes = list(self._kinematics.joints)
        self._bars = bars_of(machine)
        frames = self._frames({})
        places = np.array([frame[:3, 3] for frame in frames.values()])
        low, high = places.min(axis=0), places.max(axis=0)
        self._size = size = max(float((high - low).max()), 100.0)
        self._plot = k3d.plot(
            height=340, camera_auto_fit=False, menu_visibility=False, grid_visible=False, axes=["X", "Y", "Z"]
        )
        self._bodies = {}
        works = {*_branch(machine, machine.work.link if machine.work else BED), ZERO}
        for name in frames:
            edge = (0.03 if name in (TIP, ZERO) else 0.07) * size
            color = _TOOL if name == TIP else _FRAME if name == BED else _TABLE if name in works else _HEAD
            self._bodies[name] = _solid((edge, edge, edge), color)
            self._plot += self._bodies[name]
        pairs = np.arange(2 * len(self._bars), dtype=np.uint32).reshape(-1, 2)
        self._lines = k3d.lines(
            self._ends(frames), pairs, indices_type="segment", color=_FRAME, width=0.012 * size, shader="mesh"
        )
        self._plot += self._lines
        x, y, z = ((low + high) / 2.0).tolist()
        self._plot.camera = [x + 1.2 * size, y - 1.5 * size, z + 0.9 * size, x, y, z, 0, 0, 1]

    def _frames(self, where: dict[str, float]) -> dict[str, np.ndarray]:
        """4x4 of each body by name, seen from the bed."""
        joints = {name: where[name] for name in self._axes if name in where}
        found = self._kinematics.frames(self._kinematics.values(joints))
        return {BED: np.eye(4)} | {name: frame[0] for name, frame in found.items()}

    def _ends(self, frames: dict[str, np.ndarray]) -> np.ndarray:
        places = [frames[name][:3, 3] for bar in self._bars for name in bar]
        return np.array(places, dtype=np.float32)

    def _move(self, where: dict[str, float]) -> None:
        frames = self._frames(where)
        for name, body in self._bodies.items():
            body.model_matrix = frames[name].astype(np.float32)
        if self._turned:
            self._bodies[TIP].model_matrix = (frames[TIP] @ _placed(0.0, 0.0, 0.0, self._turned)).astype(np.float32)
        self._lines.vertices = self._ends(frames)
        self._say(where)


def view_of(machine: Machine) -> MachineView:
    """The picture of a machine: from its links where it has any."""
    return LinksView(machine) if machine.links else MachineView(machine)


def bars_of(machine: Machine) -> list[tuple[str, str]]:
    """Which body carries which, the tool's tip and the work's zero among them."""
    bars = [(link.parent, link.name) for link in machine.links]
    tool = machine.tool.link if machine.tool else machine.links[-1].name
    return [*bars, (tool, TIP), (machine.work.link if machine.work else BED, ZERO)]


def _branch(machine: Machine, end: str) -> list[str]:
    parents = {link.name: link.parent for link in machine.links}
    found = []
    while end in parents:
        found.append(end)
        end = parents[end]
    return found


def _placed(x: float, y: float, z: float, turned: float = 0.0) -> np.ndarray:
    c, s = math.cos(turned), math.sin(turned)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], dtype=np.float32)


def _corners(low: Any, high: Any) -> np.ndarray:
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def box_lines(low: np.ndarray, high: np.ndarray) -> Any:
    """The travel of all axes."""
    corners = _corners(low, high).astype(np.float32)
    return k3d.lines(corners, np.array(_EDGES, dtype=np.uint32), indices_type="segment", color=_FRAME, shader="simple")


def _solid(size: tuple[float, float, float], color: int) -> Any:
    """A block about the origin."""
    half = np.array(size) / 2.0
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [each for a, b, c, d in faces for each in ((a, b, c), (a, c, d))]
    return k3d.mesh(
        _corners(-half, half).astype(np.float32),
        np.array(triangles, dtype=np.uint32),
        color=color,
        flat_shading=True,
        side="double",
    )
