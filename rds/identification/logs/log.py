"""A log: what was recorded of one axis, as arrays with units, and what is to be known of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity

# what a column can be, beside time
QUANTITIES = ("command", "position", "velocity", "current", "force", "reference", "following_error")
_JITTER = 0.1  # of a sample period: how far a time may be off where a grid is needed
RATES = ("rev/min", "mm/s")  # units of a position that is a speed: of a spindle, or of a log without a position


class Gravity(StrEnum):
    """How much a finding matters to who believes in an estimate."""

    NOTE = "note"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """Something about a log that its reader must know: `what` is a sentence with numbers and units."""

    kind: str  # gap, duplicate, jitter, saturation, quantization, excitation, sign, clock, closed-loop, ...
    what: str
    gravity: Gravity = Gravity.NOTE
    sample: int | None = None  # the first sample concerned


@dataclass(frozen=True)
class Clock:
    """Where times come from, and how sure they are: `uncertainty` s, one standard deviation of a single time stamp.

    The times of a second recorder were made those of the first by `first = second + offset + drift (second - centre)`:
    `offset` in s, `drift` in s per s, with a standard error each; `centre`, s on the second clock, is where the two
    errors are independent of each other.
    """

    quantities: tuple[str, ...]  # those that this clock has stamped
    source: str
    uncertainty: float
    offset: float = 0.0
    drift: float = 0.0
    offset_error: float = 0.0
    drift_error: float = 0.0
    centre: float = 0.0


@dataclass(frozen=True)
class Log:
    """One axis over time. All arrays are float64, one-dimensional, of one length, and finite.

    The command is held from its sample to the next (zero-order hold). `sample_period` is the mean step; the times
    themselves are used where they are not exactly regular. A spindle's position is its speed, rev/min; so is that of a
    log in which no position was logged (mm/s or rev/min): `is_rate`.

    InputError for arrays of different lengths, that are not finite, or a time that does not increase.
    """

    name: str
    time: np.ndarray  # s
    command: np.ndarray  # V (or what `units` says)
    position: np.ndarray  # mm, deg, rev/min or mm/s, as `units` says
    extra: Mapping[str, np.ndarray] = field(default_factory=dict)  # velocity, current, reference, where logged
    units: Mapping[str, str] = field(default_factory=dict)  # of each quantity
    resolution: float | None = None  # mm, one step of the encoder: stated, or found in the data
    voltage_range: tuple[float, float] | None = None  # V, of the converter, where known
    closed_loop: bool | None = None  # None: not known
    force_gain: float | None = None  # N or Nm (`units["force"]`) that one unit of the command makes
    source: str = ""  # the file that it was read from
    sha256: str = ""  # of that file
    findings: tuple[Finding, ...] = ()
    first: int = 0  # the row of its source at which it begins
    clocks: tuple[Clock, ...] = ()  # of the time stamps: their source and uncertainty

    def __post_init__(self) -> None:
        arrays = {"time": self.time, "command": self.command, "position": self.position, **self.extra}
        for key, values in arrays.items():
            if values.ndim != 1 or len(values) != len(self.time):
                raise InputError(f"{key} has shape {values.shape}; time has {len(self.time)} samples", self.name)
            if not np.isfinite(values).all():
                row = int(np.flatnonzero(~np.isfinite(values))[0])
                raise InputError(f"{key} holds {values[row]} at sample {row}; remove or repair it", self.name)
        if len(self.time) < 2 or not (np.diff(self.time) > 0.0).all():
            raise InputError("a log needs two samples or more, at times that increase", self.name)

    @classmethod
    def of(cls, data: Any, units: Mapping[str, str], closed_loop: bool | None = None) -> Log:
        """The log of a data object as nonlinear_benchmarks has them: arrays `u` and `y`, `sampling_time` in s, `name`.

        `units` say what no such object does: those of "command" and "position", as in {"command": "V", "position":
        "mm"}; a speed has one of `RATES`. InputError where one is missing, or for data of several inputs or outputs.
        """
        if missing := [each for each in ("u", "y", "sampling_time") if not hasattr(data, each)]:
            raise InputError(f"{data!r:.60} has no {missing[0]}; data have u, y and sampling_time")
        both = 'give both, as in {"command": "V", "position": "mm"}'
        if missing := [each for each in ("command", "position") if each not in units]:
            raise InputError(f"units has no {missing[0]!r}; {both}")
        if strange := [each for each in units if each not in ("command", "position")]:
            raise InputError(f"units has {strange[0]!r}, which the data have not; {both}")
        try:
            u, y = (np.squeeze(np.asarray(values, dtype=float)) for values in (data.u, data.y))
        except (ValueError, TypeError) as error:
            raise InputError(f"u and y must be arrays of numbers: {error}") from error
        if u.ndim != 1 or y.ndim != 1:
            raise InputError(f"u has shape {np.shape(data.u)} and y {np.shape(data.y)}; a log has one of each")
        step = Quantity("sampling time", "s", above=0.0).check(data.sampling_time, "sampling_time")
        name = str(getattr(data, "name", None) or "data")
        return cls(name, np.arange(len(u)) * step, u, y, units=dict(units), closed_loop=closed_loop)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        of = {"command": "V", "position": "mm"} | dict.fromkeys(self.extra, "") | dict(self.units)
        units = [f"{name}{f' in {of[name]}' if of[name] else ''}" for name in ("command", "position", *self.extra)]
        seconds = float(self.time[-1] - self.time[0])
        return f"<Log {self.name}: {len(self)} samples in {seconds:.6g} s, {', '.join(units)}>"

    @property
    def sample_period(self) -> float:
        """The mean step of the time, s."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def is_rate(self) -> bool:
        """Whether the position is a speed."""
        return self.units.get("position") in RATES

    @cached_property
    def known(self) -> dict[str, Any]:
        """What was worked out of this log and takes long, by who works it out."""
        return {}

    def part(self, first: int, end: int) -> Log:
        """The samples from `first` to before `end`; its times stay what they are."""
        chosen = slice(first, end)
        return replace(
            self,
            first=self.first + chosen.indices(len(self))[0],
            time=self.time[chosen],
            command=self.command[chosen],
            position=self.position[chosen],
            extra={key: values[chosen] for key, values in self.extra.items()},
        )


