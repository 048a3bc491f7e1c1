"""Cutting force and loads of the joints along a part program, as it is planned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.machines import Machine
from rds.machines.forces.cut_file import FORCE, POWER, CutFile, require_joints
from rds.machines.forces.propagation import joint_loads
from rds.modes.loop.force_guard import ForceGuard
from rds.modes.loop.program import Program
from rds.nc.run.prepare import Prepared

_BLOCK = 20_000  # samples at a time
_STILL = 1e-9  # mm/s


@dataclass(frozen=True)
class Worst:
    """The largest size of one load: its value with sign, the line and the time (s) of the plan, and its limit."""

    name: str
    unit: str
    value: float
    line: int
    time: float
    limit: float | None

    @property
    def share(self) -> float | None:
        """Of the limit."""
        return None if self.limit is None else abs(self.value) / self.limit

    def to_json(self) -> dict[str, Any]:
        """As a plain dict."""
        own = {"value": self.value, "unit": self.unit, "line": self.line, "time_s": self.time}
        return own | {"limit": self.limit, "share": self.share}


@dataclass(frozen=True)
class ProgramForces:
    """Along the plan, at each sample: cutting force (m,) in N, loads (m, joints) in N or N m, line (m,)."""

    joints: tuple[str, ...]
    units: tuple[str, ...]
    force: np.ndarray
    loads: np.ndarray
    line: np.ndarray
    T: float
    cut: CutFile
    power: np.ndarray  # (m,), W, of the spindle; zeros where it does not follow from the cut

    @property
    def worst(self) -> list[Worst]:
        """The cutting force's largest value, and each joint's."""
        table = np.column_stack([self.force, self.loads, self.power])
        found = []
        names = (FORCE, *self.joints, *([POWER] if self.cut.has_power else []))
        for column, name, unit in zip(table.T, names, ("N", *self.units, "W"), strict=False):
            at = int(np.abs(column).argmax())
            limit = self.cut.limits.get(name)
            found.append(Worst(name, unit, float(column[at]), int(self.line[at]), at * self.T, limit))
        return found

    def share(self) -> np.ndarray:
        """The largest share (m,) that force and loads take of their limits; 0 without limits."""
        share = np.zeros(len(self.force))
        for name, limit in self.cut.limits.items():
            if name == POWER:  # grows with f^(1 - m_c); as a share that goes with f^α as the others do
                assert self.cut.law.mc is not None
                exponent = self.cut.law.feed / max(1.0 - self.cut.law.mc, 1e-3)
                share = np.maximum(share, (self.power / limit) ** exponent)
                continue
            column = self.force if name == FORCE else self.loads[:, self.joints.index(name)]
            share = np.maximum(share, np.abs(column) / limit)
        return share

    def warnings(self) -> list[str]:
        """Where the plan takes more power than the spindle has, with the line."""
        limit = self.cut.limits.get(POWER)
        if limit is None or not (self.power > limit).any():
            return []
        at = int(self.power.argmax())
        lines = len(np.unique(self.line[self.power > limit]))
        more = f" (and in {lines - 1} more line{'s' * (lines > 2)})" if lines > 1 else ""
        return [
            f"line {self.line[at]}{more}: the cut takes {self.power[at]:.0f} W at the programmed feed, and the spindle "
            f"has {limit:g} W"
        ]

    def override(self) -> np.ndarray:
        """The feed (m,), as a multiple of the programmed one but at most 1, that keeps all limits.

        It is equation 4 solved for f. Loads are in proportion to the force, and the force to f^α.
        """
        share = self.share()
        made = np.ones(len(share))
        over = share > 1.0
        made[over] = share[over] ** (-1.0 / self.cut.law.feed)
        return made

    def guard(self) -> ForceGuard:
        """What keeps the limits while the program runs."""
        return ForceGuard(self.force, self.share(), self.cut.law.feed, self.cut.hardness)

    def to_json(self) -> dict[str, Any]:
        """What `rds forces --json` prints."""
        override = self.override()
        at = int(override.argmin())
        return {
            "material": self.cut.law.name,
            "loads": {worst.name: worst.to_json() for worst in self.worst},
            "warnings": self.warnings(),
            "least_override": {"value": float(override[at]), "line": int(self.line[at]), "time_s": at * self.T},
        }


def program_forces(prepared: Prepared, machine: Machine, cut: CutFile) -> ProgramForces:
    """Force and loads of a planned program: every feed move cuts, no rapid does.

    A cut whose power follows and which limits none may take what the machine says of its spindle.

    Raises InputError for a limit of a joint that there is not, and for a feed move while the spindle stands.
    """
    program, kinematics = prepared.program, machine.kinematics
    if not isinstance(program, Program):
        raise InputError("forces are worked out for planned motion; leave --interpolator away")
    require_joints(cut, kinematics.joints, machine.name)
    if cut.has_power and POWER not in cut.limits and machine.spindle_power is not None:
        cut = replace(cut, limits={**cut.limits, POWER: machine.spindle_power})
    path = prepared.path
    number = np.clip(prepared.segment, 0, max(len(path) - 1, 0))  # the first row belongs to none
    feeds = ~path["rapid"][number] if len(path) else np.zeros(program.samples, bool)
    speed = spindle_speed(program, cut)
    columns = [program.axes.index(name) if name in program.axes else -1 for name in kinematics.joints]
    turns = np.array(kinematics.turns, dtype=bool)
    force, power = np.zeros(program.samples), np.zeros(program.samples)
    loads = np.zeros((program.samples, len(columns)))
    for rows in _blocks(program.samples):
        q = _of_joints(program.position[rows], columns)
        rates = _of_joints(program.velocity[rows], columns) * np.where(turns, np.pi / 180.0, 1.0)
        way = np.einsum("nij,nj->ni", kinematics.jacobian(q)[:, :3], rates)
        feed = np.linalg.norm(way, axis=1)
        cutting = feeds[rows] & (feed > _STILL)
        if (stands := cutting & (speed[rows] == 0.0)).any():
            line = int(program.line[rows][stands.argmax()])
            raise InputError(
                f"line {line} cuts while the spindle stands; start it (S, M3), or give the speed of the cut",
                program.name,
            )
        feed = np.where(cutting, feed, 0.0)
        size = cut.force(feed, speed[rows])
        against = -way / np.maximum(feed, _STILL)[:, None] * size[:, None]
        tool = kinematics.forward(q)[:, :3, 2]
        against, along = _turned(against, tool, cut.direction), tool * (cut.axial * size)[:, None]
        power[rows] = cut.power(feed, speed[rows])
        force[rows], loads[rows] = size, joint_loads(kinematics, q, against * cutting[:, None] + along)
    units = tuple("N m" if turn else "N" for turn in kinematics.turns)
    return ProgramForces(kinematics.joints, units, force, loads, program.line, prepared.T, cut, power)


def _turned(vectors: np.ndarray, about: np.ndarray, angle: float) -> np.ndarray:
    """Vectors (n, 3) turned about unit vectors (n, 3) by degrees."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    along = (vectors * about).sum(axis=1, keepdims=True) * about
    turned: np.ndarray = cosine * vectors + sine * np.cross(about, vectors) + (1.0 - cosine) * along
    return turned


