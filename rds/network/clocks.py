"""Clocks of nodes, synchronized by messages: offset and drift estimated by regression, and what they do to a contour.

The host asks a node for its time; the answer belongs to the middle of sending and receiving, wrong by half of the
round trip at most. Over many answers a line is fitted, with weights that decay exponentially, as Klipper's host does
for its microcontrollers (`klippy/clocksync.py`, decay 1/30); answers whose round trip is much longer than the shortest
are left out, as delay in one direction alone shifts the middle. The line gives the node's time at any instant of the
host, and its spread the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from rds.core.shared_quantities import CLOCK_DRIFT

DECAY = 1.0 / 30.0
_SLOW = 1.5  # times the shortest round trip: what is left out
_FORGET = 1.01  # by which the shortest round trip grows with each answer, so that a network may get slower


@dataclass
class ClockEstimate:
    """A node's clock as the host knows it: `at(t)` is its time (s) when the host's clock shows `t` (s)."""

    host: float = 0.0  # s: weighted means of both clocks
    node: float = 0.0
    rate: float = 1.0  # seconds of the node in a second of the host
    answers: int = 0
    left_out: int = 0
    _spread: float = 0.0  # s²: weighted variance of the host's times
    _both: float = 0.0
    _error: float = 0.0  # s²: of predictions
    _shortest: float = inf

    def take(self, sent: float, node: float, received: float) -> bool:
        """One answer: the host's times of sending and receiving, and the node's time, s. False if it was left out."""
        trip = received - sent
        self._shortest = min(self._shortest * _FORGET, trip)
        if trip > _SLOW * self._shortest:
            self.left_out += 1
            return False
        middle = 0.5 * (sent + received)
        self.answers += 1
        if self.answers == 1:
            self.host, self.node = middle, node
            return True
        if self.answers > 2:
            self._error = (1.0 - DECAY) * (self._error + DECAY * (node - self.at(middle)) ** 2)
        share = max(DECAY, 1.0 / self.answers)
        ahead, apart = middle - self.host, node - self.node
        self.host += share * ahead
        self.node += share * apart
        self._spread = (1.0 - share) * (self._spread + share * ahead * ahead)
        self._both = (1.0 - share) * (self._both + share * ahead * apart)
        self.rate = self._both / self._spread
        return True

    def at(self, host: float) -> float:
        """The node's time (s) at an instant of the host's clock (s)."""
        return self.node + self.rate * (host - self.host)

    @property
    def drift(self) -> float:
        """How much faster the node's clock runs, ppm."""
        return (self.rate - 1.0) * 1e6

    @property
    def error(self) -> float:
        """Standard deviation of what the line predicts of a next answer, s; half a round trip may come on top."""
        return sqrt(self._error)


def synchronized(drift: float, offset: float, delays: np.ndarray, period: float) -> tuple[ClockEstimate, np.ndarray]:
    """The estimate after answers every `period` s, and its error (s) after each.

    The clock has a `drift` (ppm) and an `offset` (s); `delays` (answers × 2, s) are those to the node and back.
    """
    CLOCK_DRIFT.check(drift, "drift", "clock")
    estimate, errors = ClockEstimate(), np.empty(len(delays))
    for i, (there, back) in enumerate(delays):
        sent = i * period
        at_node = sent + float(there)
        estimate.take(sent, offset + at_node * (1.0 + drift * 1e-6), at_node + float(back))
        now = at_node + float(back)
        errors[i] = estimate.at(now) - (offset + now * (1.0 + drift * 1e-6))
    return estimate, errors


def circle_error(radius: float, feed: float, apart: np.ndarray) -> np.ndarray:
    """Contour error (mm) of a circle whose second axis is `apart` (s) ahead of the first, at each instant in turn.

    x = R cos(v t/R), y = R sin(v (t + apart)/R) with R = `radius` in mm and v = `feed` in mm/s, one turn over the
    instants: what clocks that run apart do to a contour that the nodes play from their buffers. For small angles the
    largest is v·apart/2.
    """
    angle = 2.0 * np.pi * np.arange(len(apart)) / len(apart)
    x, y = radius * np.cos(angle), radius * np.sin(angle + feed * apart / radius)
    error: np.ndarray = np.hypot(x, y) - radius
    return error
