"""The plant of one student's run: drawn parameters, and what disturbs it. It stays in the grader's process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from rds.core.contracts import Motion
from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.types import Model
from rds.grading.assignment.seeds import part_seed
from rds.identification.robustness.draws import draws
from rds.identification.robustness.uncertain import Uncertain
from rds.models import library_model
from rds.models.machine_model import MachineAxisMotion, linear_part
from rds.modes.parts import start
from rds.references import make_signal


@dataclass(frozen=True)
class Disturbance:
    """A voltage at the plant's input beside the controller's, from `start` to `end` s, V at each sample.

    A force does the same to an axis as the voltage that would balance it: F divided by the axis's N/V.
    """

    voltage: np.ndarray
    start: float
    end: float


def read_disturbance(words: TomlTable | None, T: float, samples: int) -> Disturbance | None:
    """`[case.disturbance]`: a signal by `kind` with its options, V, from `start` to `end`, s."""
    if words is None:
        return None
    first = words.read("start")
    end = words.read("end")
    if "kind" not in words:
        raise InputError('kind is missing; as in `kind = "constant"` with `value` in V', words.place())
    kind = words.read("kind")
    options = {key: words.any(key) for key in words.table if key not in ("kind", "start", "end")}
    try:
        signal = make_signal(kind, **options)
        signal.check_sampling(T)
    except InputError as error:
        raise InputError(str(error), words.place("kind")) from error
    times = np.arange(samples) * T
    voltage = np.zeros(samples)
    on = (times >= first - T / 2) & (times < end - T / 2)
    if not on.any():
        raise words.fault("start", "s leaves no sample of the case disturbed")
    voltage[on] = signal.value(times[on] - first)
    return Disturbance(voltage, first, end)


def drawn_model(plant: Uncertain, seed: int, number: int) -> Model:
    """The plant of run `number` of the student whose seed is `seed`; the model as it is where nothing varies."""
    if not plant.spread.names:
        return plant.base
    (row,) = draws(plant.spread, part_seed(seed, plant.name, "plant"), number, number + 1)
    return plant.drawn(row)


def linear_model(model: Model) -> Model | None:
    """The same axis without friction, play, dead zone and offset, its delay kept; None of a model unknown here."""
    if model.motion is MachineAxisMotion:
        return library_model("machine-axis", **linear_part(model.params), delay=model.params["delay"])
    if model.source.name == "linear-axis" and model.source.path is None:
        return library_model("linear-axis", tau=model.params["tau"], K=model.params["K"])
    return None


def noise_of(std: float, samples: int, *seeds: int | str) -> np.ndarray | None:
    """White noise of this standard deviation, the same for the same seeds; None for none."""
    if not std:
        return None
    number = part_seed(int(seeds[0]), *seeds[1:])
    return std * np.random.Generator(np.random.PCG64(number)).standard_normal(samples)


def disturbed(
    model: Model, voltage: np.ndarray | None, noise: np.ndarray | None, actual: Callable[[float], Any] | None = None
) -> Model:
    """The model with `voltage` (V, of each sample) beside what acts on it, and `noise` on what is read of it.

    `actual` is given each position before the noise.
    """
    if voltage is None and noise is None:
        return model
    made = partial(_Disturbed, voltage=voltage, noise=noise, actual=actual)
    moved = replace(model, has_velocity=False, told={})  # that of the disturbed motion is not told
    return replace(moved, motion=lambda own, T: made(start(replace(own, motion=model.motion), T)))


class _Disturbed:
    """A model in motion, with something added on the way in and on the way out."""

    def __init__(
        self,
        motion: Motion,
        voltage: np.ndarray | None,
        noise: np.ndarray | None,
        actual: Callable[[float], Any] | None,
    ):
        self._read, self._write, self._actual = motion.read, motion.write, actual
        self._voltage: Sequence[float] | None = None if voltage is None else voltage.tolist()
        self._noise: Sequence[float] | None = None if noise is None else noise.tolist()
        self._k = 0

    def read(self) -> float:
        """The position as the encoder meets it."""
        position = self._read()
        if self._actual is not None:
            self._actual(position)
        return position if self._noise is None else position + self._noise[self._k]

    def write(self, voltage: float) -> None:
        """Move on by one sample."""
        self._write(voltage if self._voltage is None else voltage + self._voltage[self._k])
        self._k += 1
