"""How late the hub was: a histogram in whole µs that costs next to nothing per frame."""

from __future__ import annotations

_LONGEST = 1000  # µs; what is later counts there, and in the maximum


class Lateness:
    """Counts delays in ns; tells median, 99th percentile and maximum in µs."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self._counts = [0] * (_LONGEST + 1)
        self._most = 0

    def add(self, delay: int) -> None:
        """One delay, ns."""
        if delay > self._most:
            self._most = delay
        microseconds = delay // 1000
        self._counts[microseconds if 0 <= microseconds < _LONGEST else (_LONGEST if microseconds > 0 else 0)] += 1

    def summary(self) -> dict[str, float]:
        """Count, p50, p99 and max; percentiles as the upper end of their µs."""
        total = sum(self._counts)
        return {
            "count": total,
            "p50": self._percentile(0.50 * total),
            "p99": self._percentile(0.99 * total),
            "max": self._most / 1000,
        }

    def _percentile(self, wanted: float) -> float:
        seen = 0
        for microseconds, number in enumerate(self._counts):
            seen += number
            if number and seen >= wanted:
                return min(microseconds + 1, self._most / 1000)
        return 0.0
