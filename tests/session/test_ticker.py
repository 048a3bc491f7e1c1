"""The page's beat, in a loop whose time passes only while it waits or works."""

from __future__ import annotations

import asyncio
import selectors
from itertools import pairwise

import pytest

from rds.panels.kit.ticker import PERIOD, Ticker


class Clockwork(asyncio.SelectorEventLoop):
    """Its clock goes on by what it waits for, and by what is added to `now`."""

    def __init__(self) -> None:
        self.now = 0.0
        loop = self

        class Selector(selectors.DefaultSelector):
            def select(self, timeout: float | None = None) -> list:  # type: ignore[type-arg]
                loop.now += timeout or 0.0
                return super().select(0.0)

        super().__init__(Selector())

    def time(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("work", "slowest"),
    [(0.001, 0.1), (0.03, 0.1), (0.5, 0.5 + PERIOD)],  # s: of each beat; between two of them
)
def test_it_beats_ten_times_a_second_beside_its_work_and_leaves_room_for_the_page(work: float, slowest: float) -> None:
    loop = Clockwork()
    ticker = Ticker()
    begun: list[float] = []

    def beat() -> None:
        begun.append(loop.now)
        loop.now += work

    async def page() -> None:
        remove = ticker.add(beat)
        while len(begun) < 100:
            await asyncio.sleep(PERIOD)
        remove()
        await asyncio.sleep(2 * PERIOD)  # its task ends

    try:
        loop.run_until_complete(page())
    finally:
        loop.close()
    between = [later - earlier for earlier, later in pairwise(begun)]
    assert max(between) <= slowest + 1e-9 and (begun[-1] - begun[0]) / (len(begun) - 1) <= slowest + 1e-9
    assert min(between) >= work + PERIOD / 2 - 1e-9
