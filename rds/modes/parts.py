"""The parts that modes are built from: models in motion behind encoders, and the loop in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any, cast

from rds.core.contracts import Motion
from rds.core.types import Ending, Model
from rds.machines.encoder import diverged, encoder
from rds.modes.loop.force_guard import Cell
from rds.modes.loop.loop import Loop
from rds.modes.loop.plan import Plan
from rds.modes.networked import Links


class SimulatedAxes:
    """The models of all axes in motion.

    `measure()` gives what the encoders read, in axis order. `follow(acting)` moves the models on by one sample; with
    no voltages given, the last ones are held.
    """

    def __init__(self, plan: Plan):
        self.motions = [start(axis.model, plan.T) for axis in plan.axes]
        reads = [
            _measured(motion, axis.axis.resolution, plan.quantization)
            for motion, axis in zip(self.motions, plan.axes, strict=True)
        ]
        writes = [motion.write for motion in self.motions]
        held: Sequence[float] = [0.0] * len(writes)

        def measure() -> Sequence[float]:
            return [read() for read in reads]

        def follow(acting: Sequence[float]) -> tuple[()]:
            nonlocal held
            held = acting or held
            for write, voltage in zip(writes, held, strict=True):
                write(voltage)
            return ()

        self.measure = measure
        self.follow: Callable[[Sequence[float]], tuple[()]] = follow
        if len(reads) == 1:  # the most frequent case by far, and twice as fast without the loops
            (read,), (write,) = reads, writes

            def measure_one() -> Sequence[float]:
                return (read(),)

            def follow_one(acting: Sequence[float]) -> tuple[()]:
                nonlocal held
                held = acting or held
                write(held[0])
                return ()

            self.measure, self.follow = measure_one, follow_one

    def follow_and_tell(self, acting: Sequence[float]) -> list[float]:
        """`follow`, returning the outputs as they were before."""
        outputs = [motion.read() for motion in self.motions]
        for output in outputs:
            if not isfinite(output):
                raise diverged(output)
        self.follow(acting)
        return outputs

    def follow_plant(self, plan: Plan) -> Callable[[Sequence[float]], Sequence[float]]:
        """`follow` for the plant of a run: it returns what the plan wants recorded, as it is before the move."""
        follow = self.follow
        told = [(cast(Any, self.motions[i]), part) for i, part, _ in plan.plant_columns]
        if not told:
            return follow

        def follow_and_tell(acting: Sequence[float]) -> Sequence[float]:
            values = [getattr(motion, part) for motion, part in told]
            for value, (_, part) in zip(values, told, strict=True):
                if not isfinite(value):
                    raise diverged(value, part)
            follow(acting)
            return values

        ((motion, first), *others) = told

        def follow_one_and_tell(acting: Sequence[float]) -> Sequence[float]:
            velocity = motion.velocity
            if not isfinite(velocity):
                raise diverged(velocity, "velocity")
            follow(acting)
            return (velocity,)

        return follow_and_tell if others or first != "velocity" else follow_one_and_tell


class ModelMotion:
    """A model in motion through its `advance`."""

    __slots__ = ("_T", "_advance", "_output", "_params", "_state")
    dead_time = 0.0

    def __init__(self, model: Model, T: float):
        self._advance, self._output, self._params, self._T = model.advance, model.output, dict(model.params), T
        self._state = model.initial_state

    def read(self) -> float:
        """The output now."""
        return float(self._output(self._state) if self._output else self._state[0])

    @property
    def velocity(self) -> float:
        """The second state, of a model that `has_velocity`."""
        return float(self._state[1])

    def write(self, voltage: float) -> None:
        """Move on by one sample."""
        self._state = self._advance(self._state, voltage, self._T, self._params)

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s."""
        self._state = self._advance(self._state, voltage, time, self._params)


def start(model: Model, T: float) -> Motion:
    """A model in motion with samples of `T` s."""
    motion: Motion = model.motion(model, T) if model.motion else ModelMotion(model, T)
    return motion


def loop(
    plan: Plan,
    read: Callable[[], Sequence[float]],
    write: Callable[[Sequence[float]], Sequence[float]],
    follow: Callable[[Sequence[float]], Sequence[float]],
    links: Links | None = None,
    cell: Cell | None = None,
) -> Loop:
    """The loop of these parts in virtual time, its rows going nowhere.

    With a network between them, that of the plan, unless `links` are handed in. `cell` is the machine's load cell.
    """
    drive = plan.start(cell)
    if plan.network is not None:
        read, write, follow = (links or Links(plan)).around(read, write, follow)
    return Loop(
        plan.most_samples,
        _due,
        read,
        drive.laws,
        write,
        follow,
        _dropped,
        _going_on,
        drive.changes,
        drive.sets_references,
        drive.notes,
    )


def simulated_loop(
    plan: Plan,
    axes: SimulatedAxes,
    read: Callable[[], Sequence[float]],
    write: Callable[[Sequence[float]], Sequence[float]],
) -> Loop:
    """The loop of a run whose plant is simulated: behind a network, voltages change at any time within a sample."""
    if plan.network is None:
        return loop(plan, read, write, axes.follow_plant(plan))
    links = Links(plan)
    axes.follow = links.moving(axes.motions)
    return loop(plan, read, write, axes.follow_plant(plan), links)


def at_once(voltages: Sequence[float]) -> Sequence[float]:
    """Without drivers, voltages act at once."""
    return voltages


def nothing(acting: Sequence[float]) -> tuple[()]:
    """No model runs along."""
    return ()


def _measured(motion: Motion, resolution: float, quantization: bool) -> Callable[[], float]:
    """What the encoder reads of a motion."""
    measure, read = encoder(resolution, quantization=quantization), motion.read

    def as_it_is() -> float:
        position = read()
        if not isfinite(position):
            raise diverged(position)
        return position

    return as_it_is if measure is None else lambda: measure(read())


def _due(k: int) -> int:
    return k


def _dropped(row: list[float]) -> None:
    return None


def _going_on(k: int) -> Ending | None:
    return None
