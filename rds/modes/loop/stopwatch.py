"""The real-time parts of a loop: waiting for due times, and the time that each stage of a sample takes."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Sequence
from dataclasses import replace

from rds.core.clock import RealTimeClock
from rds.core.instructions import InstructionCounter
from rds.core.thread_time import ThreadTime
from rds.core.types import Ending
from rds.modes.loop.loop import Law, Loop

TIMING_COLUMNS = ("lateness", "io", "interpolate", "compute", "model", "taken")  # ns


class Stopwatch:
    """Puts a loop under a real-time clock, and the times of each sample in front of its row (after its number).

    Lateness is from the due time to the start; I/O is `read` and `write`; interpolate is the law that sets references,
    0 where there is none; compute is the other laws; model is `follow`; taken is what the scheduler took from these
    three (see `core.thread_time`).
    """

    def __init__(self, clock: RealTimeClock, append: Callable[[list[float]], None], stop: Callable[[], bool]):
        self._clock, self._append, self._stop = clock, append, stop
        self.thread = ThreadTime()
        self.instructions = InstructionCounter(clock.period)
        self._started = self._read = self._referred = self._computed = self._written = self._ended = 0
        self._is_copy = False  # of the process, made by a fork in the student's code: it must neither drive nor record
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._copied)

    def time(self, loop: Loop) -> Loop:
        """The same loop, timed; its rows go to `append`, and it ends when `stop()` is true or by the late policy."""
        clock, now, begin, count = self._clock, self._clock.now, self.thread.begin, self.instructions.begin
        wait_until, read, write, follow = clock.wait, loop.read, loop.write, loop.follow

        def wait(k: int) -> int:
            k = wait_until(k)
            self._started = now()
            return k

        def timed_read() -> Sequence[float]:
            positions = read()
            self._read = now()
            begin()
            count()
            self._referred = self._read
            return positions

        def timed_write(voltages: Sequence[float]) -> Sequence[float]:
            self._computed = now()
            if self._is_copy:
                os._exit(0)
            acting = write(voltages)
            self._written = now()
            return acting

        def timed_follow(acting: Sequence[float]) -> Sequence[float]:
            outputs = follow(acting)
            self._ended = now()
            return outputs

        laws = [self._timed(loop.laws[0]), *loop.laws[1:]] if loop.sets_references else loop.laws

        return replace(
            loop,
            laws=laws,
            wait=wait,
            read=timed_read,
            write=timed_write,
            follow=timed_follow,
            record=self._row,
            finish=self._end,
        )

    def close(self) -> None:
        """Let go of the kernel's accounts."""
        self.thread.close()
        self.instructions.close()

    def end_copy(self) -> None:
        """In a copy of the process: end it here. Whoever runs the loop asks when it has ended in whatever way."""
        if self._is_copy:
            os._exit(0)

    def _copied(self) -> None:
        self._is_copy = True

    def _timed(self, law: Law) -> Law:
        """The law that sets references, timed."""
        now = self._clock.now

        def timed(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
            law(k, positions, row, voltages)
            self._referred = now()

        return timed

    def _row(self, row: list[float]) -> None:
        started, read, computed, written, ended = self._started, self._read, self._computed, self._written, self._ended
        referred, taken = self._referred, self.thread.taken(ended - read)
        self.instructions.end(ended - read - taken - (written - computed))
        row[1:1] = (
            self._clock.lateness(int(row[0]), started),
            read - started + written - computed,
            referred - read,
            computed - referred,
            ended - written,
            taken,
        )
        self._append(row)

    def _end(self, k: int) -> Ending | None:
        if self._clock.finish(k, self._ended):
            return Ending.OVERLOADED
        return Ending.STOPPED if self._stop() else None


class quiet_memory:
    """Garbage collection frozen for as long as the loop runs: a collection pause is a late sample."""

    def __enter__(self) -> None:
        gc.collect()
        gc.freeze()
        gc.disable()

    def __exit__(self, *_: object) -> None:
        gc.enable()
        gc.unfreeze()
