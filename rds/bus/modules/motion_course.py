"""How a motion went that nodes carried out by one of the methods A, B and C."""

from __future__ import annotations

from dataclasses import dataclass, field

LATE = 1e-3  # s by which a frame is late


@dataclass
class MotionCourse:
    """How a motion went: instants in s, by the clock of the host's port."""

    begun: float
    ended: float
    steps: int
    late: int = 0  # frames of method A that the host sent more than 1 ms late
    missing: int = 0  # answers that did not come
    retries: int = 0  # what was asked for, or sent, again
    pauses: float = 0.0  # s that the motion rested while buffers were filled
    instants: list[float] = field(default_factory=list)  # when each step was made, where the host keeps the steps
