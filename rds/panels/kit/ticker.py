"""Ten times a second: what a page shows of work that goes on is brought up to date in the kernel's own loop."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from rds.panels.session.task import Stopped

PERIOD = 0.1  # s; after a late beat the next one is so much earlier
PATIENCE = 20  # failures one after the other before a call is given up


class Ticker:
    """Calls what was added every PERIOD s while a loop of asyncio runs; `tick()` does it once, for tests.

    In the kernel's own thread, so that what it changes is never changed by a handler at the same time.
    """

    def __init__(self, given_up: Callable[[str], None] = lambda text: None) -> None:
        """`given_up(sentence)` hears of a call that is not made again."""
        self._given_up = given_up
        self._failures: dict[Callable[[], None], int] = {}  # since it went well last
        self._calls: list[Callable[[], None]] = []
        self._task: asyncio.Task[None] | None = None

    def add(self, call: Callable[[], None]) -> Callable[[], None]:
        """Call it from now on; the answer ends that."""
        self._calls.append(call)
        self._begin()

        def remove() -> None:
            if call in self._calls:
                self._calls.remove(call)

        return remove

    def tick(self) -> None:
        """Once, now. A call that fails again and again is not made any more; its errors go to the log."""
        for call in tuple(self._calls):
            try:
                call()
                self._failures.pop(call, None)
            except (Exception, Stopped) as error:
                logging.getLogger(__name__).exception("a panel could not be brought up to date")
                self._failures[call] = self._failures.get(call, 0) + 1
                if self._failures[call] >= PATIENCE and call in self._calls:
                    self._calls.remove(call)
                    self._given_up(f"a part of this page stands still, because {error}; reload the page")

    def _begin(self) -> None:
        if self._task is not None and not self._task.done():
            return
        try:
            self._task = asyncio.get_running_loop().create_task(self._run())
        except RuntimeError:  # no loop: a test, which ticks itself
            self._task = None

    async def _run(self) -> None:
        clock = asyncio.get_running_loop().time
        due = clock()
        while self._calls:
            self.tick()
            due = max(due + PERIOD, clock() + PERIOD / 2)  # in step; after long work there is room for the page's words
            await asyncio.sleep(due - clock())
