"""A part program as the motion of nodes, units on a serial line or modules on CAN: set points, and equations.

Methods A and C take set points, whole steps on a serial line; method B takes equations.

`plan` is the built-in planned motion, within the limits of the axes. `constant` is the thesis's: each segment at its
feed from the first step to the last, without any ramp, rapids at the largest speed of the axes; method B knows no
other. Rapids without synchronization let each axis go at its own speed (dcs-thesis, figure 6.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import ceil
from pathlib import Path

import numpy as np

from rds.bus.modules.dcs.buffers import pulses_of
from rds.bus.modules.dcs.commands import BYTE_TIME
from rds.bus.modules.segments import Equations, NodeSegment, arc, line
from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.segments import AXES, LINE, XY, YZ, ZX, in_plane
from rds.machines import Machine
from rds.modes.loop.program import Program, dwell_samples
from rds.nc.run.prepare import Prepared, prepare
from rds.nc.setup import Setup

MOTIONS = ("plan", "constant")
_MOST_STEPS = 65_535  # of a segment in method B
_OFF_CIRCLE = 0.03  # mm: what the language lets any arc have


@dataclass(frozen=True)
class SpindleTrack:
    """What the spindle's node does: the voltage of each step as a share of the converter's range, -1 to 1.

    `shares` go with the samples of the motion (methods A and C), `stretches` with its equations (B): steps and share.
    """

    name: str
    unit: int
    shares: np.ndarray
    stretches: tuple[tuple[int, float], ...]

    def counts(self, full: int) -> np.ndarray:
        """BLU of each step, where `full` are those of the whole range."""
        return np.rint(full * self.shares).astype(np.int64)

    def segments(self, full: int) -> list[NodeSegment]:
        """The same for method B."""
        found, place = [], 0
        for steps, share in self.stretches:
            end = place + steps * round(full * share)
            found.append(line(place, end, steps))
            place = end
        return found


@dataclass(frozen=True)
class SerialMotion:
    """What the nodes are to do, in steps of `period` s: 10 ms on a serial line, the sample period on CAN.

    `positions` (m + 1 × n, axis units) are the samples, `pulses` (m × n) their whole BLU, `segment` (m + 1) says where
    on the path each is; `nodes` are the equations of method B, a list for each axis, and `counts` the steps that each
    segment of the path takes by them. `pulses` are none on CAN, where set points are no whole counts.
    """

    prepared: Prepared
    axes: tuple[str, ...]
    units: tuple[int, ...]
    blu: np.ndarray
    positions: np.ndarray
    pulses: np.ndarray
    segment: np.ndarray
    nodes: list[list[NodeSegment]]
    counts: tuple[int, ...]
    notes: tuple[str, ...]
    period: float = BYTE_TIME
    spindle: SpindleTrack | None = None

    @property
    def start(self) -> np.ndarray:
        """Where the motion begins, BLU."""
        return np.rint(self.positions[0] / self.blu).astype(np.int64)


def serial_motion(
    file: Path,
    machine: Machine,
    setup: Setup | None = None,
    *,
    motion: str = "plan",
    synchronized: bool = True,
    progress: Progress | None = None,
    period: float = BYTE_TIME,
    whole: bool = True,
) -> SerialMotion:
    """The motion of the program in `file` for the nodes of `machine`, in steps of `period` s.

    `whole`: position bytes of a serial line carry it, whole BLU. InputError as `prepare`, and for a program that moves
    nothing.
    """
    if motion not in MOTIONS:
        raise InputError(f"motion {motion!r} is unknown; known: {', '.join(MOTIONS)}")
    prepared = prepare(file, machine, setup, period, progress)
    if not len(prepared.path):
        raise InputError("nothing in it moves: there is nothing for nodes to carry out", str(file))
    program = prepared.program
    axes = program.axes
    blu = np.array([machine.axis(name).resolution for name in axes])
    order = [AXES.index(name) for name in axes]
    nodes, counts = _equations(prepared.path, order, blu, Limits.of(machine), synchronized, period)
    happenings = getattr(program, "happenings", ())
    speeds = []  # of the spindle: sample, step of the equations, rev/min
    for each in happenings:
        after = int(prepared.segment[each.sample - 1]) if each.sample else None
        if each.kind == "dwell":
            _hold(nodes, counts, after, each.value, period)
        elif each.kind == "spindle":
            speeds.append((each.sample, 0 if after is None else sum(counts[: after + 1]), each.value))
    notes = [*prepared.notes, *_off_their_circles(prepared.path)]
    if kinds := sorted({each.kind for each in happenings} - {"end", "dwell", "spindle", "override"}):
        notes.append(f"nodes move axes and spindle only; not carried out of the program: {', '.join(kinds)}")
    if motion == "plan":
        assert isinstance(program, Program)
        positions, segment = program.position, prepared.segment
    else:
        positions, segment = by_equations(nodes, blu, counts)
        speeds = [(step, step, speed) for _, step, speed in speeds]
    return SerialMotion(
        prepared,
        axes,
        tuple(machine.axis(name).node for name in axes),
        blu,
        positions,
        pulses_of(positions, blu.tolist()) if whole else np.zeros((0, len(axes)), np.int64),
        np.asarray(segment),
        nodes,
        tuple(counts),
        tuple(notes),
        period,
        _spindle(machine, speeds, len(positions) - 1, sum(counts)),
    )


def _spindle(
    machine: Machine, speeds: Sequence[tuple[int, int, float]], samples: int, steps: int
) -> SpindleTrack | None:
    """The spindle's voltages by its model; None where nothing turns it. `speeds` are samples, steps, rev/min."""
    axis = next((axis for axis in machine.axes.values() if axis.is_spindle), None)
    if axis is None or not any(speed for _, _, speed in speeds):
        return None
    if "K" not in axis.model:
        raise InputError(
            f"axis {axis.name}: methods A, B and C need a model with K, from which its voltage follows; model "
            f"{axis.model.get('name')!r} has none: take spindle, or a program without M3 and M4",
            machine.path,
        )
    shares, ends = np.zeros(samples), [*(step for _, step, _ in speeds[1:]), steps]
    stretches = [(speeds[0][1], 0.0)]
    for (sample, step, speed), end in zip(speeds, ends, strict=True):
        share = max(-1.0, min(1.0, speed / (float(axis.model["K"]) * machine.converter.range)))
        shares[sample:] = share
        stretches.append((end - step, share))
    whole = [
        (min(steps - done, _MOST_STEPS), share) for steps, share in stretches for done in range(0, steps, _MOST_STEPS)
    ]
    return SpindleTrack(axis.name, axis.node, shares, tuple(whole))


