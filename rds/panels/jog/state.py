"""Jogging: axes and spindles moved by hand. The loop is a process of its own (loop.py)."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from rds.bus.hub.bus_settings import SERIAL, bus_fault
from rds.bus.modules.dialects import SERIAL_DIALECTS, bus_interface
from rds.bus.tools.link import BUILTIN, bus_name
from rds.core.errors import InputError, MachineError
from rds.core.toml_table import TomlTable
from rds.machines import Machine, load_machine
from rds.panels.jog.axes import JogAxis, JogSpindle, jog_axes, jog_spindles
from rds.panels.session.expired_orders import refusal
from rds.panels.session.fields import Choice, Field, Number
from rds.panels.session.session import Session
from rds.panels.session.task import Task

STEPS = ("0.01", "0.1", "1", "10")
HOMING = {  # methods of object 0x6098 that every drive of ours has
    "17": "17: negative limit switch",
    "18": "18: positive limit switch",
    "1": "1: index pulse at the negative switch",
    "2": "2: index pulse at the positive switch",
    "33": "33: next index pulse, negative way",
    "34": "34: next index pulse, positive way",
    "37": "37: here",
}
_STANDS = 0.01  # of its highest speed: a spindle that is slower stands
_STARTS_IN = 15.0  # s at most
_ENDED = "the loop that jogs has ended; take the machine again"
_ENDS_IN = 8.0  # s: a quick stop of drives, and what they are told after it


def _fields(axes: Mapping[str, JogAxis], spindles: Mapping[str, JogSpindle]) -> Iterable[Field]:
    fastest = max((axis.speed for axis in axes.values()), default=1.0)
    tip = "Of the reference; an axis whose own limit is lower keeps that"
    yield Choice("way", "Move", "While a button is held, or by one step for each press", "hold", _WAYS)
    yield Choice("step", "Step [mm or °]", "How far one press goes", "1", {step: step for step in STEPS})
    yield Number("speed", "Speed", tip, min(5.0, fastest), unit="mm/s or °/s", above=0.0, high=fastest)
    if spindles:
        most = max(max(map(abs, each.speeds)) for each in spindles.values())
        tip = "Of the spindle; the button chooses the way round"
        yield Number("spindle_speed", "Spindle speed", tip, 0.1 * most, unit="rev/min", above=0.0, high=most)
    if axes:
        yield Choice("goal_axis", "Axis", "Which one goes", next(iter(axes)), {name: name for name in axes})
        yield Number("goal", "Position", "Where it goes, at the speed above; within its travel", 0.0, unit="mm or °")
    names = {"all": "all"} | {name: name for name in axes}
    yield Choice("home_axis", "Axes to home", "One after the other, Z first; the others have no power", "all", names)
    tip = "Homing mode of CiA 402 drives, object 0x6098; an axis whose [bus.cia402] table gives one keeps that"
    yield Choice("method", "Homing method", tip, "17", HOMING)


_WAYS = {"hold": "while held", "step": "by step"}


class Jog:
    """The hand on a session's machine. `begin()` takes the machine, `end()` lets it go; between, axes can be moved.

    `positions` and `speeds` (of spindles, rev/min) are the machine's own, measured; `error` says why the loop ended,
    where it did by itself. `dialect` is what the modules speak, `left_out` the axes that can't be jogged in it and why,
    `homing` the axis that is being homed, `homed` those that were since the machine was taken.
    """

    def __init__(self, session: Session):
        self.session = session
        self.machine: Machine = load_machine(session.machine)
        self.axes = jog_axes(self.machine)
        self.spindles = jog_spindles(self.machine)
        self.choices = session.choices("jog", _fields(self.axes, self.spindles))
        self.positions: dict[str, float] = {}
        self._places: dict[str, float] = {}  # where the axes are held, of which what is measured is some counts off
        self._stepped: dict[str, float] = {}  # where the axis comes to that goes by steps, if that was the last order
        self.speeds: dict[str, float] = {}
        self.left_out: dict[str, str] = {}
        self.dialect = ""
        self.moving = False
        self.homing = ""
        self.homed: set[str] = set()
        self.error = ""
        self._loop: subprocess.Popen[str] | None = None
        self._server: subprocess.Popen[bytes] | None = None
        self._ends: list[weakref.finalize[Any, Any]] = []
        self._taking: Task[None] | None = None  # what takes the machine now
        self._lock = threading.Lock()

    @property
    def ready(self) -> bool:
        """Whether axes can be moved now."""
        return bool(self.positions or self.speeds) and self._loop is not None and self._loop.poll() is None

    @property
    def finds_home(self) -> bool:
        """Whether the modules have a homing of their own, as drives do."""
        return self.ready and self.dialect == "cia402"

    def check(self, name: str | None = None) -> None:
        """InputError where nothing can be jogged, or no axis and no spindle has this name."""
        there = [*self.axes, *self.spindles]
        if not there:
            raise InputError(
                "nothing of this machine can be jogged: it has no spindle, and no axis with limits or a model with K"
            )
        if name not in (None, *there):
            raise InputError(f"there is nothing called {name!r} to jog; there are {', '.join(there)}")

    def begin(self) -> Task[None]:
        """Take the machine, and hold its axes where they are. InputError where it is in use or cannot be jogged."""
        self.check()
        self._taking = self.session.work_on_machine(self, "taking the machine", self._begin, held_for="jogging")
        return self._taking

    def _begin(self, task: Task[None]) -> None:
        try:
            self.positions, self.speeds, self.left_out, self.homed, self.error = {}, {}, {}, set(), ""
            bus = dict(self.session.bus)
            if (fault := bus_fault(bus)) is not None:
                raise TomlTable(bus, name="bus").fault(*fault)
            if "faults" in bus:
                raise InputError("[bus] faults are injected in runs; take them out of the table to jog")
            if bus.get("dialect") == "cia402":
                from rds.bus.modules.cia402.settings import read_settings

                read_settings(bus.get("cia402", {}), self.machine)  # refused here, before anything is started
            interface = bus["interface"] = bus_interface(self.machine, bus)
            if interface in (BUILTIN, SERIAL):
                bus["channel"] = bus.get("channel") or self.machine.channel
            task.note = "looking for the machine"
            self.dialect = self._dialect(bus)
            task.advance(1, 3, "starting the loop")
            words = [self.machine.path, self.dialect, json.dumps(bus, default=str)]
            command = [sys.executable, "-P", "-m", "rds.panels.jog.loop", *words]
            self._loop = loop = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
            )
            self._ends.append(weakref.finalize(self, _end_loop, loop))
            threading.Thread(target=_listen, args=(weakref.ref(self), loop), name="rds jog", daemon=True).start()
            deadline = time.monotonic() + _STARTS_IN
            while not (self.positions or self.speeds):
                task.advance(2, 3, "waiting for the axes")
                if self.error or loop.poll() is not None or time.monotonic() > deadline:
                    time.sleep(0.1)  # its last words
                    raise MachineError(self.error or "the loop that jogs did not start")
                time.sleep(0.02)
            task.advance(3, 3)
        except BaseException:
            self._let_go()
            raise
        finally:
            self._taking = None

    def _dialect(self, bus: Mapping[str, Any]) -> str:
        """What the modules speak; where none answers on the built-in bus, simulated ones are started for it."""
        from rds.bus.hub.address import channels
        from rds.bus.modules.dialects import DEFAULT, check_dialect, find_dialect
        from rds.bus.modules.server_process import end_server, start_server
        from rds.modes.process.machine import TIMING

        interface, channel, wanted = bus["interface"], bus.get("channel"), bus.get("dialect")
        name = bus_name(interface, channel)
        if wanted is not None:
            check_dialect(wanted)
        if interface == SERIAL and wanted in (None, *SERIAL_DIALECTS):
            return self._serial_line(str(channel), bus)
        if interface != BUILTIN or channel in channels():
            options = self.session.bus_options
            found = find_dialect(self.machine, interface, channel, wanted or DEFAULT, **options)
            if found is not None and wanted not in (None, found):
                raise InputError(f'what answers on bus {name} speaks {found}, and [bus] says dialect = "{wanted}"')
            if found is not None:
                return found
        if interface == BUILTIN:  # a bus that outlives its modules for a moment included
            timing = {key: bus[key] for key in TIMING if key in bus}
            self._server = start_server(wanted or DEFAULT, self.machine.path, str(channel), timing)
            self._ends.append(weakref.finalize(self, end_server, self._server))
            return wanted or DEFAULT
        raise MachineError(f"no module of {self.machine.name} answers on {name}; switch it on")

    def _serial_line(self, channel: str, bus: Mapping[str, Any]) -> str:
        """The units of a serial line; where none answers, simulated ones are started for it."""
        from rds.bus.hub.bus_settings import OF_OWN_LINE
        from rds.bus.modules.dcs.calling import find_units
        from rds.bus.modules.dcs.port import is_device
        from rds.bus.modules.server_process import end_server, start_server

        (dialect,) = SERIAL_DIALECTS
        if find_units(self.machine, channel, bus.get("baud")):
            return dialect
        if is_device(channel):
            raise MachineError(
                f"no unit of {self.machine.name} answers on {channel}; check power, cable and [bus] baud"
            )
        words = {key: bus[key] for key in ("baud", *OF_OWN_LINE) if key in bus}
        self._server = start_server(dialect, self.machine.path, channel, words)
        self._ends.append(weakref.finalize(self, end_server, self._server))
        return dialect

    def end(self) -> None:
        """Let the machine go: no voltage, drives by a quick stop. Nothing where it is not taken.

        While it is being taken that is given up first: else it would have the machine after all, when all is over here.
        """
        if (taking := self._taking) is not None:
            taking.stop()
            taking.wait(_STARTS_IN)
        self._let_go()

    def _let_go(self) -> None:
        ends, self._ends = self._ends, []
        self._loop = None  # first: that it ends now is no error
        for end in reversed(ends):  # the loop before the modules that it tells to stand
            end()
        self._server = None
        self.positions, self.speeds, self._stepped, self.moving, self.homing = {}, {}, {}, False, ""
        self.session.give_machine_back(self)

    stop = end  # what the emergency stop calls

    # motions

    def hold(self, axis: str, direction: int) -> None:
        """Move the axis towards an end of its travel; it stops unless this is said again within 0.2 s."""
        self._order(hold=self._axis(axis).name, direction=direction)

    def rest(self) -> None:
        """Bring the axes to rest, within their accelerations. Spindles turn on."""
        if self.ready:
            self._order(rest=True)

    def halt(self) -> None:
        """Bring everything to rest: axes, spindles, and a homing, which leaves its axis without power."""
        if self.ready:
            self._order(halt=True)

    def step(self, axis: str, direction: int) -> None:
        """Move by the step chosen, from where the axis is held, or will be after the steps before.

        InputError where that leaves the travel.
        """
        start = self._stepped.get(axis, self._places.get(axis, 0.0))
        goal = start + direction * float(self.choices["step"])
        self.go(axis, goal)
        self._stepped = {axis: goal}

    def go(self, axis: str, goal: float, speed: float | None = None) -> None:
        """Move to a position, at `speed` or that which is chosen. InputError where it is out of the travel."""
        known = self._axis(axis)
        low, high = known.travel
        place = self.positions.get(axis, 0.0)
        way = 1 if goal > place else -1
        if not (goal - known.end(place, way)) * way <= 0.0:  # false for NaN too
            raise InputError(
                f"{axis} would leave its travel, {low:g} to {high:g} {known.unit}, at {goal:.3f}; choose one inside"
            )
        if speed is not None:
            speed = Number("speed", "Speed", "", unit=f"{known.unit}/s", above=0.0, high=known.speed).check(speed)
        self._order(goals=[[axis, goal]], speed=speed)

    def home(self) -> None:
        """All axes to their zero, or the end of the travel next to it, one after the other, Z first."""
        order = sorted((self.axes[name] for name in self.positions), key=lambda axis: axis.name != "Z")
        self._order(goals=[[axis.name, min(max(0.0, axis.travel[0]), axis.travel[1])] for axis in order])

    def find_home(self, axes: Iterable[str] | None = None, method: int | None = None) -> None:
        """Let the drives of `axes` (default: all) find their home by homing mode 6, one after the other, Z first.

        `method` is by default the one that a `[bus.cia402]` table of the session gives, else the one that is chosen.
        The other axes have no power meanwhile. InputError where the modules are no drives, a spindle turns, or the
        table gives another method.
        """
        if self.ready and not self.finds_home:
            raise InputError(
                f"modules that speak {self.dialect} have no homing of their own, which is the drives' (cia402); "
                "Home moves the axes to their zero"
            )
        if any(abs(speed) > _STANDS * self.spindles[name].speeds[1] for name, speed in self.speeds.items()):
            raise InputError("a spindle turns; stop it first: nothing else has power while a drive is homed")
        names = [self._axis(name).name for name in (self.positions if axes is None else axes)]
        self._order(home={name: self._method(name, method) for name in names})

    def _method(self, name: str, method: int | None) -> int:
        """The homing method for an axis."""
        own = self.session.bus.get("cia402", {}).get("axis", {}).get(name, {}).get("homing")
        if own is not None:
            if method not in (None, own):
                raise InputError(f"[bus.cia402.axis.{name}] says homing = {own}, not {method}; change it there")
            return int(own)
        wanted = self.choices["method"] if method is None else str(method)
        return int(Choice("method", "Homing method", "", "", HOMING).check(wanted))

    def turn(self, spindle: str, direction: int, speed: float | None = None) -> None:
        """Turn a spindle at `speed` (rev/min) or that which is chosen; it stops unless this is said again within 1 s.

        InputError for a speed beyond the spindle's own, and while an axis is homed.
        """
        self.check(spindle)
        if spindle not in self.spindles:
            raise InputError(f"{spindle} is an axis, which is moved, not turned")
        if spindle in self.left_out:
            raise InputError(f"{spindle} cannot be jogged: {self.left_out[spindle]}")
        if self.homing:
            raise InputError(f"{self.homing} is being homed; wait until it is, or stop it")
        wanted = direction * (self.choices["spindle_speed"] if speed is None else speed)
        low, high = self.spindles[spindle].speeds
        if not low <= wanted <= high:  # false for NaN too
            raise InputError(f"{spindle} turns at {low:g} to {high:g} rev/min, not at {wanted:g}")
        self._order(turn=spindle, speed=wanted)

    def still(self, spindle: str) -> None:
        """Bring a spindle to rest."""
        if self.ready and not self.homing:
            self._order(turn=spindle, speed=0.0)

    def _axis(self, name: str) -> JogAxis:
        self.check(name)
        if name in self.spindles:
            raise InputError(f"{name} is a spindle, which is turned, not moved")
        if name in self.left_out:
            raise InputError(f"{name} cannot be jogged: {self.left_out[name]}")
        return self.axes[name]

    def _order(self, *, speed: float | None = None, **order: Any) -> None:
        loop = self._loop
        if not self.ready or loop is None or loop.stdin is None:
            raise InputError(self.error or "the machine is not taken yet: press Take the machine first")
        try:
            with self._lock:
                order |= {"speed": self.choices["speed"] if speed is None else speed, "at": time.monotonic()}
                if "turn" not in order:
                    self._stepped = {}
                loop.stdin.write(json.dumps(order) + "\n")
                loop.stdin.flush()
        except OSError as error:
            raise MachineError(self.error or _ENDED) from error

    def _hear(self, words: Mapping[str, Any]) -> None:
        if "error" in words:
            self.error = str(words["error"])
        elif "travel" in words:
            for name, travel in words["travel"].items():
                self.axes[name] = replace(self.axes[name], travel=tuple(travel))
            self.left_out = dict(words["left_out"])
        elif "late" in words:
            self._stepped = {}
            self.session.say(refusal("The motion", words["late"]), "warning")
        elif "homed" in words:
            self.homed |= set(words["homed"])
        else:
            measured, self._places = words["measured"], words["places"]
            self.positions = {name: measured[name] for name in self.axes if name in measured}
            self.speeds = {name: measured[name] for name in self.spindles if name in measured}
            self.moving, self.homing = bool(words["moving"]), str(words["homing"])


def _listen(jog: weakref.ref[Jog], loop: subprocess.Popen[str]) -> None:
    """What the loop says, for as long as somebody jogs."""
    assert loop.stdout is not None
    for line in loop.stdout:
        mine = jog()
        if mine is None or mine._loop is not loop:
            break
        try:
            words = json.loads(line)
        except ValueError:
            words = None
        if isinstance(words, dict):  # there are interfaces of python-can that print
            mine._hear(words)
        del mine
    loop.wait()
    if (mine := jog()) is not None and mine._loop is loop:  # it ended by itself
        mine.moving, mine.homing = False, ""
        mine.error = mine.error or _ENDED
        mine.session.give_machine_back(mine)


def _end_loop(loop: subprocess.Popen[str]) -> None:
    """Its orders end, so it takes the voltage off and ends."""
    assert loop.stdin is not None
    try:
        loop.stdin.close()
        loop.wait(_ENDS_IN)
    except (OSError, subprocess.TimeoutExpired):
        loop.kill()
        loop.wait()
