"""Jogging: axes moved by hand, while a button is held or by a step. The loop is a process of its own (jog_loop.py)."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Mapping
from typing import Any

from rds.bus.link import BUILTIN, bus_name
from rds.core.errors import InputError, MachineError
from rds.machines import Machine, load_machine
from rds.session.fields import Choice, Field, Number
from rds.session.jog_loop import JogAxis, jog_axes
from rds.session.session import Session
from rds.session.task import Task

SPEAKS = ("rds", "oacs")  # dialects that can be jogged
STEPS = ("0.01", "0.1", "1", "10")
_STARTS_IN = 15.0  # s at most
_ENDS_IN = 2.0


def _fields(axes: Mapping[str, JogAxis]) -> tuple[Field, ...]:
    fastest = max((axis.speed for axis in axes.values()), default=1.0)
    tip = "Of the reference; an axis whose own limit is lower keeps that"
    return (
        Choice("way", "Move", "While a button is held, or by one step for each press", "hold", _WAYS),
        Choice("step", "Step [mm or °]", "How far one press goes", "1", {step: step for step in STEPS}),
        Number("speed", "Speed", tip, min(5.0, fastest), unit="mm/s or °/s", above=0.0, high=fastest),
    )


_WAYS = {"hold": "while held", "step": "by step"}


class Jog:
    """The hand on a session's machine. `begin()` takes the machine, `end()` lets it go; between, axes can be moved.

    `positions` are those of the machine, measured, by axis; `error` says why the loop ended, where it did by itself.
    """

    def __init__(self, session: Session):
        self.session = session
        self.machine: Machine = load_machine(session.machine)
        self.axes = jog_axes(self.machine)
        self.choices = session.choices("jog", _fields(self.axes))
        self.positions: dict[str, float] = {}
        self.moving = False
        self.error = ""
        self._loop: subprocess.Popen[str] | None = None
        self._server: subprocess.Popen[bytes] | None = None
        self._ends: list[weakref.finalize[Any, Any]] = []
        self._lock = threading.Lock()

    @property
    def ready(self) -> bool:
        """Whether axes can be moved now."""
        return bool(self.positions) and self._loop is not None and self._loop.poll() is None

    def begin(self) -> Task[None]:
        """Take the machine, and hold its axes where they are. InputError where it is in use or cannot be jogged."""
        if not self.axes:
            raise InputError("no axis of this machine has a position and a model with tau and K: none can be jogged")
        self.session.take_machine("jogging", self)
        return self.session.work("taking the machine", self._begin)

    def _begin(self, task: Task[None]) -> None:
        try:
            self.positions, self.error = {}, ""
            interface = str(self.session.bus.get("interface", BUILTIN))
            channel = self.session.bus.get("channel") or (self.machine.name if interface == BUILTIN else "")
            task.note = "looking for the machine"
            dialect = self._dialect(interface, channel)
            task.advance(1, 3, "starting the loop")
            command = [
                sys.executable,
                "-P",
                "-m",
                "rds.session.jog_loop",
                self.machine.path,
                dialect,
                interface,
                channel,
            ]
            self._loop = loop = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
            )
            self._ends.append(weakref.finalize(self, _end_loop, loop))
            threading.Thread(target=_listen, args=(weakref.ref(self), loop), name="rds jog", daemon=True).start()
            deadline = time.monotonic() + _STARTS_IN
            while not self.positions:
                task.advance(2, 3, "waiting for the axes")
                if self.error or loop.poll() is not None or time.monotonic() > deadline:
                    time.sleep(0.1)  # its last words
                    raise MachineError(self.error or "the loop that jogs did not start")
                time.sleep(0.02)
        except BaseException:
            self.end()
            raise

    def _dialect(self, interface: str, channel: str) -> str:
        """What the modules speak; where none answers on the built-in bus, simulated ones are started for it."""
        from rds.bus.address import channels
        from rds.bus.dialects import DEFAULT, is_served
        from rds.bus.server_process import end_server, start_server

        refused = None
        if interface != BUILTIN or channel in channels():
            for dialect in SPEAKS:
                try:
                    if is_served(dialect, self.machine, interface, channel):
                        return dialect
                except InputError as error:
                    refused = error
        if refused is not None:
            raise InputError(
                f"the modules on {bus_name(interface, channel)} speak no dialect that can be jogged "
                f"({', '.join(SPEAKS)}); serve the machine in one of these"
            ) from refused
        if interface == BUILTIN:  # a bus that outlives its modules for a moment included
            self._server = start_server(DEFAULT, self.machine.path, channel)
            self._ends.append(weakref.finalize(self, end_server, self._server))
            return DEFAULT
        raise MachineError(f"no module of {self.machine.name} answers on {bus_name(interface, channel)}; switch it on")

    def end(self) -> None:
        """Let the machine go: zero volts. Nothing where it is not taken."""
        for end in self._ends:
            end()
        self._ends, self._loop, self._server, self.positions, self.moving = [], None, None, {}, False
        self.session.give_machine_back(self)

    stop = end  # what the emergency stop calls

    # motions

    def hold(self, axis: str, direction: int) -> None:
        """Move the axis towards an end of its travel; it stops unless this is said again within 0.2 s."""
        self._order(hold=self._axis(axis).name, direction=direction)

    def rest(self) -> None:
        """Bring everything to rest, within the axes' accelerations."""
        if self.ready:
            self._order(stop=True)

    def step(self, axis: str, direction: int) -> None:
        """Move by the step chosen. InputError where that leaves the travel."""
        self.go(axis, self.positions.get(axis, 0.0) + direction * float(self.choices["step"]))

    def go(self, axis: str, goal: float, speed: float | None = None) -> None:
        """Move to a position, at `speed` or that which is chosen. InputError where it is out of the travel."""
        known = self._axis(axis)
        low, high = known.travel
        if not low <= goal <= high:
            raise InputError(
                f"{axis} would leave its travel, {low:g} to {high:g} {known.unit}, at {goal:.3f}; choose a smaller step"
            )
        if speed is not None:
            speed = Number("speed", "Speed", "", unit=f"{known.unit}/s", above=0.0, high=known.speed).check(speed)
        self._order(goals=[[axis, goal]], speed=speed)

    def home(self) -> None:
        """All axes to their zero, or the end of the travel next to it, one after the other, Z first."""
        order = sorted(self.axes.values(), key=lambda axis: axis.name != "Z")
        self._order(goals=[[axis.name, min(max(0.0, axis.travel[0]), axis.travel[1])] for axis in order])

    def _axis(self, name: str) -> JogAxis:
        if name not in self.axes:
            raise InputError(f"there is no axis {name!r} to jog; there are {', '.join(self.axes)}")
        return self.axes[name]

    def _order(self, *, speed: float | None = None, **order: Any) -> None:
        loop = self._loop
        if not self.ready or loop is None or loop.stdin is None:
            raise InputError(self.error or "the machine is not taken yet: press Take the machine first")
        try:
            with self._lock:
                loop.stdin.write(
                    json.dumps(order | {"speed": self.choices["speed"] if speed is None else speed}) + "\n"
                )
                loop.stdin.flush()
        except OSError as error:
            raise MachineError(
                f"the loop that jogs has ended: {self.error or error}; take the machine again"
            ) from error

    def _hear(self, words: Mapping[str, Any]) -> None:
        if "error" in words:
            self.error = str(words["error"])
        else:
            self.positions, self.moving = dict(words["positions"]), bool(words["moving"])


def _listen(jog: weakref.ref[Jog], loop: subprocess.Popen[str]) -> None:
    """What the loop says, for as long as somebody jogs."""
    assert loop.stdout is not None
    for line in loop.stdout:
        mine = jog()
        if mine is None or mine._loop is not loop:
            break
        mine._hear(json.loads(line))
        del mine
    loop.wait()
    if (mine := jog()) is not None and mine._loop is loop:  # it ended by itself
        mine.moving = False
        mine.error = mine.error or "the loop that jogs has ended"
        mine.session.give_machine_back(mine)


def _end_loop(loop: subprocess.Popen[str]) -> None:
    """Its orders end, so it gives zero volts and ends."""
    assert loop.stdin is not None
    try:
        loop.stdin.close()
        loop.wait(_ENDS_IN)
    except (OSError, subprocess.TimeoutExpired):
        loop.kill()
        loop.wait()
