"""What a submission sleeps away while it has to answer, though it is awake whenever the supervisor looks.

The supervisor looks 50 times a second, and a thread that is then ready to go on may be waiting for a processor by no
fault of its own. The kernel counts for how long it did so; what remains of the time that went by it was asleep.
"""

from __future__ import annotations

from dataclasses import dataclass

from rds.grading.sandbox.processes import ThreadTimes

_MUCH = 0.5  # of the time between two looks: less may be a computer's that stands still for moments


@dataclass
class SleepTime:
    """Told at each look by `look`. Times in s; they stay 0 where the kernel does not tell.

    `slept`: whether the submission has gone to sleep by its own will since the last look.
    `own`: of an answer that takes longer than a look, what it took so far, less what was waited for a processor.
    `between`: of several answers since the last look, what neither side computed or waited for; 0 if that is little.
    """

    slept: bool = False
    own: float = 0.0
    between: float = 0.0
    _last: tuple[ThreadTimes, ThreadTimes, int] | None = None

    def look(
        self, seconds: float, answering: ThreadTimes | None, grading: ThreadTimes | None, sleeps: int, is_same: bool
    ) -> None:
        """`seconds` after the last look; `is_same`: whether the submission still has, or has not, the same turn.

        `answering` and `grading` are of the submission's and the grader's thread, `sleeps` is how often the former has.
        """
        last, self._last = self._last, None
        self.slept, self.own, self.between = False, self.own if is_same else 0.0, 0.0
        if answering is None or grading is None:
            return
        self._last = answering, grading, sleeps
        if last is None:
            return
        waited = answering.waited - last[0].waited
        awake = answering.computed - last[0].computed + waited
        graded = grading.computed - last[1].computed + grading.waited - last[1].waited
        left = seconds - awake - graded
        self.slept, self.between = sleeps > last[2], left if left > _MUCH * seconds else 0.0
        if is_same:
            self.own += seconds - waited
