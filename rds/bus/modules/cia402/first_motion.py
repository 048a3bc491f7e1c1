"""The first motion of a drive on the bench: a few counts at low torque and back, and what that tells.

The torque rises slowly until the axis has moved a few counts, and falls to zero at once; then it is pushed back. So
direction, sign, friction and delay come from one motion that a hand could stop. A drive without a torque mode is led by
a few counts instead, one in each period: of position, or at the speed that this is.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import can
import numpy as np

from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.settings import Command
from rds.core.errors import MachineError
from rds.machines.machine import Machine

_RISE = 2.0  # s from no torque to the most
_REST = 0.3  # s without torque between the ways
_REACHES = 1.5  # s for the power to come on, and for a position to be reached
_BEYOND = 10  # times the wished counts: the axis runs away


@dataclass(frozen=True)
class FirstMotion:
    """What the motion told. Counts are the drive's own, before any direction."""

    moved: int
    increments: int | None  # of the encoder (0x6063), for the same way; None where the drive does not tell them
    torque: float | None  # ‰ at which it moved; None where it was led by position
    agrees: bool  # a positive command counts upwards
    delay: int | None  # samples from a step of the command to the first count of its answer
    exchange: float  # s from SYNC to the answer, median
    exchange_worst: float  # s, 99th percentile

    def loop_delay(self, period: float) -> float:
        """From a sample's SYNC to the effect of its command, s: the answer, a sample of waiting, the drive's own."""
        return self.exchange_worst + (self.delay if self.delay is not None else 1) * period


def first_motion(
    machine: Machine,
    axis: str,
    bus: can.BusABC,
    table: Mapping[str, Any],
    period: float,
    counts: int = 40,
    torque: int = 100,
) -> FirstMotion:
    """Move `axis` by about `counts` and back, by at most `torque` ‰. `table` is its `[bus.cia402]`, direction 1.

    MachineError if it does not move, runs away, or the drive reports what is wrong; the power is off in any case.
    """
    drivers = Cia402Drivers(machine, [axis], bus=bus, sample_period=period, cia402=table)
    settings = drivers.settings.drives[0]
    bench = _Bench(drivers, settings.counts, period)
    try:
        drivers.start()
        if settings.command is Command.CST:
            return bench.pushed(counts, torque, settings.rated_voltage * 1e-3)
        return bench.led(counts, settings.command is Command.CSV)
    finally:
        drivers.close()


class _Bench:
    def __init__(self, drivers: Cia402Drivers, per_unit: float, period: float):
        self.drivers, self.per_unit, self.period = drivers, per_unit, period
        self.times: list[float] = []
        self.at = 0  # counts from where the axis stood
        self._increments: list[int | None] = []

    def cycle(self, command: float) -> int:
        """One period; the position in counts."""
        began = time.perf_counter()
        self.at = round(self.drivers.exchange()[0] * self.per_unit)
        self.times.append(time.perf_counter() - began)
        self.drivers.write([command])
        time.sleep(max(0.0, self.period - (time.perf_counter() - began)))
        return self.at

    def look(self, command: float) -> None:
        """Note the encoder's own increments, while the command stays."""
        drive = self.drivers.drives[0]
        self.drivers.ask_for(drive, 0x6063)
        for _ in range(round(_REST / self.period)):
            self.cycle(command)
            if (data := self.drivers.told.pop((drive.node, 0x6063), None)) is not None:
                self._increments.append(int.from_bytes(data, "little", signed=True))
                return
        self._increments.append(None)

    def enable(self, resting: float) -> None:
        for _ in range(round(_REACHES / self.period) + 1):
            self.cycle(resting)
            if self.drivers.drives[0].enabled:
                return
        raise MachineError("the drive was not enabled")

    def pushed(self, counts: int, torque: int, volts: float) -> FirstMotion:
        """`volts` is a torque of 1 ‰."""
        self.enable(0.0)
        self.look(0.0)
        start = self.at
        samples = max(round(_RISE / self.period), torque)
        given = 0.0
        for k in range(samples + round(_REST / self.period)):
            given = min(torque * (k + 1) / samples, torque)
            if abs(self.cycle(given * volts) - start) >= counts:
                break
        moved = self.at - start
        for _ in range(round(_REST / self.period)):
            if abs(self.cycle(0.0) - start) > _BEYOND * counts + abs(moved) * _BEYOND:
                raise MachineError(f"the axis runs away: {self.at - start} counts without a torque; is it vertical?")
        if abs(moved) < counts:
            raise MachineError(
                f"the axis did not move ({moved} counts at {torque} ‰): a brake that stays closed (see the drive's "
                "brake output, 0x60FE, and its supply), a motor that is not connected, an axis that is blocked, or "
                "too little torque (--torque)"
            )
        self.look(0.0)
        moved = self.at - start
        sign = 1 if moved > 0 else -1
        delay = self._back(given, torque, volts, start, sign)
        return self._told(moved, given, sign > 0, delay)

    def _back(self, given: float, torque: int, volts: float, start: int, sign: int) -> int | None:
        """Push it back to where it stood; the samples until the first count."""
        before, delay = self.at, None
        for k in range(round(_RISE / self.period)):
            now = self.cycle(-volts * min(given * (1.0 + k * self.period), 1.5 * given, torque))
            if delay is None and (before - now) * sign > 0:
                delay = k
            if (now - start) * sign <= 0:
                break
        for _ in range(round(_REST / self.period)):
            self.cycle(0.0)
        return delay

    def led(self, counts: int, by_speed: bool) -> FirstMotion:
        unit = 1.0 / self.per_unit

        def along(place: int, step: int) -> float:
            return step * unit / self.period if by_speed else place * unit

        self.enable(0.0)
        self.look(0.0)
        start = self.at
        delay = None
        for k in range(counts + round(_REACHES / self.period)):
            now = self.cycle(along(start + min(k + 1, counts), k < counts))
            if delay is None and now != start:
                delay = k
            if abs(now - start) > _BEYOND * counts:
                raise MachineError(
                    f"the axis runs away: {now - start} counts, and {counts} were asked for. The encoder counts "
                    "against the motor: swap one of them, or see the drive's 0x607E"
                )
            if k >= counts and abs(now - start - counts) <= 0.1 * counts:
                break
        moved = self.at - start
        if abs(moved - counts) > 0.5 * counts:
            raise MachineError(
                f"the axis did not follow: {moved} counts of {counts}; a brake that stays closed (see the drive's "
                "brake output, 0x60FE), an axis that is blocked, or a loop of the drive that is not tuned"
            )
        self.look(along(start + counts, 0))
        for k in range(counts + round(_REST / self.period)):
            self.cycle(along(start + max(counts - k - 1, 0), -(k < counts)))
        return self._told(moved, None, True, delay)

    def _told(self, moved: int, torque: float | None, agrees: bool, delay: int | None) -> FirstMotion:
        took = np.array(self.times)
        first, last = self._increments
        increments = None if first is None or last is None else last - first
        return FirstMotion(
            moved, increments, torque, agrees, delay, float(np.median(took)), float(np.percentile(took, 99.0))
        )
