"""The sampled loop: one for all modes. Modes differ by the parts that they hand in, never in here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rds.core.types import Ending
from rds.modes.loop.changes import LiveChanges

Law = Callable[[int, Sequence[float], list[float], list[float]], None]


@dataclass
class Loop:
    """The parts of a run and how far it has come.

    - `wait(k) -> k`: waits until sample `k` is due; returns the sample to take, later than `k` where the late
      policy discarded periods.
    - `read() -> positions`: the measured position of each axis, in axis order.
    - `laws`: each is called with (sample, positions, row, voltages); it appends what it wants recorded to the row
      and its limited voltages to the list. See `loop.laws`. Where `sets_references`, the first one sets the
      references of the others.
    - `write(voltages) -> acting`: hands the voltages out; returns those that act on the axes from this sample on.
    - `follow(acting) -> outputs`: the models move on by one sample (holding the last voltages when none are given);
      returns what is to be recorded of them, as it was at this sample.
    - `record(row)`: takes the row: the sample's number, what the laws appended, the acting voltages, the outputs.
    - `finish(k) -> ending`: sample `k` is complete; how the run ends here, if it does.
    - `notes() -> sentences`: for the result, asked once the run is at its end.
    - `changes(k) -> ending`: live values that were changed are taken before sample `k`, which is the last chance to end
      the run before it is taken. None where the run has no live values. See `loop.changes`.
    """

    samples: int
    wait: Callable[[int], int]
    read: Callable[[], Sequence[float]]
    laws: Sequence[Law]
    write: Callable[[Sequence[float]], Sequence[float]]
    follow: Callable[[Sequence[float]], Sequence[float]]
    record: Callable[[list[float]], object]
    finish: Callable[[int], Ending | None]
    changes: LiveChanges | None = None
    sets_references: bool = False
    notes: Callable[[], list[str]] = list
    k: int = 0  # the sample to take next, or the one that failed

    def run(self, until: int | None = None) -> Ending | None:
        """Take the samples up to `until` (default: all); None means that there are more to take."""
        wait, read, laws, write = self.wait, self.read, self.laws, self.write
        follow, record, finish, samples = self.follow, self.record, self.finish, self.samples
        changes = self.changes
        until = samples if until is None else min(until, samples)
        k = self.k
        try:
            while k < until:
                due = wait(k)
                if due != k:
                    for _ in range(k, min(due, samples)):
                        follow(())  # the models live through the discarded periods
                    if due >= samples:
                        return self._done()
                    k = due
                if changes is not None:
                    ending = changes(k)
                    if ending is not None:
                        return ending
                positions = read()
                row: list[float] = [k]
                voltages: list[float] = []
                for law in laws:
                    law(k, positions, row, voltages)
                acting = write(voltages)
                row += acting
                row += follow(acting)
                record(row)
                ending = finish(k)
                k += 1
                if ending is not None:
                    return ending
            if k < samples:
                return None
            return self._done()
        finally:
            self.k = k

    def _done(self) -> Ending:
        """How a run ends that has no sample left to take: what drives the axes may have ended it in the last one."""
        return (self.changes.at_end() if self.changes is not None else None) or Ending.DONE
