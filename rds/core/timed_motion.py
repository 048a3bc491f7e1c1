"""A model whose equations know the time, in motion."""

from __future__ import annotations

from rds.core.types import Model


class TimedMotion:
    """A `timed` model in motion: `contracts.Motion`. The time is k T at sample k, as everywhere in a run."""

    dead_time = 0.0

    def __init__(self, model: Model, T: float):
        self.state = tuple(float(value) for value in model.initial_state)
        self._model, self._T, self._params = model, T, dict(model.params)
        self._samples = 0
        self._into = 0.0  # s: how far `move` has come since a sample began

    def read(self) -> float:
        """The output now: position, mm, unless the model has its own `output`."""
        return float(self._model.seen(self.state, self._params, self._now))

    @property
    def velocity(self) -> float:
        """The second state, of a model that `has_velocity`: mm/s."""
        return self.state[1]

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        self.state = tuple(self._model.moved(self.state, voltage, self._T, self._params, self._samples * self._T))
        self._samples += 1

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s of constant `voltage`, V."""
        self.state = tuple(self._model.moved(self.state, voltage, time, self._params, self._now))
        self._into += time
        if self._into >= self._T * (1.0 - 1e-9):
            self._samples, self._into = self._samples + 1, 0.0

    @property
    def _now(self) -> float:
        return self._samples * self._T + self._into
