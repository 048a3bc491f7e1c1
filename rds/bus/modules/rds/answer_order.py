"""Whether a module's answers follow one another: what the host makes of their tick counts.

A module counts the ticks that it hears and says the count in each answer, so the answers to new ticks count up from
one that the host has taken. Frames that are late, come twice or overtake each other tell of ticks before, and say
nothing new. Another module in its place, or the same after a restart, counts from somewhere else and goes on from
there: it is known by answers that follow each other, but none that the host has taken.
"""

from __future__ import annotations

from enum import Enum

from rds.bus.modules.rds.frames import COUNT_TURNS, Answer

DUPLICATES = 64  # ticks that a module may have heard more than were sent: frames that came twice
PERSISTENT = 10  # answers in a row from elsewhere, with none that follows between them: it is another module
SUSPECTED = 3  # so many, and then silence, are enough
_HALF_TURN = COUNT_TURNS // 2


class AnswerPosition(Enum):
    """Where an answer stands among those of its module."""

    LAST = "to the last tick"
    EARLIER = "to a tick before, or to the last one from a module that lost one"
    ASTRAY = "none that follows: it says nothing new, or is of another module"


class AnswerOrder:
    """The order of one module's answers, as the host sees it."""

    __slots__ = ("_highest", "_stray", "_strays", "behind", "expected", "owed", "seen", "since")

    def __init__(self) -> None:
        self.expected = 0  # tick count of the answer to the last tick
        self.owed = 0  # answers to earlier ticks that may still come
        self.since = 0  # ticks sent since the last answer that was taken
        self.seen = False  # it has answered at all
        self.behind = 0  # ticks that the last answer taken was behind the last one sent: lost, or on their way
        self._highest = 0  # tick count of the newest answer
        self._strays = 0  # answers astray in a row
        self._stray = 0  # tick count of the last of them

    def tick(self) -> None:
        """A tick is sent."""
        self.expected = (self.expected + 1) % COUNT_TURNS
        self.since += 1

    def ahead(self, answer: Answer) -> int:
        """Ticks that the answer counts more than were sent."""
        return (answer.ticks - self.expected + _HALF_TURN) % COUNT_TURNS - _HALF_TURN

    def place(self, answer: Answer) -> AnswerPosition:
        """Where the answer stands; it is remembered."""
        if not self.seen:
            return AnswerPosition.LAST
        if answer.ticks == self.expected and self.since:  # as nearly always
            self._highest = self.expected
            self._strays = 0
            return AnswerPosition.LAST
        new = (answer.ticks - self._highest) % COUNT_TURNS
        if not 1 <= new <= self.since + DUPLICATES:
            on = (answer.ticks - self._stray) % COUNT_TURNS
            if not self._strays or on:  # one that comes twice says nothing
                self._strays = self._strays + 1 if self._strays and on <= DUPLICATES else 1
                self._stray = answer.ticks
            return AnswerPosition.ASTRAY
        self._highest = answer.ticks
        self._strays = 0
        if self.owed and self.ahead(answer) < 0:
            self.owed -= 1
            return AnswerPosition.EARLIER
        return AnswerPosition.LAST

    def is_another(self, silent: bool = False) -> bool:
        """Whether the answers are those of another module; with `silent`, it has said nothing else for long."""
        return self._strays >= (SUSPECTED if silent else PERSISTENT)

    def straggler(self, answer: Answer) -> int:
        """An answer that follows, and is not taken, as it came between two periods. Returns as take()."""
        ahead = self.ahead(answer)
        if ahead >= 0:  # else place() has counted it
            self.owed = max(0, self.owed - 1)
        if ahead <= 0:
            return 0
        self.expected = answer.ticks
        lost, self.behind = min(0, self.behind - ahead), max(0, self.behind - ahead)
        return lost

    def take(self, answer: Answer) -> int:
        """The answer is taken. Return the ticks that are known to be lost now, less those that were thought to be."""
        lost = self.behind - self.ahead(answer) if self.seen else 0
        self.expected = self._highest = answer.ticks
        self.owed = self.since = self.behind = self._strays = 0
        self.seen = True
        return lost

    def take_doubtful(self, answer: Answer) -> None:
        """Nothing better came in the period: the module lost a tick, or is slow, which its next answers tell."""
        behind = max(0, -self.ahead(answer)) + self.behind
        self.take(answer)
        self.behind = behind
        self.owed = 1