def irregular_at(log: Log) -> tuple[int, float] | None:
    """The first sample whose time is more than a tenth of a sample period off a regular grid, and by how many periods;
    None of a regular log.
    """
    T = log.sample_period
    off = np.abs(log.time - log.time[0] - T * np.arange(len(log))) / T
    if off.max() <= _JITTER:
        return None
    at = int(np.argmax(off > _JITTER))
    return at, float(off[at])


def check_regular(log: Log, what: str) -> None:
    """InputError where the times are irregular (`irregular_at`), and `what` needs a regular grid."""
    if (found := irregular_at(log)) is not None:
        at, off = found
        raise InputError(
            f"at sample {at}, t = {log.time[at]:g} s is {off:.2g} sample periods off a regular grid, which {what} "
            "needs; take --method simulation, which uses times as they are, or resample the log",
            log.source or log.name,
        )


def excited_part(log: Log, most: int) -> Log:
    """At most so many samples of a log, from where its command first changes: before that, many a log is at rest."""
    changes = np.flatnonzero(np.diff(log.command))
    first = min(int(changes[0]) if len(changes) else 0, max(len(log) - most, 0))
    return log.part(first, first + most)


def apart(names: Sequence[str]) -> list[str]:
    """The names, numbered where they repeat, so that no two are the same: `log (1)`, `log (2)`."""
    found: list[str] = []
    for name in names:
        own, number = name, 0
        while own in found or (own in names if number else names.count(name) > 1):
            number += 1
            own = f"{name} ({number})"
        found.append(own)
    return found


def named_apart(logs: Sequence[Log]) -> list[Log]:
    """The logs by names of their own: whatever is said of several logs is said by name."""
    names = apart([log.name for log in logs])
    return [replace(log, name=name) if log.name != name else log for log, name in zip(logs, names, strict=True)]


def only_log(given: Any) -> Log:
    """The log that was given, alone or as the one of a list. InputError for several, and for what is none."""
    logs = as_logs(given)
    if len(logs) != 1:
        raise InputError(f"{len(logs)} logs are given, and one is wanted")
    return logs[0]


def as_logs(given: Any) -> list[Log]:
    """One log or several as a list. InputError for what is none, such as a file that was not read."""
    logs = list(given) if isinstance(given, Iterable) and not isinstance(given, Log | str | Path) else [given]
    if (other := next((log for log in logs if not isinstance(log, Log)), None)) is not None:
        if hasattr(given, "columns"):  # a result or a table of pandas, which goes through the names of its columns
            other = given
        data = "rds.Log.of(data, units=...) makes one of u and y"
        said = data if hasattr(other, "u") and hasattr(other, "y") else "rds.read_log(FILE) gives those of a file"
        raise InputError(f"{other!r:.60} is no log; {said}")
    return logs