def spindle_speed(program: Program, cut: CutFile) -> np.ndarray:
    """The spindle's speed (m,), rev/min, at each planned sample: the program's, or where it has none the cut's."""
    speed = np.zeros(program.samples)
    for happening in program.happenings:
        if happening.kind == "spindle":
            speed[happening.sample :] = happening.value
    return speed if cut.speed is None else np.where(speed == 0.0, cut.speed, speed)


def _of_joints(table: np.ndarray, columns: list[int]) -> np.ndarray:
    """The columns (n, joints) of the joints; 0 of one that no part program moves."""
    made = np.zeros((len(table), len(columns)))
    for at, column in enumerate(columns):
        if column >= 0:
            made[:, at] = table[:, column]
    return made


def _blocks(samples: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, samples)) for start in range(0, samples, _BLOCK))


def picture(found: ProgramForces) -> Any:
    """Cutting force and loads over the time of the plan, with their limits, and the override that keeps them."""
    from rds.core.figure import BLACK, CYCLE, Picture, dress, legend

    step = max(1, len(found.force) // 20_000)
    t = np.arange(0, len(found.force), step) * found.T
    kinds = [unit for unit in ("N", "N m") if unit in found.units]
    drawn = Picture(2.2 * (len(kinds) + 2))
    grid = drawn.subplots(len(kinds) + 2, 1, squeeze=False, sharex=True)[:, 0]
    grid[0].plot(t, found.force[::step], color=CYCLE[0], linewidth=1.2)
    _limit(grid[0], found.cut.limits.get(FORCE), BLACK, signs=(1.0,))
    dress(grid[0], "cutting force [N]", None)
    for axes, unit in zip(grid[1:], kinds, strict=False):
        for at, name in enumerate(found.joints):
            if found.units[at] == unit:
                colour = CYCLE[at % len(CYCLE)]
                axes.plot(t, found.loads[::step, at], color=colour, linewidth=1.2, label=name)
                _limit(axes, found.cut.limits.get(name), colour)
        dress(axes, f"load of joints [{unit}]", None)
        legend(axes)
    grid[-1].plot(t, 100.0 * found.override()[::step], color=CYCLE[1], linewidth=1.2)
    grid[-1].set_ylim(0.0, 105.0)
    dress(grid[-1], "override that keeps [%]", "time [s]")
    drawn.align_ylabels()
    return drawn


def _limit(axes: Any, limit: float | None, colour: str, signs: tuple[float, ...] = (-1.0, 1.0)) -> None:
    if limit is not None:
        for sign in signs:
            axes.axhline(sign * limit, color=colour, linestyle="--", linewidth=0.8)
