"""What happens on a bus, exactly: fixed priorities, and a frame in flight is not interrupted.

A reference to predict a cycle with, and to test the analysis and the timed bus against. Times are whole numbers of
any one unit (ns throughout this package); messages are numbers, 0 the highest priority.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from heapq import heapify, heappop, heappush
from typing import NamedTuple

from rds.bus.analysis.messages import Message
from rds.bus.medium.bits import Bits

Release = tuple[int, int]  # time, message


class Slot(NamedTuple):
    """One frame's stay on the bus."""

    message: int
    released: int
    start: int
    end: int  # the bus is free again: with the interframe space


def _nothing(slot: Slot) -> Iterable[Release]:
    return ()


def schedule(
    releases: Iterable[Release],
    duration: Callable[[int], int],
    follow: Callable[[Slot], Iterable[Release]] = _nothing,
) -> list[Slot]:
    """The frames in the order in which they go over the bus.

    Whenever the bus is free, the highest priority among the messages released by then goes; frames of one message go
    in the order of their releases. `duration(message)` is asked once for each frame; `follow(slot)` gives the releases
    that a frame causes, none earlier than the frame's start.
    """
    coming = list(releases)
    heapify(coming)
    waiting: list[tuple[int, int]] = []  # message, release
    slots = []
    now = 0
    while coming or waiting:
        if not waiting:
            now = max(now, coming[0][0])
        while coming and coming[0][0] <= now:
            at, message = heappop(coming)
            heappush(waiting, (message, at))
        message, at = heappop(waiting)
        slot = Slot(message, at, now, now + duration(message))
        slots.append(slot)
        now = slot.end
        for release in follow(slot):
            heappush(coming, release)
    return slots


def one_cycle(messages: Sequence[Message], bitrate: int, data_bitrate: int | None = None) -> list[Slot]:
    """One release of each message at 0 ns, with the exact bits of its data; those with `after`, at that one's arrival.

    `messages` in the order of `messages.in_order`; slots in ns. A frame has arrived when its end-of-frame field is
    over, three bits before the bus is free: whoever answers at once is in the next arbitration.
    """
    bits = [message.exact() for message in messages]
    names = {message.name: number for number, message in enumerate(messages)}
    followers: dict[int, list[int]] = {}
    for number, message in enumerate(messages):
        if message.after is not None:
            followers.setdefault(names[message.after], []).append(number)

    def follow(slot: Slot) -> Iterable[Release]:
        arrived = slot.start + bits[slot.message].time(bitrate, data_bitrate)
        return [(arrived, number) for number in followers.get(slot.message, ())]

    releases = [(0, number) for number, message in enumerate(messages) if message.after is None]
    return schedule(releases, lambda number: occupied(bits[number], bitrate, data_bitrate), follow)


def occupied(bits: Bits, bitrate: int, data_bitrate: int | None = None) -> int:
    """How long a frame keeps the bus from others: with interframe space, ns."""
    return bits.time(bitrate, data_bitrate, interframe=True)