def _equations(
    path: np.ndarray, order: Sequence[int], blu: np.ndarray, limits: Limits, synchronized: bool, period: float
) -> tuple[list[list[NodeSegment]], list[int]]:
    """The equations of each axis for all segments of the path, and each segment's steps."""
    nodes: list[list[NodeSegment]] = [[] for _ in order]
    counts = []
    velocity = np.asarray(limits.velocity)[list(order)]
    for row in path:
        way = (row["end"] - row["start"])[list(order)]
        own = np.ceil(np.abs(way) / (velocity * period) - 1e-9).astype(int)  # of a rapid
        fast = max(int(own.max(initial=1)), 1)
        steps = fast if row["rapid"] else max(ceil(row["length"] / (row["rate"] * period) - 1e-9), 1, fast)
        if steps > _MOST_STEPS:
            raise InputError(
                f"line {row['line']} takes {steps * period:.0f} s; a segment of method B has {_MOST_STEPS} steps of "
                f"{period:g} s at most: divide it, or raise its feed"
            )
        counts.append(steps)
        for i, axis in enumerate(order):
            start, end = row["start"][axis] / blu[i], row["end"][axis] / blu[i]
            turning = row["plane"] != LINE and axis in in_plane(int(row["plane"]))[:2]
            if turning:
                nodes[i].append(_arc(row, axis, blu[i], steps))
            elif row["rapid"] and not synchronized and own[i] < steps:
                if own[i]:
                    nodes[i].append(line(start, end, int(own[i])))
                nodes[i].append(line(end, end, steps - int(own[i])))
            else:
                nodes[i].append(line(start, end, steps))
    return nodes, counts


def _off_their_circles(path: np.ndarray) -> list[str]:
    """A note on the arc whose end is farthest off the circle about its centre, where that is much."""
    off = np.zeros(len(path))
    for plane in (XY, ZX, YZ):
        some, (first, second, _) = path["plane"] == plane, in_plane(plane)
        start, end = (
            np.hypot(*(path[each][some][:, k] - path["centre"][some][:, k] for k in (first, second)))
            for each in ("start", "end")
        )
        off[some] = np.abs(end - start)
    worst = int(off.argmax())
    if off[worst] <= _OFF_CIRCLE:
        return []
    return [
        f"the arc of line {path['line'][worst]} ends {1e3 * off[worst]:.0f} µm off the circle about its centre: method "
        "B, which keeps the radius, makes a step of that in the next segment; correct the end or the centre"
    ]


def _hold(
    nodes: list[list[NodeSegment]], counts: list[int], segment: int | None, seconds: float, period: float
) -> None:
    """A dwell after a segment of the path, or before the first: all nodes stay where they are, and it takes longer."""
    steps, after = dwell_samples(seconds, period), segment or 0
    place = sum(counts[: after + 1]) if segment is not None else 0
    for found in nodes:
        ends = [0, *accumulate(each.steps for each in found)]
        at = ends.index(place)
        where = found[at].own if at < len(found) else _last(found[-1])
        found[at:at] = [line(where, where, min(steps - k, _MOST_STEPS)) for k in range(0, steps, _MOST_STEPS)]
    counts[after] += steps


def _last(node: NodeSegment) -> float:
    """Where a segment ends, BLU."""
    equations = Equations(node)
    return [equations.next() for _ in range(node.steps)][-1]


def _arc(row: np.ndarray, axis: int, blu: float, steps: int) -> NodeSegment:
    first, second, _ = in_plane(int(row["plane"]))
    other = second if axis == first else first
    centre = row["centre"][axis] / blu
    return arc(
        row["start"][axis] / blu,
        (row["start"][other] - row["centre"][other]) / blu,
        centre,
        float(row["sweep"]),
        steps,
        axis == first,
    )


def by_equations(
    nodes: Sequence[Sequence[NodeSegment]], blu: np.ndarray, counts: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Where the equations lead after each step (m + 1 × n, axis units), and the segment of each."""
    positions = np.column_stack([_positions(found, blu[i]) for i, found in enumerate(nodes)])
    return positions, np.concatenate(([0], np.repeat(np.arange(len(counts)), counts)))


def _positions(nodes: Sequence[NodeSegment], blu: float) -> np.ndarray:
    """Where the equations of one axis lead, axis units."""
    found = [nodes[0].own]
    for node in nodes:
        equations = Equations(node)
        found += [equations.next() for _ in range(node.steps)]
    return np.array(found) * blu
