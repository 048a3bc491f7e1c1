"""One module as the host commands it: information, tuning, motions, recorded steps; each call waits for its answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import can

from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.codes import (
    THOUSAND,
    Acknowledges,
    Code,
    Kind,
    MessageToHost,
    Move,
    Parameter,
    Quantity,
    Select,
)
from rds.bus.modules.oacs.codes import Result as Ended
from rds.bus.modules.oacs.iso_tp import fetch
from rds.bus.modules.oacs.link import CommandEnd, Conversation
from rds.bus.modules.oacs.messaging import ReceivedMessage
from rds.bus.modules.oacs.pid import FIELDS, Tuning
from rds.bus.modules.oacs.recording import PositionRecorder, ReadingsRecorder
from rds.bus.modules.oacs.refusals import REASONS, reason
from rds.bus.modules.oacs.transfer import ModuleDescription, decode_description
from rds.bus.tools.link import bus_failed
from rds.core.errors import InputError, MachineError
from rds.core.progress import Progress
from rds.results import Result

SETTLED = 1.0  # s without a change worth the name until a recorded step counts as settled
_SLACK = 10.0  # s that a motion may take beyond twice its way at the slowest speed


@dataclass(frozen=True)
class Information:
    """What a module says of itself: its data, and the tuning in force."""

    number: int
    description: ModuleDescription
    tuning: Tuning

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        tuning = asdict(self.tuning) | {"controller": self.tuning.controller.name}
        description = asdict(self.description) | {"kind": self.description.kind.name.lower()}
        description["version"] = self.description.version
        return {"number": self.number, **description, "unit": self.description.unit, "tuning": tuning}


class Module:
    """The module `number` on an open `bus`, which stays the caller's and which nobody else may read meanwhile."""

    def __init__(self, bus: can.BusABC, number: int, name: str = ""):
        self._bus = bus
        self._link = Conversation(bus, number, name)
        self._description: ModuleDescription | None = None
        self._started: tuple[str, Acknowledges] | None = None
        self.number = number

    @property
    def status(self) -> dict[str, Any]:
        """The fields of its status message, asked now: limit switches, emergency stop, counts missing..."""
        self._link.drain()
        self._link.send(Code=Code.READ_PARAMETER, ReadIndex=Parameter.SELECT)
        return self._link.wait_for(lambda m: m.kind == "Status", "to say its status").message.fields

    # --- what it is

    def download(self, timeout: float = 1.0) -> ModuleDescription:
        """Its data, downloaded now. MachineError if it does not answer or its data are damaged."""
        frame = messages.encode("Command", self.number, Code=Code.DATA_CALL)
        request = can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)
        try:
            self._description = decode_description(fetch(self._bus, self.number, request, timeout))
        except (can.CanError, OSError) as error:
            raise bus_failed(self._bus.channel_info, error) from error
        except MachineError as error:
            raise MachineError(f"{self._link.name}: {error}") from error
        return self._description

    @property
    def description(self) -> ModuleDescription:
        """Its data, downloaded when first needed."""
        return self._description or self.download()

    def info(self) -> Information:
        """Its data and its tuning, both asked now."""
        return Information(self.number, self.download(), self.tuning())

    # --- tuning

    def tuning(self) -> Tuning:
        """The tuning in force."""
        values: dict[str, Any] = {}
        for parameter, name in FIELDS.items():
            self._link.drain()
            self._link.send(Code=Code.READ_PARAMETER, ReadIndex=parameter)
            heard = self._link.wait_for(
                lambda m, p=parameter: m.kind == "Parameter" and m.fields["Parameter"] == p,  # type: ignore[misc]
                f"to say its {name}",
            )
            values[name] = float(f"{heard.message.fields['ParameterValue']:.7g}")  # as precise as float32
            values["controller"] = Select(heard.message.fields["Selection"])
        return Tuning(**values)

    def tune(self, controller: str | None = None, **parameters: float) -> Tuning:
        """Select P, PI or PID and set the parameters given (fields of `Tuning`), all at once; return what is in force.

        A module knows PI and PID: P, the first row of table 11, is PI with Ki = 0. InputError for what cannot be;
        MachineError if the module refuses. A motion under way must end first.
        """
        if controller is not None and controller.upper() == "P":
            if parameters.get("Ki"):
                raise InputError(f"controller P has no Ki, and Ki = {parameters['Ki']:g} is given; use PI")
            controller, parameters = "PI", {**parameters, "Ki": 0.0}
        before = self.tuning()
        numbers = {name: parameter for parameter, name in FIELDS.items()}
        wanted = before
        for name, value in parameters.items():
            if name not in numbers:
                raise InputError(f"there is no tuning parameter {name!r}; there are {', '.join(numbers)}")
            wanted = wanted.with_parameter(numbers[name], value)
        if controller is not None:
            if controller.upper() not in Select.__members__:
                raise InputError(f"controller {controller!r} must be P, PI or PID")
            wanted = wanted.with_controller(Select[controller.upper()])
        command = self._link.command
        for name in parameters:
            value = float(getattr(wanted, name))
            what = f"{name} = {value:g}"
            number = numbers[name]
            command(what, Acknowledges.PARAMETER, Code=Code.SET_PARAMETER, Parameter=number, ParameterValue=value)
        what = f"to use {wanted.controller.name}"
        fields = {"Code": Code.SET_PARAMETER, "Parameter": Parameter.SELECT, "Selection": wanted.controller}
        command(what, Acknowledges.PARAMETER, **fields)
        return self.tuning()

    # --- motions

    def move(
        self,
        by: float | None = None,
        to: float | None = None,
        timeout: float | None = None,
        progress: Callable[[float], None] = lambda position: None,
    ) -> float:
        """Move by a distance or to a point (mm, degrees), wait until it stands, and return where.

        `by` is positive clockwise. Raises InputError unless exactly one is given, MachineError if the module refuses,
        fails, or takes more than `timeout` s (default: by its speed); it is stopped then. `progress` is called with
        where it stands, ten times a second. A tool has jog() and start().
        """
        self._check_axis("move to a point or by a distance")
        what, answers = self._start(by, to)
        with self._followed(progress):
            done = self._link.finish(what, answers, self._patience(by, to) if timeout is None else timeout)
        return done.counts * self.description.resolution

    def start(self, by: float | None = None, to: float | None = None) -> None:
        """Start such a motion, or a tool at `by` rev/min, and return. The module stops by itself when it has heard
        nothing of the host for 2 s: wait() or a `Watch` keeps it alive."""
        self._started = self._start(by, to)

    def wait(self, timeout: float) -> float:
        """Wait for the end of the motion that start() began; return where the axis stands. Errors as of move()."""
        if self._started is None:
            raise InputError("nothing was started; call start() first")
        what, answers = self._started
        return self._link.finish(what, answers, timeout).counts * self.description.resolution

    def stop(self) -> CommandEnd:
        """Zero volts now."""
        return self._link.command("to stop", Acknowledges.STOP, Code=Code.MOVE, Move=Move.STOP)

    def switch_direction(self) -> CommandEnd:
        """What is left of the motion under way, the other way round; a tool or a jog turns round."""
        what, move = "to switch its direction", Move.SWITCH_DIRECTION
        return self._link.command(what, Acknowledges.SWITCH_DIRECTION, Code=Code.MOVE, Move=move)

    def jog(self, direction: int, seconds: float, duty: float = 1.0) -> float:
        """Run clockwise (+1) or counter-clockwise (-1) for `seconds` with a share `duty` of the supply; return where
        it stands then. The time is part of the command: it also ends if the host does. A tool turns with that share of
        its highest speed, and its speed at the end is returned; it stops by itself 2 s after the host's last word."""
        if direction not in (1, -1) or not 0 < duty <= 1 or not 0 < seconds <= 60:
            raise InputError(
                f"jog(direction={direction!r}, seconds={seconds!r}, duty={duty!r}): direction must be 1 or -1, seconds "
                "more than 0 and at most 60, duty more than 0 and at most 1"
            )
        if self.description.kind == Kind.TOOL:
            return self._turn(direction, seconds, duty)
        what = f"to jog for {seconds:g} s"
        fields = {"Code": Code.MOVE, "Move": Move.JOG, "Direction": int(direction > 0)}
        value, time = max(1, round(duty * 255)), max(1, round(seconds * 1000))
        self._link.command(what, Acknowledges.JOG, Value=value, Argument=time, **fields)
        return self._link.finish(what, Acknowledges.JOG, seconds + 5.0).counts * self.description.resolution

    def home(self, timeout: float | None = None, progress: Callable[[float], None] = lambda position: None) -> float:
        """Find the zero at the lower limit switch (an axis without switches: it is here); return where it stands.

        `progress` is called as by move(); positions count from the new zero once it is found.
        """
        d = self.description
        seconds = timeout if timeout is not None else self._time(d.highest - d.lowest) * 2.0
        self._link.command("to home", Acknowledges.HOME, Code=Code.MOVE, Move=Move.HOME)
        with self._followed(progress):
            return self._link.finish("to home", Acknowledges.HOME, seconds).counts * d.resolution

    def reset_emergency(self) -> CommandEnd:
        """Release the latch of the emergency stop."""
        return self._link.command("to reset its emergency stop", Acknowledges.EMERGENCY, Code=Code.EMERGENCY)

    # --- recordings

    def step(
        self,
        by: float,
        period: float = 0.01,
        timeout: float | None = None,
        settled: float = SETTLED,
        progress: Progress = lambda done, of: None,
    ) -> Result:
        """Step the set point by a distance and record the response every `period` s until the axis stands.

        Columns `time`, `NAME_reference`, `NAME_measured` with NAME the axis's letter; result.plot() draws it. The
        step is at time 0. Lost frames leave gaps in time, and a note; so does an axis that stops short of the point.

        The module ends the motion at the point, or after 3 s without a count. It is stopped before, which a note says,
        when the axis has moved and then stayed within 2 counts (or 0.2 % of the step) for `settled` s; 0: never.
        `progress` is called with the counts gone and to go.
        """
        self._check_axis("step its position")
        if not (isfinite(settled) and settled >= 0.0):
            raise InputError(f"settled = {settled!r} s must be at least 0 (0: wait for the module's own end)")
        d = self.description
        self._subscribe(Quantity.POSITION, period)
        recorder = PositionRecorder(d, period, by)
        ends = {Ended.CARRIED_OUT, Ended.STALLED}

        def listen(heard: ReceivedMessage) -> None:
            recorder.take(heard)
            progress(*recorder.way)
            if settled and recorder.still >= settled and Ended.STOPPED_BY_COMMAND not in ends:
                ends.add(Ended.STOPPED_BY_COMMAND)
                self._link.send(Code=Code.MOVE, Move=Move.STOP)

        self._link.listen = listen
        try:
            what, answers = self._start(by, None)
            patience = self._patience(by, None) if timeout is None else timeout
            done = self._link.finish(what, answers, patience, also=ends)
        finally:
            self._link.listen = lambda heard: None
            self._subscribe(Quantity.POSITION, 0.1)
        notes = [f"the axis stopped short: {reason(done.result)}"] if done.result == Ended.STALLED else []
        if done.result == Ended.STOPPED_BY_COMMAND:
            short = by - (done.counts - recorder.first) * d.resolution
            notes = [
                f"stopped after it had stood still for {settled:g} s, {abs(short):.3g} {d.unit} "
                f"{'short of' if short * by > 0 else 'beyond'} the point: higher gains bring it nearer, 0 as the time "
                "for settling waits for the module's own end"
            ]
        return recorder.result(f"module {self.number}", notes)

    def record(self, seconds: float, period: float = 0.02) -> Result:
        """Record acceleration (g; a module with an accelerometer) and motor current (A) every `period` s."""
        recorder = ReadingsRecorder(self.description, period)
        self._subscribe(Quantity.ACCELERATION | Quantity.CURRENT, period)
        self._link.listen = recorder.take
        try:
            self._link.wait_for(lambda m: recorder.span >= seconds, "to send readings", seconds + 1.0)
        finally:
            self._link.listen = lambda heard: None
            self._subscribe(Quantity.POSITION, 0.1)
        return recorder.result(f"module {self.number}")

    # --- parts

    @contextmanager
    def _followed(self, progress: Callable[[float], None]) -> Iterator[None]:
        """`progress` hears of the positions that the module tells of its motion."""

        def listen(heard: ReceivedMessage) -> None:
            fields = heard.message.fields
            if heard.message.kind == "Reply" and fields["Code"] == MessageToHost.POSITION:
                progress(fields["Position"] * self.description.resolution)

        self._link.listen = listen
        try:
            yield
        finally:
            self._link.listen = lambda heard: None

    def _travel(self, error: MachineError) -> MachineError:
        """A refusal with the module's travel in it, if that is what it is about."""
        d, text = self.description, str(error)
        if REASONS[Ended.OUTSIDE_TRAVEL] not in text:
            return error
        what = "speed" if d.kind == Kind.TOOL else "travel"
        inside = f"that is outside its {what}, {d.lowest:g} to {d.highest:g} {d.unit}; choose a target inside"
        return MachineError(text.replace(REASONS[Ended.OUTSIDE_TRAVEL], inside))

    def _check_axis(self, what: str) -> None:
        if self.description.kind == Kind.TOOL:
            raise InputError(
                f"{self._link.name} is a tool and can't {what}; it can jog, and start(by=...) turns it until stop()"
            )

    def _turn(self, direction: int, seconds: float, duty: float) -> float:
        """A tool: turn for a time, stop; return the speed that it had, rev/min."""
        highest = self.description.highest if direction > 0 else -self.description.lowest
        what, answers = self._start(direction * duty * highest, None)
        self._link.hold(what, answers, seconds)
        return self.stop().counts * self.description.resolution

    def _start(self, by: float | None, to: float | None) -> tuple[str, Acknowledges]:
        try:
            return self._begin(by, to)
        except MachineError as error:
            raise self._travel(error) from error.__cause__

    def _begin(self, by: float | None, to: float | None) -> tuple[str, Acknowledges]:
        d = self.description
        amount = to if by is None else by
        if amount is None or (by is not None and to is not None):
            raise InputError("give one of by (a distance) and to (a point)")
        if not abs(amount) < 2**31 / THOUSAND:
            raise InputError(f"{amount!r} {d.unit} is no distance that a command can carry")
        thousandths = round(amount * THOUSAND)
        if by is None:
            what, answers = f"to move to {amount:g} {d.unit}", Acknowledges.TO_POINT
            self._link.command(what, answers, Code=Code.MOVE, Move=Move.TO_POINT, Argument=thousandths)
            return what, answers
        if thousandths == 0:
            raise InputError(f"a motion by {by!r} {d.unit} is none; the least is 0.001")
        turns = d.kind == Kind.TOOL
        what, answers = f"to {'turn at' if turns else 'move by'} {amount:g} {d.unit}", Acknowledges.START
        fields = {"Direction": int(amount > 0), "Argument": abs(thousandths)}
        self._link.command(what, answers, Code=Code.MOVE, Move=Move.START, **fields)
        return what, answers

    def _patience(self, by: float | None, to: float | None) -> float:
        d = self.description
        return self._time(abs(by) if by is not None else d.highest - d.lowest)

    def _time(self, distance: float) -> float:
        d = self.description
        slowest = min(d.clockwise_speed, d.counterclockwise_speed) / 60.0
        return _SLACK + (2.0 * distance / slowest if slowest else 600.0)

    def _subscribe(self, quantities: Quantity, period: float) -> None:
        milliseconds = round(period * 1000)
        if milliseconds <= 0 or milliseconds % 10 or milliseconds > 0xFFFF:
            raise InputError(f"period {period!r} s must be a multiple of 0.01 s, up to 65 s")
        fields = {"Code": Code.READINGS, "Quantities": quantities, "ReadingsPeriod": milliseconds}
        self._link.command(f"to send readings every {period:g} s", Acknowledges.READINGS, **fields)
