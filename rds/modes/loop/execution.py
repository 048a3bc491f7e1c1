"""A part program carried out sample by sample: where the axes should be now, whatever an operator wishes.

The path is followed at the rate of the override, or brought to rest on it (hold, stop, home). Where it rests by
itself, the program dwells, waits for the spindle's speed, or for somebody to let it go on (M0, M1, tool change).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Protocol

from rds.core.shared_quantities import FREE_FEED, TIED_FEED
from rds.core.types import Ending
from rds.modes.loop.changes import STOP
from rds.modes.loop.force_guard import MOST, Cell
from rds.modes.loop.homing import Homing
from rds.modes.loop.laws import LiveReference
from rds.modes.loop.program import (
    HOLD,
    HOME,
    OPTIONAL_STOP,
    OVERRIDE,
    RESUME,
    SINGLE_STEP,
    STEP,
    InterpolatedProgram,
    Program,
    ProgramEvent,
    dwell_samples,
)

SPINDLE_WITHIN = 0.02  # of its speed, or two counts: at speed
SPINDLE_STEADY = 10  # samples in a row at speed
SPINDLE_PATIENCE = 10.0  # s until it should be


class State(IntEnum):
    """What a program does at a sample: the column `program_state` of its record."""

    RUNS = 0
    HELD = 1
    STOP = 2  # M0, M1
    TOOL = 3  # a change by hand
    DWELL = 4
    SPINDLE = 5  # waits for its speed
    HOME = 6
    OVER = 7


class Follower(Protocol):
    """Moves along planned samples at a rate that changes no faster than the axes can follow."""

    place: float  # in samples
    rate: float
    position: list[float]
    velocity: list[float]
    acceleration: list[float]
    last: int  # the last sample of the path, as far as it is known

    @property
    def happenings(self) -> Sequence[ProgramEvent]:
        """What happens along the path, in order, as far as it is known."""

    def line(self, sample: int) -> int:
        """The program line of a sample."""

    def columns(self) -> tuple[float, ...]:
        """What else is recorded of where it is."""

    def advance(self, wanted: float, until: int) -> None:
        """One sample period, at a rate that goes towards `wanted`; not beyond the sample `until`, a place of rest."""

    def settle(self, wanted: float) -> None:
        """Take the rate `wanted` at once, where the path rests."""


class Execution:
    """A program that has begun.

    `references` are set at each sample, those of the program's axes in order and then the spindle's, which is axis
    number `spindle_axis` of the run. `expects(names)` says whether one of these live values can still change. `cell` is
    the machine's load cell, for the program's guard.
    """

    def __init__(
        self,
        program: Program | InterpolatedProgram,
        T: float,
        follower: Follower,
        references: Sequence[LiveReference],
        spindle_axis: int | None,
        resolution: float,
        expects: Callable[[Sequence[str]], bool],
        cell: Cell | None = None,
    ):
        self._program, self._T, self._follower = program, T, follower
        self._references, self._spindle_axis, self._resolution = references, spindle_axis, resolution
        self._expects = expects
        self._is_made = isinstance(program, InterpolatedProgram)
        self._values = {OVERRIDE: 1.0, HOLD: 0.0, RESUME: 0.0, HOME: 0.0, OPTIONAL_STOP: 1.0, STOP: 0.0}
        self._values |= {SINGLE_STEP: 1.0} if isinstance(program, Program) and program.steps else {}
        self.state = self._shown = State.RUNS
        self.ending: tuple[Ending, str] | None = None
        self._next = 0  # happening
        self._left = 0  # samples of a dwell, or of patience with the spindle
        self._steady = 0
        self._resumed = 0.0  # the value of resume when a stop began
        self._last = -1  # sample of the run; -1: the program begins
        self._line = self._shown_line = follower.line(min(1, follower.last))  # the first row is at rest
        self._speed = 0.0
        self._turns = False  # the spindle may turn
        self._changes_tool = False  # as soon as the spindle stands
        self._position = list(program.start)
        self._way: Homing | None = None  # home
        guard = program.guard if isinstance(program, Program) else None
        self._guard = None if guard is None else guard.start(T, cell)
        self._allowed = MOST  # rate, by the guard
        self._feed = FREE_FEED  # whose it is
        for reference, value in zip(references, self._position, strict=False):
            reference.position.value = value

    def actions(self) -> dict[str, Callable[[float], None]]:
        """What a new live value does, by channel."""

        def setter(name: str) -> Callable[[float], None]:
            return lambda value: self._values.__setitem__(name, value)

        return {name: setter(name) for name in self._values}

    def law(self, k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        """Comes before the laws of the axes: sets their references, and records where in the program this is.

        Samples that were discarded count: the axes moved on in them. But a path whose rows are made on the way waits in
        them, so that an interpolator that is too slow makes the axes slower, and never sends them ahead in a jump.
        """
        if self._last < 0:
            self._last = 0  # and it does so with its first row
            self._rest()
            self._follower.settle(self._wanted())
            self._happen()
            self._shown_line = self._line
        for _ in range(k - self._last):
            self._step(positions)
            if self._is_made and self.state is State.RUNS:
                break
        self._last = k
        shown = self._shown
        rate = self._follower.rate if shown is State.RUNS else 0.0
        if shown is State.HOME and self._way is not None:
            rate = self._way.rate
        row += (self._shown_line, self._follower.place, rate, shown)
        row += self._follower.columns()
        if self._guard is not None:
            row.append(self._guard.measured if shown is State.RUNS else 0.0)

    def over(self) -> tuple[Ending, str] | None:
        """How the run ends before its next sample, and why, if it does."""
        return self.ending

    def waits(self) -> bool:
        """Whether nothing will happen until an operator does something."""
        if self._values[STOP] or self.ending is not None:
            return False
        if self.state is State.HOME:
            return bool(self._values[HOLD]) and self._way is not None and self._way.rate == 0.0
        if self._values[HOME]:
            return False
        if self.state in (State.STOP, State.TOOL):  # one sample of it is taken first, for others to see
            return self._shown is self.state and self._values[RESUME] == self._resumed
        return self.state is State.HELD and self._wanted() == 0.0

    # --- one sample -----------------------------------------------------------------------------------------------

    def _step(self, positions: Sequence[float]) -> None:
        if self.ending is not None:
            return
        before = self.state
        self._shown_line = self._line
        self._STEPS[before](self, positions)
        # what this sample was spent on; the state may be the next one's already
        self._shown = self.state if before <= State.HELD and self.state <= State.HELD else before

    def _wanted(self) -> float:
        values = self._values
        if values[STOP]:
            return 0.0
        if self._feed == TIED_FEED:
            return 1.0
        if values[HOLD] or values[HOME]:
            return 0.0
        return min(values[OVERRIDE] if self._feed == FREE_FEED else 1.0, self._allowed)

    def _leaves(self) -> bool:
        """Whether the axes are to go home from where they rest; in a thread only where somebody is waited for."""
        return bool(self._values[HOME]) and (self._feed != TIED_FEED or self.state is State.STOP)

    def _along_the_path(self, positions: Sequence[float]) -> None:
        follower, until, wanted = self._follower, self._until(), self._wanted()
        follower.advance(wanted, until)
        if self._guard is not None:
            self._allowed = self._guard.allowed(follower.place, follower.rate)
        self._put(follower.position, follower.velocity, follower.acceleration)
        self._line = self._shown_line = follower.line(-int(-follower.place // 1))
        is_there = follower.place >= until
        is_still = is_there or follower.rate == 0.0
        if is_still and self._values[STOP]:
            self._end(Ending.STOPPED, f"stopped in line {self._line}")
        elif is_still and self._leaves():
            self._go_home()
        elif (not is_there and follower.rate == 0.0 and wanted == 0.0) or self._keeps_from_a_thread():
            self._held()
        else:
            self.state = State.RUNS
            self._happen()

    def _until(self) -> int:
        """The sample at which the path rests next."""
        happenings = self._follower.happenings
        return happenings[self._next].sample if self._next < len(happenings) else self._follower.last

    def _held(self) -> None:
        others = [STOP, HOME, HOLD if self._values[HOLD] else OVERRIDE]
        if self.state is State.HELD and not self._expects(others):
            self._end(Ending.STOPPED, f"held in line {self._line}, and nobody is there to let it go on")
        else:
            self.state = State.HELD

    def _happen(self) -> None:
        """What is due where the path has come to; the last of it ends the program."""
        happenings, place = self._follower.happenings, self._follower.place
        while self._next < len(happenings) and happenings[self._next].sample <= place:
            if self._keeps_from_a_thread():
                self._follower.settle(0.0)
                self._held()
                return
            happening = happenings[self._next]
            self._next += 1
            self._line = happening.line or self._line
            if self._takes_time(happening):
                return
        if self._next >= len(happenings) and self._follower.place >= self._follower.last:
            self._end(Ending.DONE, "")

    def _keeps_from_a_thread(self) -> bool:
        """Whether a thread is due, in which no hold would act, and somebody holds the axes before it."""
        happenings = self._follower.happenings
        if self._next >= len(happenings) or happenings[self._next].sample > self._follower.place:
            return False
        due = happenings[self._next]
        return due.kind == "override" and due.value == TIED_FEED and self._wanted() == 0.0 and not self._values[STOP]

    def _takes_time(self, happening: ProgramEvent) -> bool:
        kind, value = happening.kind, happening.value
        if kind == "dwell":
            self._left = dwell_samples(value, self._T)
            if self._left:
                self.state = State.DWELL
        elif kind == "spindle":
            self._speed = value
            if value:
                self._await_spindle()
        elif kind == "tool" and self._turns:
            self._speed, self._changes_tool = 0.0, True
            self._await_spindle()
        elif kind == "tool" or (kind == "stop" and self._stops(value)):
            self._await_somebody(State.TOOL if kind == "tool" else State.STOP)
        elif kind == "override":
            self._feed = value
            self._follower.settle(self._wanted())
            if self._leaves():
                self._go_home()
        elif kind == "end":
            self._next = len(self._follower.happenings)
            self._end(Ending.DONE, "")
        return self.state is not State.RUNS or self.ending is not None

    def _stops(self, value: float) -> bool:
        if value == STEP:
            return bool(self._values[SINGLE_STEP]) and self._feed != TIED_FEED
        return not value or bool(self._values[OPTIONAL_STOP])

    def _await_spindle(self) -> None:
        if self._spindle_axis is not None:
            self._left, self._steady, self._turns = round(SPINDLE_PATIENCE / self._T), 0, self._speed != 0.0
            self.state = State.SPINDLE

    def _await_somebody(self, state: State) -> None:
        self._resumed = self._values[RESUME]
        self.state = state

    def _interrupted(self) -> bool:
        """Whether somebody wants the end where the axes rest anyhow."""
        if self._values[STOP]:
            self._end(Ending.STOPPED, f"stopped in line {self._line}")
            return True
        if self._leaves():
            self._go_home()
            return True
        return False

    def _dwell(self, positions: Sequence[float]) -> None:
        """A dwell lasts for as many rows as were planned for it, whatever the override."""
        self._rest()
        if not self._interrupted():
            self._follower.place += 1
            self._left -= 1
            if self._left == 0:
                self._go_on()

    def _wait_for_spindle(self, positions: Sequence[float]) -> None:
        self._rest()
        if self._interrupted():
            return
        assert self._spindle_axis is not None
        off = abs(positions[self._spindle_axis] - self._speed)
        is_near = off <= max(SPINDLE_WITHIN * abs(self._speed), 2.0 * self._resolution)
        self._steady = self._steady + 1 if is_near else 0
        self._left -= 1
        if self._steady >= SPINDLE_STEADY and self._changes_tool:
            self._changes_tool = False
            self._await_somebody(State.TOOL)
        elif self._steady >= SPINDLE_STEADY:
            self._go_on()
        elif self._left <= 0:
            said = f"the spindle turns at {positions[self._spindle_axis]:.0f} rev/min"
            self._end(
                Ending.STOPPED,
                f"{said} {SPINDLE_PATIENCE:g} s after line {self._line} asked for {self._speed:g}; check its drive, "
                "its controller and its range",
            )

    def _wait_for_somebody(self, positions: Sequence[float]) -> None:
        self._rest()
        if self._interrupted():
            return
        if self._values[RESUME] != self._resumed or not self._expects([RESUME, STOP, HOME]):
            self._go_on()

    def _go_on(self) -> None:
        """The rest of what is due here; then the path again."""
        self.state = State.RUNS
        self._follower.settle(self._wanted())
        self._happen()

    # --- home -----------------------------------------------------------------------------------------------------

    def _go_home(self) -> None:
        """Up first, then straight to the home position; the spindle stops once the tool is out of the work."""
        program = self._program
        z = program.axes.index("Z") if "Z" in program.axes else None
        self._way = Homing(self._position, program.home, z, program.limits, self._T)
        if len(self._way.legs) < 2:
            self._speed = 0.0
        self.state = State.HOME
        self._rest()

    def _homing(self, positions: Sequence[float]) -> None:
        way = self._way
        assert way is not None
        if not way.legs:
            self._rest()
            self._end(Ending.STOPPED, f"went home from line {self._line}")
            return
        before = len(way.legs)
        self._put(*way.advance(is_wanted=not (self._values[HOLD] or self._values[STOP])))
        if len(way.legs) < before:
            self._speed = 0.0
        if way.rate == 0.0 and self._values[STOP]:
            self._end(Ending.STOPPED, f"stopped on the way home from line {self._line}")
        elif way.rate == 0.0 and self._values[HOLD] and not self._expects([STOP, HOLD]):
            self._end(Ending.STOPPED, "held on the way home, and nobody is there to let it go on")

    # --- what the laws see ----------------------------------------------------------------------------------------

    def _rest(self) -> None:
        self._put(self._position, [0.0] * len(self._position), [0.0] * len(self._position))

    def _put(self, position: Sequence[float], velocity: Sequence[float], acceleration: Sequence[float]) -> None:
        self._position = list(position)
        for reference, p, v, a in zip(self._references, position, velocity, acceleration, strict=False):
            reference.position.value = p
            reference.velocity.value = v
            reference.acceleration.value = a
        if self._spindle_axis is not None:
            self._references[-1].position.value = self._speed

    def _end(self, ending: Ending, reason: str) -> None:
        if self._spindle_axis is not None:
            self._references[-1].position.value = self._speed  # a program's last M5 acts at its last sample
        self.ending = (ending, reason)
        self.state = State.OVER

    _STEPS = {  # noqa: RUF012  (a table of methods)
        State.RUNS: _along_the_path,
        State.HELD: _along_the_path,
        State.STOP: _wait_for_somebody,
        State.TOOL: _wait_for_somebody,
        State.DWELL: _dwell,
        State.SPINDLE: _wait_for_spindle,
        State.HOME: _homing,
    }
