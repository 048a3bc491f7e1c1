"""The loop that jogs, in a process of its own: `python -m rds.panels.jog.loop MACHINE DIALECT BUS`, BUS in JSON.

Commands come as lines of JSON on stdin (jog_commands.py), what the machine does goes out on stdout, REPORTS times a
second. A hold ends unless it is said again within DEAD_MAN s, a spindle's turning within SPINDLE_DEAD_MAN s. When stdin
ends, whoever gave commands has died: no voltage, drives by a quick stop. Should this process die, the modules' own
watchdogs cut the voltage after ten periods, and drives stop when SYNC and heartbeat stay away.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.bus.tools.mf4 import put_off_asammdf
    from rds.core.garbage import collect_rarely

    collect_rarely()
    put_off_asammdf()

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

from rds.bus.hub.command import Command
from rds.bus.tools.link import BUILTIN, default_channel
from rds.core.errors import RdsError
from rds.core.garbage import leave
from rds.core.private_files import keep_process_private
from rds.core.scheduling import raise_priority
from rds.interpolators.motion.jog import advance
from rds.machines import load_machine
from rds.panels.jog.jog_commands import JogCommands, Wanted
from rds.panels.jog.module_control import ModuleControl, open_hand

REPORTS = 20.0  # 1/s
_PRIORITY = 50  # of SCHED_FIFO, below that of hub and simulated modules


class HomingCancelled(Exception):
    """A homing that is not wanted any more."""


class Reference:
    """Where each axis shall be and how fast, and how fast each spindle shall turn."""

    def __init__(self, hand: ModuleControl, measured: Mapping[str, float]):
        self.places = {name: measured[name] for name in hand.axes}
        self.speeds = dict.fromkeys((*hand.axes, *hand.spindles), 0.0)

    @property
    def rests(self) -> bool:
        """Whether nothing shall move."""
        return not any(self.speeds.values())

    def advance(
        self, hand: ModuleControl, orders: JogCommands, wanted: Wanted | None, turning: Mapping[str, float]
    ) -> None:
        """Move on by a period: one axis towards its goal, the others to rest, spindles towards their speeds."""
        for name, axis in hand.axes.items():
            goal, speed = wanted[1:] if wanted is not None and wanted[0] == name else (None, axis.speed)
            rate = axis.braking if goal is None else axis.acceleration
            place, velocity = self.places[name], self.speeds[name]
            self.places[name], self.speeds[name] = advance(place, velocity, goal, speed, rate, hand.period)
            if goal is not None and self.places[name] == goal:
                orders.reached(name, goal)
        for name, spindle in hand.spindles.items():
            most = spindle.acceleration * hand.period
            self.speeds[name] += min(max(turning[name] - self.speeds[name], -most), most)


def jog(hand: ModuleControl, orders: JogCommands) -> None:
    """Hold all axes where they are, and move what is wanted, until `orders.ended`. MachineError where the bus fails."""
    hand.start()
    reference = _introduce(hand, orders)
    due, report_at = time.monotonic(), 0.0
    while not orders.ended:
        if orders.homing and reference.rests:
            homed = _home(hand, orders)
            reference = _introduce(hand, orders)
            if homed:  # after where they are now: who waits for this word reads the position that came before it
                _say({"homed": homed})
            due = time.monotonic()
        now = time.monotonic()
        measured = hand.read()
        wanted, turning = orders.wanted(now), orders.turning(now)
        reference.advance(hand, orders, wanted, turning)
        hand.write(reference.places, reference.speeds)
        if now >= report_at:
            report_at = now + 1.0 / REPORTS
            if (age := orders.late()) is not None:
                _say({"late": age})
            _report(measured, reference.places, wanted is not None or not reference.rests)
        due += hand.period
        left = due - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        else:
            due -= left  # what is late is not made up for


def _home(hand: ModuleControl, orders: JogCommands) -> list[str]:
    """Let drives find home, as long as that is wanted; the axes that did."""
    methods = orders.homing
    places = dict(orders.places)
    report_at = 0.0

    def watch(axis: str, position: float) -> None:
        nonlocal report_at
        if orders.ended or orders.homing is not methods:
            raise HomingCancelled
        places[axis] = position
        if time.monotonic() >= report_at:
            report_at = time.monotonic() + 1.0 / REPORTS
            _report(places, places, True, homing=axis)

    with contextlib.suppress(HomingCancelled):
        hand.home(methods, watch)
        orders.homed()
        return list(methods)
    return []


def _introduce(hand: ModuleControl, orders: JogCommands) -> Reference:
    """After a start: where the axes stand and are held, and their travel, which may be another one."""
    measured = hand.read()
    reference = Reference(hand, measured)
    orders.axes, orders.spindles, orders.places = dict(hand.axes), dict(hand.spindles), reference.places
    _say({"travel": {name: axis.travel for name, axis in hand.axes.items()}, "left_out": hand.left_out})
    _report(measured, reference.places, False)
    return reference


def _report(measured: Mapping[str, float], places: Mapping[str, float], moving: bool, homing: str = "") -> None:
    _say({"measured": dict(measured), "places": dict(places), "moving": moving, "homing": homing})


def _say(words: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


def _read(orders: JogCommands) -> None:
    rest = b""
    try:
        while data := os.read(0, 4096):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                orders.hear(json.loads(line), time.monotonic())
    finally:  # whatever it could not read: nobody would hear from now on that the machine is to be let go
        orders.ended = True


def main(arguments: list[str]) -> int:
    """The program. Exit code 0: its orders have ended; 1: the machine failed, and the last line says why."""
    name, dialect, words = arguments
    bus = json.loads(words)
    raise_priority(_PRIORITY)  # where that is permitted: a busy computer stalls others for longer than drives bear
    try:
        with contextlib.ExitStack() as stack:
            machine = load_machine(name)
            interface = bus.setdefault("interface", BUILTIN)
            if interface == BUILTIN:
                stack.enter_context(Command(str(default_channel(machine, interface, bus.get("channel")))))
            hand = open_hand(dialect, machine, bus)
            stack.callback(hand.close)
            orders = JogCommands(hand.axes, hand.spindles)
            threading.Thread(target=_read, args=(orders,), daemon=True).start()
            jog(hand, orders)
    except RdsError as error:
        _say({"error": str(error)})
        return 1
    except BrokenPipeError:  # nobody hears: the same as no orders
        return 0
    return 0


if __name__ == "__main__":
    keep_process_private()
    leave(main(sys.argv[1:]))
