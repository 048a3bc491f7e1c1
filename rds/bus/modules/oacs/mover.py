"""Motions that a module makes by itself: to a point, by a distance, jog, home, and a tool's running.

One motion at a time. `step` is called by the plant every millisecond of bus time; the motion ends with a result, which
the module acknowledges once the axis stands. Whatever ends it, the motor driver gets zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from rds.bus.modules.oacs import pid
from rds.bus.modules.oacs.codes import DUTY, Acknowledges, Mode, Result
from rds.bus.modules.oacs.pid import Tuning
from rds.bus.modules.oacs.plant import STEP, Plant

STALL = 3.0  # s without a count until the motion is given up
STILL = 0.1  # s without a count until the axis counts as standing
HOST_SILENCE = 2.0  # s without a word of the host until the motion ends
HOMING_DUTY = 200.0
LEAVES = 0.05  # of the travel: off a limit switch within this way, or its wire is broken
FARTHEST = 1.2  # of the travel: a switch that a homing has not found within this way does not open
SAME_EDGE = 8  # counts, and the way of SAME_TIME: a limit switch closes where it opened, a wire anywhere
SAME_TIME = 3.0 * STEP  # s: both edges are noted at the end of a step
LONGEST_JOG = 60.0  # s
_TOOL_STILL = 0.5  # rev/min
_AT_START = pid.Memory()


@dataclass
class Motion:
    """A motion under way."""

    mode: Mode
    answers: Acknowledges  # to which command the last acknowledgement belongs
    since: float  # s
    direction: int = 0  # +1 clockwise (counts up), -1
    target: float = 0.0  # counts
    ends: float = inf  # s
    duty: float = 0.0  # of a jog, a homing or a tool
    memory: pid.Memory = _AT_START
    next_sample: float = 0.0  # s
    last_count: int = 0
    last_change: float = 0.0  # s
    result: Result = Result.CARRIED_OUT  # once it settles
    settling: bool = False
    trips: int = 0  # of the limit switches, at its beginning
    found: bool = False  # of a homing: the zero
    turned: int = 0  # where a homing began to leave the switch, counts
    shift: int = 0  # by how much it has moved the zero, counts


class Mover:
    """The motions of one module's axis."""

    def __init__(self, plant: Plant):
        self.plant = plant
        self.tuning = Tuning()
        self.motion: Motion | None = None
        self.homed = False
        self.last_result = Result.CARRIED_OUT
        self.heard = plant.now  # when the host last said something, s
        self.finished: list[tuple[Acknowledges, Result]] = []  # to acknowledge
        plant.watch = self.step

    @property
    def mode(self) -> Mode:
        """What goes on."""
        if self.plant.emergency:
            return Mode.EMERGENCY
        if self.motion is None:
            return Mode.IDLE
        return Mode.SETTLING if self.motion.settling else self.motion.mode

    # --- beginning and ending; each returns what to acknowledge at once

    def move(self, target: float, at: float, answers: Acknowledges) -> Result:
        """To the position `target` (unit)."""
        data = self.plant.data
        if not data.lowest - 1e-6 <= target <= data.highest + 1e-6:
            return Result.OUTSIDE_TRAVEL
        counts = round(target * data.counts_per_unit)
        direction = 1 if counts > self.plant.counts else -1
        return self._begin(Motion(Mode.MOVING, answers, at, direction, counts))

    def jog(self, direction: int, duty: float, seconds: float, at: float) -> Result:
        """With constant duty (0: full) for a time, or until stopped."""
        if not 0 < seconds <= LONGEST_JOG:
            return Result.BAD_VALUE
        motion = Motion(Mode.JOGGING, Acknowledges.JOG, at, direction, ends=at + seconds, duty=duty or DUTY)
        return self._begin(motion)

    def run(self, speed: float, at: float) -> Result:
        """A tool: run at `speed`, rev/min; the duty is its share of the highest speed, for a tool has no controller."""
        data = self.plant.data
        if not data.lowest <= speed <= data.highest:
            return Result.OUTSIDE_TRAVEL
        share = abs(speed) / (data.highest if speed > 0 else -data.lowest)
        motion = Motion(Mode.RUNNING, Acknowledges.START, at, 1 if speed > 0 else -1, duty=share * DUTY)
        return self._begin(motion)

    def home(self, at: float) -> Result:
        """Onto the lower limit switch, whose place is known, and off again. Without switches: the zero is here."""
        if self.plant.tool:
            return Result.NOT_FOR_THIS_MODULE
        if not self.plant.switches:
            if self.motion is not None:
                return Result.BUSY
            self.plant.counter.set(0)
            self.homed = True
            self._close(Acknowledges.HOME, Result.CARRIED_OUT)
            return Result.ACCEPTED
        low = self.plant.switches[0].open
        result = self._begin(Motion(Mode.HOMING, Acknowledges.HOME, at, 1 if low else -1, duty=HOMING_DUTY))
        self.homed = self.homed and result != Result.ACCEPTED  # till it is found anew
        return result

    def switch_direction(self, at: float) -> Result:
        """What is left of the way, the other way; a jog or a tool turns round."""
        motion, plant = self.motion, self.plant
        if motion is None or motion.settling or motion.mode == Mode.HOMING:
            return Result.NOTHING_MOVES
        if motion.mode == Mode.MOVING:
            target = 2 * plant.counts - motion.target
            data = plant.data
            if not data.lowest <= target / data.counts_per_unit <= data.highest:
                return Result.OUTSIDE_TRAVEL
            motion.target, motion.memory, motion.next_sample = target, pid.Memory(), at
        motion.direction = -motion.direction
        motion.last_change = at
        if plant.allowed(float(motion.direction)) == 0.0:
            self._settle(Result.AT_LIMIT, at)
        elif motion.mode != Mode.MOVING:
            plant.drive(motion.direction * motion.duty, at)
        return Result.CARRIED_OUT

    def stop(self, result: Result, at: float) -> None:
        """End the motion, if there is one, with this result; zero volts now."""
        if self.motion is not None and not self.motion.settling:
            self._settle(result, at)
        elif self.motion is None:
            self.plant.drive(0.0, at)

    def give_way(self) -> None:
        """The host's cyclic commands take the axis over: the motion ends here and now."""
        if self.motion is not None:
            self._close(self.motion.answers, Result.HOST_COMMANDS)
            self.plant.drive(0.0, self.plant.now)

    def _begin(self, motion: Motion) -> Result:
        plant = self.plant
        if plant.emergency:
            return Result.EMERGENCY_LATCHED
        if self.motion is not None:
            return Result.BUSY
        if plant.allowed(float(motion.direction)) == 0.0:
            return Result.AT_LIMIT
        at = motion.since
        motion.last_count, motion.last_change, motion.next_sample, motion.trips = plant.counts, at, at, plant.trips
        motion.turned = plant.counts
        self.motion = motion
        self.plant.awake = True
        if motion.mode != Mode.MOVING:
            plant.drive(motion.direction * motion.duty, at)
        return Result.ACCEPTED

    # --- under way

    def step(self, now: float) -> None:
        """Look after the motion at the instant `now`, to which the plant has just moved."""
        motion = self.motion
        if motion is None or now < motion.since:
            return
        counts = self.plant.counts
        if counts != motion.last_count:
            motion.last_count, motion.last_change = counts, now
        if motion.settling:
            standing = abs(self.plant.velocity) < _TOOL_STILL if self.plant.tool else now - motion.last_change >= STILL
            if standing:
                self._close(motion.answers, motion.result)
        elif self.plant.emergency:
            self._settle(Result.STOPPED_BY_EMERGENCY, now)
        elif now - self.heard > HOST_SILENCE:
            self._settle(Result.HOST_SILENT, now)
        elif motion.mode == Mode.HOMING:
            self._step_home(motion, now)
        elif self.plant.trips != motion.trips:
            self._settle(Result.STOPPED_BY_LIMIT, now)
        elif motion.mode == Mode.MOVING:
            self._step_move(motion, counts, now)
        elif now >= motion.ends:
            self._settle(Result.CARRIED_OUT, now)

    def _step_move(self, motion: Motion, counts: int, now: float) -> None:
        left = (motion.target - counts) * motion.direction
        braked = self.tuning.output_low < 0.0  # the motor brakes, so the controller brings the axis to the point
        if (abs(left) if braked else left) <= self.tuning.tolerance:
            if not braked or now - motion.last_change >= STILL or abs(self.plant.velocity) == 0.0:
                self._settle(Result.CARRIED_OUT, now)
                return
        elif now - motion.last_change > STALL:
            self._settle(Result.STALLED, now)
            return
        if now >= motion.next_sample - 1e-9:
            output, motion.memory = pid.step(left, motion.memory, self.tuning)
            motion.next_sample += self.tuning.sample_time
            self.plant.drive(output * motion.direction, now)

    def _step_home(self, motion: Motion, now: float) -> None:
        plant = self.plant
        low, high = plant.switches
        travel = (plant.data.highest - plant.data.lowest) * plant.data.counts_per_unit
        if high.open or now - motion.last_change > STALL:
            self._settle(Result.STOPPED_BY_LIMIT if high.open else Result.STALLED, now)
        elif motion.direction < 0 and low.open:
            # where the edge was, not where the debouncing ended
            motion.shift = round(low.position * plant.data.counts_per_unit) - low.mark
            plant.counter.set(plant.counts + motion.shift)
            motion.found, motion.turned = True, plant.counts
            motion.direction = 1
            motion.last_change = now
            plant.drive(motion.duty, now)
        elif motion.direction < 0:
            if motion.turned - plant.counts > FARTHEST * travel:
                self._settle(Result.STOPPED_BY_LIMIT, now)
        elif low.open:
            if plant.counts - motion.turned > LEAVES * travel:  # what opened was a wire: the zero is not here
                self._settle(Result.STOPPED_BY_LIMIT, now)
        else:
            edge = round(low.position * plant.data.counts_per_unit)
            near = SAME_EDGE + SAME_TIME * abs(plant.velocity) * plant.data.counts_per_unit
            if motion.found and abs(low.mark - edge) > near:  # what opened and closed was a wire
                self._settle(Result.STOPPED_BY_LIMIT, now)
            elif motion.found:
                self.homed = True
                self._settle(Result.CARRIED_OUT, now)
            else:  # it stood on the switch at the start: now approach it
                motion.direction = -1
                plant.drive(-motion.duty, now)

    def _settle(self, result: Result, at: float) -> None:
        assert self.motion is not None
        self.motion.settling = True
        self.motion.result = result
        self.motion.last_change = at
        self.plant.drive(0.0, at)

    def _close(self, answers: Acknowledges, result: Result) -> None:
        if self.motion is not None and self.motion.shift and result != Result.CARRIED_OUT:
            self.plant.counter.set(self.plant.counts - self.motion.shift)  # the zero of a homing that failed is none
        self.finished.append((answers, result))
        self.last_result = result
        self.motion = None
        self.plant.awake = False
