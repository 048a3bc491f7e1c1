"""The links of one axis in a run: measurements on their way to the law, voltages on their way to the actuator.

Times are in samples since the run began. A message that arrives within a billionth of a sample after an instant counts
as there at the instant, so that delays of whole samples are whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf

from rds.core.types import Measured
from rds.network.delays import LinkModel

ROUNDING = 1e-9  # samples
Message = tuple[float, int, float]  # when it arrives, when it was sent (samples), its value


_NONE: list[Message] = []
Sensed = Callable[[int, float], tuple[Measured, float]]
Sent = Callable[[int, float, float], float]
Arrived = Callable[[float], list[Message]]


def sensor_link(model: LinkModel, draws: Iterator[float], buffer: int, event: bool) -> Sensed:
    """`sensed(k, y)`: what the law gets at sample `k` with its age, and how far into the period the law runs, samples.

    `draws` are the delays in samples (infinite: lost). Clocked, the law runs at the sampling instant on the newest
    measurement that is there. With `event` it runs when the measurement of this sample arrives, and after a period's
    wait on the newest that is there. Before the first one has come the law has the first.
    """
    draw = draws.__next__
    is_taken, is_kept, last_arrival = model.order == "take", model.order == "keep", -inf
    pending: list[Message] = []
    held, held_at = 0.0, -1
    reach = 1.0 if event else 0.0

    def sensed(k: int, y: float) -> tuple[Measured, float]:
        nonlocal held, held_at, last_arrival
        d = draw()
        if held_at < 0:
            held, held_at = y, k
        if d < buffer:
            d = float(buffer)
        if d == inf:
            if not pending:
                y = Measured(held)
                y.age = k - held_at
                return y, reach
        else:
            if is_kept:
                d = last_arrival = max(k + d, last_arrival)
                d -= k
            if d <= reach + ROUNDING and not is_taken:  # newer than any other
                held, held_at = y, k
                if pending:
                    pending.clear()
                y = Measured(y)
                y.age = 0
                return y, d if d < reach else reach
            pending.append((k + d, k, y))
        limit = k + reach + ROUNDING
        first = pending[0][0]
        if len(pending) <= 2 and pending[-1][0] > limit:  # the most frequent cases by far: the last one, or none
            if first <= limit:
                _, at, value = pending.pop(0)
                if is_taken or at > held_at:
                    held, held_at = value, at
            y = Measured(held)
            y.age = k - held_at
            return y, reach
        arrived = [message for message in pending if message[0] <= limit]
        if arrived:
            pending[:] = [message for message in pending if message[0] > limit]
            _, at, value = max(arrived) if is_taken else max(arrived, key=_sent)
            if is_taken or at > held_at:
                held, held_at = value, at
        y = Measured(held)
        y.age = k - held_at
        return y, min(d, reach) if held_at == k else reach

    return sensed


def actuator_link(model: LinkModel, draws: Iterator[float], buffer: int) -> tuple[Sent, Arrived]:
    """`sent(k, at, u)`: a voltage leaves the controller at time `at`; returns its arrival (infinite: never), samples.

    And `arrived(until)`: the messages that act up to then and have not been handed out yet, in order.
    """
    draw = draws.__next__
    is_taken, is_kept, last_arrival, acting_at = model.order == "take", model.order == "keep", -inf, -1
    pending: list[Message] = []

    def sent(k: int, at: float, u: float) -> float:
        nonlocal last_arrival
        arrival = at + draw()
        if arrival < inf:
            if arrival < k + buffer:
                arrival = k + buffer
            if is_kept:
                arrival = last_arrival = max(arrival, last_arrival)
            pending.append((arrival, k, u))
        return arrival

    def arrived(until: float) -> list[Message]:
        nonlocal acting_at
        if not pending:
            return pending
        until += ROUNDING
        if len(pending) == 1:  # the most frequent case by far
            message = pending[0]
            if message[0] > until:
                return _NONE
            pending.clear()
            if message[1] < acting_at and not is_taken:
                return _NONE
            acting_at = message[1]
            return [message]
        messages = sorted([message for message in pending if message[0] <= until])
        if not messages:
            return messages
        pending[:] = [message for message in pending if message[0] > until]
        if is_taken:
            return messages
        kept = []
        for message in messages:
            if message[1] > acting_at:
                acting_at = message[1]
                kept.append(message)
        return kept

    return sent, arrived


def _sent(message: Message) -> int:
    return message[1]
