"""The sampled loop: one for all modes. Modes differ by the parts that they hand in, never in here."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from rds.core.contracts import Clock
from rds.core.types import Ending

TIMING_COLUMNS = ("sample", "lateness", "io", "compute", "model", "taken")

Law = Callable[[int, Sequence[float], list[float], list[float]], None]


@dataclass
class Loop:
    """The parts of a run and how far it has come.

    - `read() -> positions`: the measured position of each axis, in axis order.
    - `laws`: each is called with (sample, positions, row, voltages); it appends what it wants recorded to the row
      and its limited voltages to the list. See `runtime.laws`.
    - `write(voltages) -> acting`: hands the voltages out; returns those that act on the axes from this sample on.
    - `follow(acting) -> outputs`: the models move on by one sample; returns what is to be recorded of them, as it
      was at this sample.
    - `record(row)`: takes the row: the `TIMING_COLUMNS` (times in ns), what the laws appended, the acting voltages, what the models gave.
    - `stop() -> bool`: whether somebody asked for the end.
    """

    samples: int
    clock: Clock
    read: Callable[[], Sequence[float]]
    laws: Sequence[Law]
    write: Callable[[Sequence[float]], Sequence[float]]
    follow: Callable[[Sequence[float]], Sequence[float]]
    record: Callable[[list[float]], None]
    stop: Callable[[], bool]
    k: int = field(default=0)

    def run(self, until: int | None = None) -> Ending | None:
        """Take the samples up to `until` (default: all); None means that there are more to take."""
        clock = self.clock
        now, wait, finish, lateness, taken = clock.now, clock.wait, clock.finish, clock.lateness, clock.taken
        read, laws, write, follow = self.read, self.laws, self.write, self.follow
        record, stop, samples = self.record, self.stop, self.samples
        until = samples if until is None else min(until, samples)
        k = self.k
        while k < until:
            due = wait(k)
            if due != k:  # the late policy discarded the periods from k to due - 1: the models lived through them
                for _ in range(k, min(due, samples)):
                    follow(())
                if due >= samples:
                    k = samples
                    break
                k = due
            started = now()
            positions = read()
            have_read = now()
            taken_before = taken()
            row: list[float] = [k, 0, 0, 0, 0, 0]
            voltages: list[float] = []
            for law in laws:
                law(k, positions, row, voltages)
            computed = now()
            acting = write(voltages)
            written = now()
            row += acting
            row += follow(acting)
            ended = now()
            row[1] = lateness(k, started)
            row[2] = have_read - started + written - computed
            row[3] = computed - have_read
            row[4] = ended - written
            row[5] = taken() - taken_before
            record(row)
            late_too_often = finish(k, ended)
            k += 1
            if late_too_often:
                self.k = k
                return Ending.OVERLOADED
            if stop():
                self.k = k
                return Ending.STOPPED
        self.k = k
        return Ending.DONE if k >= samples else None


class quiet_memory:
    """Garbage collection frozen for as long as the loop runs: a collection pause is a late sample."""

    def __enter__(self) -> None:
        gc.collect()
        gc.freeze()
        gc.disable()

    def __exit__(self, *_: object) -> None:
        gc.enable()
        gc.unfreeze()
