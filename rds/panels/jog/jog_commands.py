"""What whoever jogs wants now: an axis held, goals one after the other, spindles turning, drives homed."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Any

from rds.panels.jog.axes import JogAxis, JogSpindle
from rds.panels.session.expired_orders import LATE

DEAD_MAN = 0.2  # s without a word after which a held axis comes to rest
SPINDLE_DEAD_MAN = 1.0  # s without a word after which a spindle does
Wanted = tuple[str, float, float]  # axis, goal, speed


class JogCommands:
    """`hear` is called by the thread that reads, the rest by the loop, which keeps `places` where the axes are."""

    def __init__(self, axes: Mapping[str, JogAxis], spindles: Mapping[str, JogSpindle]):
        self.axes, self.spindles = dict(axes), dict(spindles)
        self.places: dict[str, float] = {}
        self.ended = False
        self._goals: deque[Wanted] = deque()  # one after the other
        self._held: Wanted | None = None
        self._until = 0.0  # s, time.monotonic: when the hold ends
        self._turns: dict[str, tuple[float, float]] = {}  # spindle -> rev/min, and when that ends
        self._homing: dict[str, int] = {}
        self._late: float | None = None
        self._lock = threading.Lock()

    def hear(self, order: Mapping[str, Any], now: float) -> None:
        """One order, which takes the place of the one before; any of them ends a homing.

        Its "at" is when it was given, s of time.monotonic(), by default `now`: from then on a hold and a turn last.
        Goals and a homing that are older than LATE come too late: the axes come to rest, and `late` tells.

        {"hold": AXIS, "direction": ±1, "speed"}; {"goals": [[AXIS, position], ...], "speed"}; {"rest": true}: the axes
        come to rest; {"turn": SPINDLE, "speed": ±rev/min}, which leaves the axes alone; {"home": {AXIS: METHOD}};
        {"halt": true}: everything comes to rest.
        """
        given = float(order.get("at", now))
        with self._lock:
            self._homing = {}
            if now - given > LATE and ("goals" in order or "home" in order):
                self._late = now - given
                order = {"rest": True}
            if "turn" in order:
                self._turns[order["turn"]] = float(order["speed"]), given + SPINDLE_DEAD_MAN
                return
            self._goals.clear()
            self._held = None
            if "hold" in order:
                axis = self.axes[order["hold"]]
                goal = axis.end(self.places.get(axis.name, 0.0), order["direction"])
                self._held = axis.name, goal, min(order["speed"], axis.speed)
                self._until = given + DEAD_MAN
            elif "goals" in order:
                self._goals.extend(
                    (name, goal, min(order["speed"], self.axes[name].speed)) for name, goal in order["goals"]
                )
            elif "home" in order:
                self._homing = dict(order["home"])
            if "home" in order or "halt" in order:
                self._turns.clear()

    def late(self) -> float | None:
        """The age of an order that came too late, s; once."""
        with self._lock:
            age, self._late = self._late, None
            return age

    def wanted(self, now: float) -> Wanted | None:
        """Axis, goal and speed at this instant; None: all come to rest."""
        with self._lock:
            if self._held is not None and now > self._until:
                self._held = None
            return self._held or (self._goals[0] if self._goals else None)

    def turning(self, now: float) -> dict[str, float]:
        """The speed of each spindle at this instant, rev/min, within its own; 0: it comes to rest."""
        with self._lock:
            self._turns = {name: turn for name, turn in self._turns.items() if now <= turn[1]}
            speeds = {name: self._turns.get(name, (0.0, 0.0))[0] for name in self.spindles}
            return {name: min(max(speed, each.speeds[0]), each.speeds[1]) if speed else 0.0
                    for (name, speed), each in zip(speeds.items(), self.spindles.values(), strict=True)}  # fmt: skip

    @property
    def homing(self) -> dict[str, int]:
        """The axes to be homed, once all stand, with their methods; empty when nobody wants that any more."""
        with self._lock:
            return self._homing

    def reached(self, name: str, goal: float) -> None:
        """The axis is there: the next goal counts."""
        with self._lock:
            if self._goals and self._goals[0][:2] == (name, goal):
                self._goals.popleft()

    def homed(self) -> None:
        """The drives are homed."""
        with self._lock:
            self._homing = {}
