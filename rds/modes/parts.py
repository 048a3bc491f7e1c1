"""The parts that modes are built from: models in motion behind encoders."""

from __future__ import annotations

from collections.abc import Sequence

from rds.core.contracts import Motion
from rds.core.types import Model
from rds.interface import encoder
from rds.runtime.plan import Plan


class SimulatedAxes:
    """The models of all axes in motion."""

    def __init__(self, plan: Plan):
        self.motions = [start(axis.model, plan.T) for axis in plan.axes]
        self._encoders = [encoder(axis.axis.resolution) for axis in plan.axes] if plan.quantization else []
        self._acting: Sequence[float] = [0.0] * len(self.motions)

    def measure(self) -> list[float]:
        """What the encoders read, in axis order."""
        positions = [motion.read() for motion in self.motions]
        if self._encoders:
            return [measure(position) for measure, position in zip(self._encoders, positions, strict=True)]
        return positions

    def follow(self, acting: Sequence[float]) -> tuple[()]:
        """Move on by one sample; with no voltages given, the last ones are held."""
        self._acting = acting = acting or self._acting
        for motion, voltage in zip(self.motions, acting, strict=True):
            motion.write(voltage)
        return ()

    def follow_and_tell(self, acting: Sequence[float]) -> list[float]:
        """The same; returns the outputs as they were before."""
        outputs = [motion.read() for motion in self.motions]
        self.follow(acting)
        return outputs


class ModelMotion:
    """A model in motion through its `advance`."""

    __slots__ = ("_T", "_advance", "_output", "_params", "_state")

    def __init__(self, model: Model, T: float):
        self._advance, self._output, self._params, self._T = model.advance, model.output, dict(model.params), T
        self._state = model.initial_state

    def read(self) -> float:
        """The output now."""
        return float(self._output(self._state) if self._output else self._state[0])

    def write(self, voltage: float) -> None:
        """Move on by one sample."""
        self._state = self._advance(self._state, voltage, self._T, self._params)


def start(model: Model, T: float) -> Motion:
    """A model in motion with samples of `T` s."""
    motion: Motion = model.motion(model, T) if model.motion else ModelMotion(model, T)
    return motion


def at_once(voltages: Sequence[float]) -> Sequence[float]:
    """Without drivers, voltages act at once."""
    return voltages


def nothing(acting: Sequence[float]) -> tuple[()]:
    """No model runs along."""
    return ()
