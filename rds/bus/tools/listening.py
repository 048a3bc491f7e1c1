"""Listening to a bus for a while, by somebody who may be held up: what came meanwhile counts as heard."""

from __future__ import annotations

import time
from collections.abc import Iterator

import can

_SLICE = 0.02  # s: a wait that took longer was held up, by this computer, and counts as so long only
_DUST = 1e-6  # s: less than this may be lost in a clock's rounding, and never pass
_MOST_WAITING = 20_000  # frames that may wait at the end: 2 s of a bus that is full at 1 Mbit/s
_LONGEST_REST = 0.5  # s to take them: a busy computer takes them more slowly than one who babbles sends them


def frames_within(bus: can.BusABC, seconds: float) -> Iterator[can.Message]:
    """The frames of the next `seconds` of listening, and those that wait already when these are over.

    Time in which this process, or the whole computer, stood still is no time in which others were silent. On a busy
    computer it takes longer than `seconds`, therefore. Raises what `bus.recv` raises.
    """
    left, before = seconds, time.monotonic()
    while left > _DUST:
        message = bus.recv(min(left, _SLICE))
        if message is not None:
            yield message
        now = time.monotonic()
        left -= min(now - before, _SLICE)
        before = now
    left = _LONGEST_REST
    for _ in range(_MOST_WAITING):
        message = bus.recv(0.0)
        if message is None or left <= 0.0:
            return
        yield message
        now = time.monotonic()
        left -= min(now - before, _SLICE)
        before = now


def pause(seconds: float) -> None:
    """Wait while another thread listens: as with `frames_within`, time in which this process stood still is none."""
    left, before = seconds, time.monotonic()
    while left > _DUST:
        time.sleep(min(left, _SLICE))
        now = time.monotonic()
        left -= min(now - before, _SLICE)
        before = now
