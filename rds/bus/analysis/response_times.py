"""Worst-case response times on CAN, by the revised schedulability analysis.

Source: R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN) schedulability analysis:
Refuted, revisited and revised", Real-Time Systems 35 (2007) 239-272. For message m with transmission time C, period T,
release jitter J, lp and hp the messages of lower and higher priority, τ one bit time:

    B = max of C over lp(m)                                                      blocking
    t = E(t) + B + Σ over hp(m) and m of ⌈(t + J_k) / T_k⌉ C_k                    the level-m busy period
    Q = ⌈(t + J) / T⌉                                                            its instances of m
    w(q) = E(w + C) + B + q C + Σ over hp(m) of ⌈(w + J_k + τ) / T_k⌉ C_k         queueing of instance q
    R = max over q of J + w(q) - q T + C

The analysis of 1994 looked at q = 0 only, which is too good: a later instance can wait longer. C includes the
interframe space, so R is three bits more than the arrival at the receivers. Times are whole ns, rounded up (periods
down), so the bound never gets too short. A message's instances are sent in the order of their periods, also where the
jitter is longer than the period.

A message that another one releases (`Message.after`) inherits that one's response as jitter: it is released at the
earliest when the other's shortest frame can have arrived, at the latest after its worst response and its own delay.
Its response counts from where the other's does, from the beginning of the cycle (holistic analysis: K. Tindell,
J. Clark, Microprocessing and Microprogramming 40 (1994) 117-134). Where one message releases others, one after another
or all at once, and the whole cycle surely ends before the next begins, cycles can't meet, and the simple sum bounds it
more closely; then the lesser of both holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isfinite
from typing import NamedTuple

from rds.bus.analysis.messages import Message
from rds.bus.analysis.schedule import occupied
from rds.bus.medium.bits import LONGEST_ERROR
from rds.core.errors import InputError

NS = 1_000_000_000
_INSTANCES = 1000  # of a message in one busy period; beyond it, its bound is of no use
_ROUNDS = 100  # of passing responses on as jitter


@dataclass(frozen=True)
class Errors:
    """Errors to reckon with: `burst` at once, and a further one every `interval` s.

    Each costs the longest error frame, 31 bits, and the longest frame that is then sent again (Tindell and Burns;
    section 3.6 of the paper).
    """

    burst: int = 1
    interval: float = inf

    def __post_init__(self) -> None:
        if self.burst % 1 or self.burst < 1 or not self.interval >= 1e-9:
            raise InputError(
                f"{self.burst!r} errors every {self.interval!r} s; burst is a whole number of 1 or more, and the "
                "interval at least 1e-9 s"
            )

    def within(self, time: int) -> int:
        """How many errors `time` ns can see."""
        return int(self.burst) + (
            _ceil(time, _ns(self.interval, down=True)) - 1 if isfinite(self.interval) and time > 0 else 0
        )


class Task(NamedTuple):
    """What the analysis knows of a message; in ns, or any one unit."""

    transmission: int
    period: int
    jitter: int = 0


class Response(NamedTuple):
    """The worst case of one message; ns. `time` is None if it is unbounded, `reason` says why."""

    time: int | None
    blocking: int = 0
    instance: int = 0  # which one of a busy period responds latest
    instances: int = 0  # of the message in the busy period
    reason: str = ""


def responses(
    messages: Sequence[Message], bitrate: int, data_bitrate: int | None = None, errors: Errors | None = None
) -> list[Response]:
    """The worst response of each message, in the messages' order, which must be that of `messages.in_order`."""
    names = {message.name: number for number, message in enumerate(messages)}
    before = [None if message.after is None else names[message.after] for message in messages]
    transmission = [occupied(message.most(), bitrate, data_bitrate) for message in messages]
    tau = -(-NS // bitrate)
    own = [_ns(message.jitter) for message in messages]
    earliest = _earliest(messages, before, bitrate, data_bitrate)
    jitter = own[:]
    results: list[Response] = []
    for _ in range(_ROUNDS):
        tasks = [
            Task(time, _ns(message.period, down=True), late)
            for message, time, late in zip(messages, transmission, jitter, strict=True)
        ]
        found = [worst_response(tasks, number, tau, errors) for number in range(len(tasks))]
        results = [
            result if result.time is None else result._replace(time=result.time + early)
            for result, early in zip(found, earliest, strict=True)
        ]
        jitter = []
        for number, late in enumerate(own):
            time = None if (other := before[number]) is None else results[other].time
            jitter.append(late if time is None else late + time - earliest[number])
        if all(task.jitter == late for task, late in zip(tasks, jitter, strict=True)):
            break
        if any(late > _INSTANCES * task.period for task, late in zip(tasks, jitter, strict=True)):
            results = [_diverged(result) for result in results]
            break
    else:
        results = [_diverged(result) for result in results]
    results = [_inherited(number, results, before, messages) for number in range(len(messages))]
    return _single_cycle(messages, before, own, transmission, tau, errors, results)


def worst_response(tasks: Sequence[Task], number: int, tau: int = 1, errors: Errors | None = None) -> Response:
    """Worst response of task `number`; `tasks` from the highest priority to the lowest.

    This is the analysis itself, without any notion of frames. With errors the unit of time must be ns; with times in
    another one, `tau` = 1 makes it that of a bus whose senders see each other's releases at once.
    """
    task, higher, known = tasks[number], tasks[:number], tasks[: number + 1]
    blocking = max((other.transmission for other in tasks[number + 1 :]), default=0)
    each = LONGEST_ERROR * tau + max(other.transmission for other in known)
    utilization = sum((Fraction(other.transmission, other.period) for other in known), Fraction(0))
    if errors and isfinite(errors.interval):
        utilization += Fraction(each, _ns(errors.interval, down=True))
    if utilization >= 1:
        what = "messages of its priority and higher" + (" and errors" if errors else "")
        return Response(None, blocking, reason=f"{what} ask for {float(100 * utilization):.4g} % of the bus")

    def cost(time: int) -> int:
        return errors.within(time) * each if errors else 0

    def demand(time: int) -> int:
        return cost(time) + blocking + sum(_ceil(time + k.jitter, k.period) * k.transmission for k in known)

    busy = _fixed_point(demand, task.transmission, _INSTANCES * task.period)
    if busy is None:
        reason = f"the bus can be busy for more than {_INSTANCES} of its periods"
        return Response(None, blocking, reason=reason)
    instances = _ceil(busy + task.jitter, task.period)
    worst, which, queued = 0, 0, 0
    for instance in range(instances):
        first = blocking + instance * task.transmission

        def queueing(time: int, first: int = first) -> int:
            hindered = sum(_ceil(time + k.jitter + tau, k.period) * k.transmission for k in higher)
            return cost(time + task.transmission) + first + hindered

        # an instance waits no shorter than the one before it did
        found = _fixed_point(queueing, max(queued, first), None)
        assert found is not None
        queued = found
        response = task.jitter + queued - instance * task.period + task.transmission
        if response > worst:
            worst, which = response, instance
    return Response(worst, blocking, which, instances)


def _fixed_point(step: Callable[[int], int], value: int, limit: int | None) -> int | None:
    """The least fixed point of the growing `step` from `value` on; None beyond `limit`."""
    while (following := step(value)) > value:
        if limit is not None and following > limit:
            return None
        value = following
    return value


def _earliest(
    messages: Sequence[Message], before: Sequence[int | None], bitrate: int, data_bitrate: int | None
) -> list[int]:
    """When each message can be released at the earliest, ns from the beginning of its cycle."""
    earliest = []
    for number in range(len(messages)):
        time, at = 0, before[number]
        while at is not None:
            time += max(0, messages[at].least().time(bitrate, data_bitrate) - 1)  # it was rounded up
            at = before[at]
        earliest.append(time)
    return earliest


def _inherited(
    number: int, results: Sequence[Response], before: Sequence[int | None], messages: Sequence[Message]
) -> Response:
    """The result; unbounded if the message waits for one that is."""
    at = before[number]
    while at is not None:
        if results[at].time is None:
            return results[number]._replace(
                time=None, reason=f"it comes after {messages[at].name!r}, which is unbounded"
            )
        at = before[at]
    return results[number]


def _diverged(result: Response) -> Response:
    return result._replace(time=None, reason=result.reason or "messages that wait for each other delay each other on")


def _single_cycle(
    messages: Sequence[Message],
    before: Sequence[int | None],
    own: Sequence[int],
    transmission: Sequence[int],
    tau: int,
    errors: Errors | None,
    results: list[Response],
) -> list[Response]:
    """Closer bounds where one message releases a whole cycle of others, and all is over before it comes again.

    If a cycle finds the bus free, the first message starts at once. From then until a message has been sent, its path
    (those that released it, one after another, and itself) is either late by its own jitter, or waits while something
    is sent: something of higher priority than who waits, each once; or one of lower priority, which began while who
    waits was late. If that bounds all of a cycle by less than its period, the next one finds the bus free as well.
    Messages beside the cycle are reckoned with as if they all came first: those of three periods, for some can be left
    from the one before.
    """
    paths = [_path(number, before) for number in range(len(messages))]
    root = next((number for number in before if number is not None and before[number] is None), None)
    if root is None:
        return results
    cycle = [number for number, path in enumerate(paths) if path[0] == root]
    period = _ns(messages[root].period, down=True)
    if any(messages[number].period != messages[root].period for number in cycle):
        return results
    beside = [number for number in range(len(messages)) if number not in cycle]
    if any(before[number] is not None for number in beside):
        return results
    longest = LONGEST_ERROR * tau + max(transmission)
    start = own[root] + transmission[root] + (errors.within(period) * longest if errors else 0)
    for number in beside:
        often = _ceil(3 * period + own[number], _ns(messages[number].period, down=True))
        start += often * transmission[number]
    bounds = {root: (start, 0)}
    for number in cycle:
        if number != root:
            path = paths[number][1:]
            first = {other for other in cycle if other != root and other <= max(path)}
            blockers = [
                max((transmission[other] for other in cycle if other > waiting and other not in first), default=0)
                for waiting in path
                if own[waiting]  # who is never late is in the arbitration behind the message that released it
            ]
            late = sum(own[waiting] for waiting in path)
            bounds[number] = start + late + sum(blockers) + sum(transmission[other] for other in first), sum(blockers)
    if max(time for time, _ in bounds.values()) > period - tau:
        return results
    closer = list(results)
    for number, (time, blocking) in bounds.items():
        closer[number] = _lesser(results[number], time, blocking)
    return closer


def _path(number: int, before: Sequence[int | None]) -> list[int]:
    """The messages that release each other until `number` is released: from the first one to `number` itself."""
    path = [number]
    while (at := before[path[0]]) is not None:
        path.insert(0, at)
    return path


def _lesser(result: Response, time: int, blocking: int) -> Response:
    if result.time is not None and result.time <= time:
        return result
    return Response(time, blocking, 0, 1)


def _ns(seconds: float, down: bool = False) -> int:
    exact = Fraction(seconds) * NS
    nearest = round(exact)
    if abs(exact - nearest) < Fraction(1, 1000):  # what was meant as whole ns is not exactly so in binary
        return nearest
    return exact.__floor__() if down else exact.__ceil__()


def _ceil(value: int, by: int) -> int:
    return -(-value // by)
