"""The loop that jogs, in a process of its own: `python -m rds.session.jog_loop MACHINE DIALECT INTERFACE CHANNEL`.

Orders come as lines of JSON on stdin, what the axes do goes out on stdout, REPORTS times a second. A hold ends unless
it is said again within DEAD_MAN s. When stdin ends, whoever gave orders has died: zero volts at once. Should this
process die, the modules' own watchdogs cut the voltage after ten periods.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

from rds.bus.dialects import open_drivers
from rds.core.errors import RdsError
from rds.machines import load_machine
from rds.machines.machine import Axis, Machine
from rds.motion.jog import advance

PERIOD = 0.002  # s
DEAD_MAN = 0.2  # s
REPORTS = 20.0  # 1/s
_REST = 0.08  # s from the highest speed to rest at most
_COUNTS = 5.0  # of error at rest over which friction is made up for


@dataclass(frozen=True)
class JogAxis:
    """What jogging needs to know of an axis: units of the axis, s, V."""

    name: str
    unit: str
    travel: tuple[float, float]
    speed: float  # the most
    acceleration: float
    braking: float  # deceleration to rest, when it is let go
    resolution: float
    tau: float
    K: float
    friction: tuple[float, float]  # lost speed, forwards and backwards (negative)
    voltage: float  # the most

    def volts(self, error: float, velocity: float) -> float:
        """The voltage for an error of position and a reference velocity.

        u = (v + f)/K + Kp e, with Kp = 1/(2 tau K), which damps τẍ + ẋ = K u by 0.7. At rest, friction f is made up
        for in proportion to the error, within some counts, so that small steps are not lost in it.
        """
        share = (velocity > 0.0) - (velocity < 0.0) if velocity else error / (_COUNTS * self.resolution)
        share = min(max(share, -1.0), 1.0)
        friction = share * self.friction[0] if share > 0.0 else -share * self.friction[1]
        volts = (velocity + friction) / self.K + error / (2.0 * self.tau * self.K)
        return min(max(volts, -self.voltage), self.voltage)


def jog_axes(machine: Machine) -> dict[str, JogAxis]:
    """The axes of `machine` that can be jogged: those with a position and a model of first order."""
    return {axis.name: made for axis in machine.axes.values() if (made := _jog_axis(axis, machine)) is not None}


def _jog_axis(axis: Axis, machine: Machine) -> JogAxis | None:
    tau, K = axis.model.get("tau"), axis.model.get("K")
    if axis.unit == "rev/min" or not tau or not K:
        return None
    volts = machine.converter.range
    friction = float(axis.model.get("friction_plus", 0.0)), float(axis.model.get("friction_minus", 0.0))
    speed = axis.limits.velocity if axis.limits else 0.5 * K * volts
    acceleration = axis.limits.acceleration if axis.limits else speed / (5.0 * tau)
    return JogAxis(
        name=axis.name,
        unit=axis.unit,
        travel=axis.travel,
        speed=speed,
        acceleration=acceleration,
        braking=max(acceleration, speed / _REST),
        resolution=axis.resolution,
        tau=tau,
        K=K,
        friction=friction,
        voltage=volts,
    )


class Orders:
    """What is wanted now. `hear` is called by the thread that reads, the rest by the loop."""

    def __init__(self, axes: dict[str, JogAxis]):
        self.axes = axes
        self.ended = False
        self._goals: deque[tuple[str, float, float]] = deque()  # axis, goal, speed: one after the other
        self._held: tuple[str, float, float] | None = None
        self._until = 0.0  # s, time.monotonic: when the hold ends
        self._lock = threading.Lock()

    def hear(self, order: dict[str, Any], now: float) -> None:
        """One order: {"hold": AXIS, "direction", "speed"}, {"goals": [[AXIS, position], ...], "speed"} or {"stop"}."""
        with self._lock:
            self._goals.clear()
            self._held = None
            if "hold" in order:
                axis = self.axes[order["hold"]]
                self._held = axis.name, axis.travel[order["direction"] > 0], min(order["speed"], axis.speed)
                self._until = now + DEAD_MAN
            elif "goals" in order:
                self._goals.extend(
                    (name, goal, min(order["speed"], self.axes[name].speed)) for name, goal in order["goals"]
                )

    def wanted(self, now: float) -> tuple[str, float, float] | None:
        """Axis, goal and speed at this instant; None: all come to rest."""
        with self._lock:
            if self._held is not None and now > self._until:
                self._held = None
            return self._held or (self._goals[0] if self._goals else None)

    def reached(self, name: str, goal: float) -> None:
        """The axis is there: the next goal counts."""
        with self._lock:
            if self._goals and self._goals[0][:2] == (name, goal):
                self._goals.popleft()


def jog(machine: Machine, drivers: Any, orders: Orders) -> None:
    """Hold all axes where they are, and move what is wanted, until `orders.ended`. MachineError where the bus fails."""
    axes = list(orders.axes.values())
    drivers.start()
    origin = drivers.standing
    places, speeds = list(origin), [0.0] * len(axes)
    due = time.monotonic()
    report_at = 0.0
    while not orders.ended:
        now = time.monotonic()
        measured = [at + start for at, start in zip(drivers.exchange(), origin, strict=True)]
        wanted = orders.wanted(now)
        for i, axis in enumerate(axes):
            goal, speed = wanted[1:] if wanted is not None and wanted[0] == axis.name else (None, axis.speed)
            rate = axis.braking if goal is None else axis.acceleration
            places[i], speeds[i] = advance(places[i], speeds[i], goal, speed, rate, PERIOD)
            if goal is not None and places[i] == goal:
                orders.reached(axis.name, goal)
        drivers.write([axis.volts(p - y, v) for axis, p, y, v in zip(axes, places, measured, speeds, strict=True)])
        if now >= report_at:
            report_at = now + 1.0 / REPORTS
            moving = wanted is not None or any(speeds)
            _say({"positions": dict(zip(orders.axes, measured, strict=True)), "moving": moving})
        due += PERIOD
        left = due - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        else:
            due -= left  # what is late is not made up for


def _read(orders: Orders) -> None:
    rest = b""
    while data := os.read(0, 4096):
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            orders.hear(json.loads(line), time.monotonic())
    orders.ended = True


def _say(words: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


def main(arguments: list[str]) -> int:
    """The program. Exit code 0: its orders have ended; 1: the machine failed, and the last line says why."""
    name, dialect, interface, channel = arguments
    try:
        machine = load_machine(name)
        orders = Orders(jog_axes(machine))
        threading.Thread(target=_read, args=(orders,), daemon=True).start()
        bus = {"interface": interface} | ({"channel": channel} if channel else {})
        drivers = open_drivers(dialect, machine, list(orders.axes), PERIOD, False, bus)
        try:
            jog(machine, drivers, orders)
        finally:
            drivers.close()
    except RdsError as error:
        _say({"error": str(error)})
        return 1
    except BrokenPipeError:  # nobody hears: the same as no orders
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
