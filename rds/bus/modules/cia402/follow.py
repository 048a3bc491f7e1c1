"""Leading drives along references in the modes csp and csv, where the control loop is in the drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from rds.bus.modules.cia402.host import Cia402Drivers


def follow(
    drivers: Cia402Drivers, references: Iterable[Sequence[float]], wait: Callable[[int], object]
) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Send one row of references per period; return (references acting, measured values) at each SYNC.

    `references` has a value per axis in each row: axis units in mode csp, unit/s in csv. `wait(k)` waits for the
    instant of sample k (a clock's `wait`, once it is started). `drivers` have been started; they are stopped at the
    end. A drive follows a row one period after it was sent: it interpolates towards it from SYNC to SYNC.

    Raises what exchange() and write() raise.
    """
    rows = []
    try:
        for k, row in enumerate(references):
            wait(k)
            measured = tuple(drivers.exchange())
            rows.append((tuple(drivers.write(row)), measured))
    finally:
        drivers.stop()
    return rows
