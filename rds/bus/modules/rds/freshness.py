"""Whether a command is new, and of the host that commands: what a module makes of the commands' numbers.

A number is its host's clock in half sample periods (1 to 255 and round again) when the command was sent. The module
compares it with its own clock: among the commands of one host, the one that has travelled longer than the quickest is
older by the difference. Commands older than two periods are refused, with half a period for the grain of the numbers.
A number far from what is expected is another host's.

A command after a silence, or the first, can't be compared with anything. It is answered, and its voltage waits for a
second one that agrees with it: a single frame that comes out of some queue long after its time moves nothing.
"""

from __future__ import annotations

from enum import Enum

from rds.bus.modules.rds.frames import NUMBERS

OLDEST = 2.5  # periods: two, and half of one for the numbers' grain and jitter
_NEWEST = 12.0  # periods by which a host's first commands may have been late
_SILENCE = 10.0  # periods without a command, after which a host starts anew
_DRIFT = 1e-3  # half periods per command that the clocks of host and module may drift apart


class Verdict(Enum):
    """What a command is."""

    FRESH = "fresh"
    FIRST = "the first"
    OLD = "older than two sample periods"
    STRANGE = "of another host"


class Freshness:
    """Judges the numbered commands of one host after the other; instants in s of bus time."""

    def __init__(self, sample_period: float):
        self.restart(sample_period)

    def restart(self, sample_period: float) -> None:
        """A host begins, with this sample period in s."""
        self._half = 0.5 * sample_period
        self._base = 0.0  # half periods: module's clock less number, of the quickest command
        self._last: float | None = None
        self._trusted = False

    def followed(self, at: float) -> bool:
        """Whether a host whose numbers are known commands at the instant `at`."""
        return self._trusted and self._last is not None and at - self._last <= 2.0 * _SILENCE * self._half

    def judge(self, number: int, at: float) -> Verdict:
        """What the command with this number (1 to 255) is that arrived at the instant `at`."""
        lag = at / self._half - number
        if self._last is None or at - self._last > 2.0 * _SILENCE * self._half:
            return self._begin(lag, at)
        age = (lag - self._base + 0.5 * NUMBERS) % NUMBERS - 0.5 * NUMBERS
        if not -2.0 * _NEWEST <= age <= 2.0 * OLDEST:
            if not self._trusted:
                return self._begin(lag, at)
            return Verdict.OLD if age > 0.0 else Verdict.STRANGE
        self._base += min(age, _DRIFT)
        self._last = at
        self._trusted = True
        return Verdict.FRESH

    def _begin(self, lag: float, at: float) -> Verdict:
        self._base, self._last, self._trusted = lag, at, False
        return Verdict.FIRST
