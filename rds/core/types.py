"""The vocabulary: the values that models, controllers, interpolators and modes exchange.

Units throughout: s, mm, mm/s, mm/s², V; degrees for a rotary axis, rev/min for a spindle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

from rds.core.quantities import Quantity, listed

SPINDLE_UNIT = "rev/min"  # of an axis whose speed is what is measured and commanded


class Reference(NamedTuple):
    """What the axis should do at one sample; arrays in axis order for a controller of several axes."""

    position: float  # mm (degrees; for a spindle the speed, rev/min)
    velocity: float  # mm/s
    acceleration: float  # mm/s²


class Measured(float):
    """A measured position that came over a network: a number with its `age`, whole samples, at the sample of the law.

    `age` is 0 for the measurement of this sample; it grows by one with each sample in which nothing newer came. A law
    that wants to know asks `getattr(y, "age", 0)`: without a network a measurement is a plain float.
    """

    __slots__ = ("age",)
    age: int


@dataclass(frozen=True, slots=True)
class LineSegment:
    """A straight move. `start` and `end` hold one position per axis, mm; `feed_rate` is in mm/s."""

    start: tuple[float, ...]
    end: tuple[float, ...]
    feed_rate: float


@dataclass(frozen=True, slots=True)
class ArcSegment:
    """A circular or helical move about `centre`, in the plane of the axes `plane` (by index).

    `start`, `end` and `centre` hold one position per axis, mm; `feed_rate` is in mm/s along the path.
    `clockwise` is seen from the positive end of the axis normal to the plane. An `end` equal to
    `start` is a full circle.
    """

    start: tuple[float, ...]
    end: tuple[float, ...]
    centre: tuple[float, ...]
    feed_rate: float
    clockwise: bool = False
    plane: tuple[int, int] = (0, 1)


Segment = LineSegment | ArcSegment


@dataclass(frozen=True)
class Source:
    """Where a student's or library function came from, so that a record can prove that it was the same."""

    name: str  # library name, function name or file name
    path: str | None = None  # absolute path of the file, if it came from one
    sha256: str | None = None  # of the file's bytes or of the function's source text
    text: str | None = None  # its source


@dataclass(frozen=True)
class Controller:
    """A control law with its parameters.

    `control(t, r, y, state, params) -> (voltage, next_state)`: time s, `Reference`, measured position,
    the state it returned last, its parameters; voltage in V. All its memory is in `state`.
    With `coupled`, one law drives all axes: reference, position and voltage are arrays in axis order.
    `tunable` are those of its parameters that may be changed while it runs, with what each means and its bounds, and
    `retune(values of all of them)` gives the parameters that follow from new values, or raises InputError. Without
    `retune`, any number in `params` may be changed and is handed to `control` as it is; with NOT_LIVE, none.
    One that is not `repeatable` answers differently when a run is gone through again, such as a person's loop.
    `conclude(axis, unit, its recorded signals by name, params)` gives a sentence for the notes of the run.
    `sample_period` is the one that its numbers were made for, s, where it says so: a run of another one tells it.
    """

    control: Callable[..., Any]
    initial_state: Any = ()
    params: Mapping[str, Any] = field(default_factory=dict)
    source: Source = Source("user-defined")
    coupled: bool = False
    tunable: Mapping[str, Quantity] = field(default_factory=dict)
    retune: Callable[[Mapping[str, float]], Mapping[str, Any]] | None = None
    signals: Mapping[str, str] = field(default_factory=dict)
    observe: Callable[..., Sequence[float]] | None = None
    repeatable: bool = True
    conclude: Callable[..., str] | None = None
    sample_period: float | None = None

    def __repr__(self) -> str:
        return _named(self)


@dataclass(frozen=True)
class Model:
    """An axis model: how the state answers a voltage that is constant over one sample.

    `advance(x, u, T, params) -> next x` with x the state (position mm, velocity mm/s, ...), u the voltage in V
    and T in s. `output(x) -> y` is what the encoder sees (default: the first state).
    `start(T)` gives the model in motion (see `contracts.Motion`); a model with a faster way of running
    hands in its own `motion`. `fitted` is the model file that the numbers came from, if they did.
    `has_velocity` says that the second state is the axis's velocity, and that its motion has it as `velocity`.
    `told` names other attributes of its motion, with their units, that are recorded where the model is the plant.
    The equations of a `timed` model know the time: its `advance` and `output` also take `t`, s since the run began, and
    `output` takes `params` (else they are of t = 0 and of the model's own parameters).
    """

    advance: Callable[..., Sequence[float]]
    initial_state: Sequence[float]
    params: Mapping[str, Any] = field(default_factory=dict)
    output: Callable[..., float] | None = None
    source: Source = Source("user-defined")
    motion: Callable[[Model, float], Any] | None = None
    fitted: Source | None = None
    has_velocity: bool = False
    told: Mapping[str, str] = field(default_factory=dict)
    timed: bool = False

    def __repr__(self) -> str:
        return _named(self)

    def moved(self, x: Sequence[float], u: float, T: float, params: Mapping[str, Any], t: float) -> Sequence[float]:
        """The state `T` s after the state `x` at the time `t`, s, under the voltage `u`."""
        return self.advance(x, u, T, params, t=t) if self.timed else self.advance(x, u, T, params)

    def seen(self, x: Sequence[float], params: Mapping[str, Any], t: float) -> float:
        """What the encoder sees of the state `x` at the time `t`, s."""
        if self.output is None:
            return x[0]
        return self.output(x, t=t, params=params) if self.timed else self.output(x)


NOT_LIVE: Callable[[Mapping[str, float]], Mapping[str, Any]] = dict
"""The `retune` of a law that follows from its parameters as a whole, before it runs: nothing in them is `tunable`."""


def _named(part: Controller | Model) -> str:
    said = listed(part.params)
    return f"<{type(part).__name__} {part.source.name}{': ' if said else ''}{said}>"


class Ending(StrEnum):
    """How a run came to its end."""

    DONE = "done"  # every sample was taken
    STOPPED = "stopped"  # asked to stop
    OVERLOADED = "overloaded"  # more late samples in a row than the late policy allows
    FOLLOWING_ERROR = "following error"  # an axis was further from its reference than [following_error] allows
    FAULT = "fault"  # the student's code broke its contract or raised
    MACHINE_LOST = "machine lost"  # a module stopped answering, or the bus failed
    ADAPTER_LOST = "adapter lost"  # the adapter between computer and bus was unplugged, or its line garbled
    KILLED = "killed"  # the target process ended without saying why


class Verdict(StrEnum):
    """Whether the sample period was kept; void when the system alone could not have kept it."""

    MET = "met"
    MISSED = "missed"
    VOID = "void"
