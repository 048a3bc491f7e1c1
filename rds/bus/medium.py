"""The medium: which of the waiting frames goes over the bus next, and when.

The hub owns sockets and knows nothing of this; the medium knows nothing of sockets. A medium with bit timing,
arbitration and faults is another class with the same three methods.
"""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

Node = TypeVar("Node")


class UntimedMedium(Generic[Node]):
    """First come, first served, at once."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Node, bytes]] = deque()

    def offer(self, node: Node, frame: bytes) -> None:
        """`node` wants to send `frame` (a wire record)."""
        self._waiting.append((node, frame))

    def take(self, now: int) -> tuple[Node, bytes] | None:
        """The frame whose transmission is complete at `now` (ns, monotonic) with its sender, or None.

        Frames come out in the bus's one order; the hub stamps each when it takes it.
        """
        return self._waiting.popleft() if self._waiting else None

    def due(self) -> int | None:
        """When (ns, monotonic) the next frame can be taken; None if none waits."""
        return 0 if self._waiting else None
