"""A signal over time, used as a voltage or as a reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import listed
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.types import Reference

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Signal:
    """A signal of one axis: V as a voltage; mm, mm/s and mm/s² as a reference (degrees; rev/min for a spindle).

    `motion` gives position, velocity and acceleration at an array of times, which belong together. `settings` says
    how the signal was made. `voltage` is there where a voltage is not simply the position of that motion, or
    takes much less time than all of it.
    """

    kind: str
    motion: Callable[[np.ndarray], Motion]
    period: float | None = None  # s; None if it does not repeat
    settings: Mapping[str, Any] = field(default_factory=dict)
    voltage: Callable[[np.ndarray], np.ndarray] | None = None
    fastest: float | None = None  # Hz, the highest frequency in it, where that is not 1/`period`

    def __repr__(self) -> str:
        return f"<Signal {self.kind}: {listed(self.settings)}>"

    def value(self, t: Any) -> Any:
        """The voltage at time `t` (s): an array for an array of times, a float for one."""
        times = np.asarray(t, dtype=float)
        flat = times.ravel()
        values = self.voltage(flat) if self.voltage else self.motion(flat)[0]
        return np.asarray(values, dtype=float).reshape(times.shape)[()]

    def reference(self, t: Any) -> Reference:
        """Position, velocity and acceleration at time `t` (s): arrays for an array of times, floats for one."""
        times = np.asarray(t, dtype=float)
        parts: list[Any] = [np.asarray(part, dtype=float).reshape(times.shape) for part in self.motion(times.ravel())]
        return Reference(*(part[()] for part in parts))

    def check_sampling(self, T: float) -> None:
        """InputError if the signal repeats faster than half the sampling frequency 1/`T` can show."""
        SAMPLE_PERIOD.check(T, "T", "signal")
        frequency = self.fastest or (1.0 / self.period if self.period is not None else 0.0)
        if 2.0 * T * frequency * (1.0 - 1e-9) > 1.0:
            raise InputError(
                f"{self.kind}: frequency = {frequency:g} Hz is above half the sampling frequency "
                f"({0.5 / T:g} Hz at a sample period of {T:g} s); lower the frequency or shorten the sample period"
            )


def sample_times(T: float, N: int) -> np.ndarray:
    """The `N` times k T, s."""
    return np.arange(N) * T


def sample(signal: Signal, T: float, N: int) -> Reference:
    """`signal` as a reference: arrays of position, velocity and acceleration at `N` samples of `T` s.

    Raises InputError if the sampling is too slow for the signal.
    """
    signal.check_sampling(T)
    return signal.reference(sample_times(T, N))


def sample_voltage(signal: Signal, T: float, N: int) -> np.ndarray:
    """`signal` as `N` voltages (V), every `T` s. Raises InputError if the sampling is too slow for the signal."""
    signal.check_sampling(T)
    return signal.value(sample_times(T, N))
