"""A delay as a run draws it and as an analysis takes it: a named distribution, or the recorded trace of a network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np

from rds.core.errors import InputError
from rds.network.distributions import DISTRIBUTIONS, checked_params

_CHUNK = 4096  # delays that are drawn at once: a run's delays depend on its seed alone, not on its length


@dataclass(frozen=True)
class Delay:
    """A random delay in s: `kind` names a distribution with `params`, or is "trace", with the recorded `trace` (s).

    In a trace NaN stands for a message that was lost; the trace repeats after its end.
    """

    kind: str = "constant"
    params: Mapping[str, float] = field(default_factory=lambda: {"delay": 0.0})
    trace: tuple[float, ...] = ()

    @classmethod
    def named(cls, kind: str, **params: float) -> Delay:
        """A distribution by its name (`rds.network.distributions`); InputError for a name or value that will not do."""
        if kind not in DISTRIBUTIONS:
            raise InputError(f"delay {kind!r} is unknown; known: {', '.join(DISTRIBUTIONS)}")
        if unknown := set(params) - set(DISTRIBUTIONS[kind].parameters):
            raise InputError(f"delay {kind!r} has no {', '.join(sorted(unknown))}")
        return cls(kind, checked_params(kind, params))

    @classmethod
    def recorded(cls, values: np.ndarray) -> Delay:
        """The delays of a trace, s, in order; NaN where a message was lost."""
        return cls("trace", {}, tuple(float(value) for value in values))

    @property
    def is_none(self) -> bool:
        """Whether nothing is ever delayed."""
        return self.kind == "constant" and self.params["delay"] == 0.0

    def drawn(self, rng: np.random.Generator, first: int, count: int) -> np.ndarray:
        """The delays (s) of `count` messages from number `first` on; infinite where a trace lost one."""
        if self.kind == "trace":
            values = np.asarray(self.trace)[(first + np.arange(count)) % len(self.trace)]
            return np.where(np.isnan(values), np.inf, values)
        if self.kind == "constant":
            return np.full(count, self.params["delay"])
        return DISTRIBUTIONS[self.kind].quantiles(rng.random(count), self.params)

    def histogram(self, bins: int = 50) -> tuple[np.ndarray, np.ndarray]:
        """Delays (s) and their probabilities, for analysis: what arrived of a trace, or equally likely parts.

        A part of a distribution stands at the quantile of its middle; a bin of a trace at the mean of its delays, so
        that the trace's own mean is kept. InputError for a trace in which every message was lost.
        """
        if self.kind == "constant":
            return np.array([self.params["delay"]]), np.ones(1)
        if self.kind != "trace":
            middles = (np.arange(bins) + 0.5) / bins
            return DISTRIBUTIONS[self.kind].quantiles(middles, self.params), np.full(bins, 1.0 / bins)
        values = np.asarray(self.trace)
        values = np.sort(values[np.isfinite(values)])
        if not len(values):
            raise InputError("every message of the trace was lost; there is no delay to analyse")
        parts = [part for part in np.array_split(values, min(bins, len(values))) if len(part)]
        return np.array([part.mean() for part in parts]), np.array([len(part) / len(values) for part in parts])

    @property
    def lost_share(self) -> float:
        """The share of a trace's messages that were lost; 0 of a distribution."""
        return float(np.isnan(self.trace).mean()) if self.kind == "trace" else 0.0


@dataclass(frozen=True)
class LinkModel:
    """What becomes of messages in one direction: their delay, loss, and order of arrival.

    `loss` is the share that is lost: one message independently of another, or, with `loss_burst`, in bursts of so many
    messages in the mean (Gilbert's model). `order` says what a message that another one overtook
    does: it is dropped ("drop"), acts all the same ("take"), or cannot be overtaken and others wait for it ("keep").
    """

    delay: Delay = field(default_factory=Delay)
    loss: float = 0.0
    loss_burst: float | None = None
    order: str = "drop"

    def draws(self, rng: np.random.Generator, T: float) -> Iterator[float]:
        """Without end, the delays of one message after another in samples of `T` s; infinite for a lost one."""
        first, is_bad = 0, False
        while True:
            delays = self.delay.drawn(rng, first, _CHUNK) / T
            if self.loss_burst is not None and self.loss > 0.0:
                lost, is_bad = self._bursts(rng.random(_CHUNK), is_bad)
                delays[lost] = np.inf
            elif self.loss > 0.0:
                delays[rng.random(_CHUNK) < self.loss] = np.inf
            first += _CHUNK
            yield from delays.tolist()

    def _bursts(self, numbers: np.ndarray, is_bad: bool) -> tuple[np.ndarray, bool]:
        assert self.loss_burst is not None
        leave = 1.0 / self.loss_burst
        enter = self.loss * leave / (1.0 - self.loss)
        lost = np.empty(len(numbers), dtype=bool)
        for i, number in enumerate(numbers):
            is_bad = number >= leave if is_bad else number < enter
            lost[i] = is_bad
        return lost, is_bad


@dataclass(frozen=True)
class Network:
    """The network of a run: both directions, the time that the controller computes, buffers (samples), and the seed.

    `event` says that the law runs when its measurement arrives instead of at the sampling instants.
    """

    sensor: LinkModel = field(default_factory=LinkModel)
    computing: Delay = field(default_factory=Delay)
    actuator: LinkModel = field(default_factory=LinkModel)
    seed: int = 0
    event: bool = False
    actuator_buffer: int = 0
    controller_buffer: int = 0

    def computing_draws(self, rng: np.random.Generator, T: float) -> Iterator[float]:
        """Without end, the times to compute in samples of `T` s."""
        return repeat(0.0) if self.computing.is_none else LinkModel(self.computing).draws(rng, T)

    def streams(self, axis: str) -> list[np.random.Generator]:
        """The random numbers of one axis's sensor, computing and actuator: they depend on the seed and the axis."""
        sequence = np.random.SeedSequence([self.seed, *axis.encode()])
        return [np.random.default_rng(part) for part in sequence.spawn(3)]
