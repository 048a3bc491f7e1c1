"""Nodes that send frames with the same identifier at the same instant: arbitration does not decide between them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest
from typing import Generic, NamedTuple, TypeVar

from rds.bus.medium.bit_string import BitString
from rds.bus.medium.bits import Bits
from rds.bus.medium.error_flags import broken_frame

Node = TypeVar("Node")


class Collision(NamedTuple, Generic[Node]):
    """How it goes out."""

    senders: list[Node]  # those that were still sending at the end: of the same frame, or when it was destroyed
    dropped: list[Node]  # error-passive ones that dropped out before
    bits: Bits | None  # until the end of the error frame; None: the frame went through


def collide(strings: Mapping[Node, BitString], active: Mapping[Node, bool]) -> Collision[Node]:
    """What comes of frames (with their bits) that begin together; `active`: whether their sender is error active.

    As long as their bits are equal nobody notices; if they are to the end, it was one frame. Otherwise, at the first
    difference, those that send the recessive bit see a bit error. If one of these is error active, its flag destroys
    the frame for all; all send again, and collide again. Their error counters grow until the recessive ones are error
    passive: then these drop out without anybody seeing their flags, and a dominant one gets through.
    """
    senders = list(strings)
    dropped: list[Node] = []
    while len({strings[node].bits for node in senders}) > 1:
        columns = zip_longest(*(strings[node].bits for node in senders))
        bit = next(k for k, column in enumerate(columns) if len(set(column)) > 1)
        losers = [node for node in senders if strings[node].bits[bit] == "1"]
        noticing = [node for node in losers if active[node]]
        if noticing:
            string = strings[noticing[0]]
            seen = string.bits[:bit] + "0"
            return Collision(senders, dropped, broken_frame(string, seen, passive=False, answered=True))
        dropped += losers
        senders = [node for node in senders if node not in losers]
    return Collision(senders, dropped, None)
