"""Several modules moved together, each by its own controller: started at once, waited for until all have arrived.

The host of the thesis runs a part program so (oacs-thesis, 8.7): a command to each axis of a line, and the next line
when every module has acknowledged that it carried its command out. `ModuleGroup` speaks through a port: an open bus, or
virtual modules in bus time, in which a run of minutes takes seconds and gives the same numbers each time.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any, NamedTuple, NoReturn, Protocol

import can

from rds.bus.modules.oacs import messages, messaging
from rds.bus.modules.oacs.codes import THOUSAND, Acknowledges, Code, Move, Parameter, Result, Select
from rds.bus.modules.oacs.link import PATIENCE, acknowledgement
from rds.bus.modules.oacs.messages import Decoded, Frame
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.pid import FIELDS
from rds.bus.modules.oacs.refusals import REFUSED, reason
from rds.core.errors import MachineError

_KEEP_ALIVE = 0.5  # s; modules end a motion when they hear nothing for 2 s
_UNANSWERED = 4  # questions in a row, so 2 s, after which a module is taken for lost
_RUNDOWN = 60.0  # s that a tool may take to come to rest
_LEAST_STEP = 1e-6  # s, by which virtual time goes on at least


class MotionEnd(NamedTuple):
    """The end of a motion: where the axis stands by its module, counts, and how long the command took, s."""

    counts: int
    seconds: float


class Port(Protocol):
    """The way to the modules, and the time there, s."""

    def now(self) -> float: ...

    def send(self, frame: Frame) -> None: ...

    def hear(self, until: float) -> Decoded | None:
        """The next message of a module; None if there is none by then."""


class BusPort:
    """An open bus, which stays the caller's, and which nobody else may read meanwhile. MachineError: it failed."""

    def __init__(self, bus: can.BusABC):
        self._bus = bus

    def now(self) -> float:
        return time.monotonic()

    def send(self, frame: Frame) -> None:
        messaging.send(self._bus, frame)

    def hear(self, until: float) -> Decoded | None:
        heard = messaging.hear(self._bus, until)
        return None if heard is None else heard.message


class VirtualPort:
    """Virtual modules that began at the instant 0. The wires take no time; the boards take theirs."""

    def __init__(self, modules: Sequence[OacsModule]):
        self._modules, self._now = list(modules), 0.0
        self._said: deque[Decoded] = deque()

    def now(self) -> float:
        return self._now

    def send(self, frame: Frame) -> None:
        for module in self._modules:
            if frame.identifier in module.identifiers:
                self._take(module.receive(frame.identifier, frame.data, self._now, frame.extended))

    def hear(self, until: float) -> Decoded | None:
        while not self._said:
            if self._now >= until:
                return None
            due = min((at for module in self._modules if (at := module.expires) is not None), default=until)
            self._now = min(until, max(due, self._now + _LEAST_STEP))
            for module in self._modules:
                self._take(module.expire(self._now))
        return self._said.popleft()

    def _take(self, frames: list[Frame]) -> None:
        for identifier, data, extended in frames:
            if messages.kind_of(identifier, extended) is not None:
                self._said.append(messages.decode(identifier, data, extended))


class ModuleGroup:
    """The modules `names` (by number, as errors call them) behind a port. Every call raises MachineError naming the
    module that refuses, fails or says nothing; all of them are told to stop then, and by Ctrl-C."""

    def __init__(self, port: Port, names: Mapping[int, str]):
        self.port, self._names = port, dict(names)
        self.listen: Callable[[float, Decoded], None] = lambda at, message: None  # everything they say, and when, s
        self._turning: set[int] = set()  # tools
        self._turned = -inf  # when the last of them began, s
        self._alive = port.now() + _KEEP_ALIVE
        self._unanswered = dict.fromkeys(names, 0)  # questions since a module said anything

    def tune(self, number: int, controller: Select, tuning: Mapping[str, float]) -> None:
        """Set a module's controller and parameters of it, all at once; those not given stay as they are."""
        numbers = {name: parameter for parameter, name in FIELDS.items()}
        for name, value in tuning.items():
            what = f"to set {name} to {value:g}"
            fields = {"Code": Code.SET_PARAMETER, "Parameter": numbers[name], "ParameterValue": value}
            self._command(number, what, Acknowledges.PARAMETER, fields)
        fields = {"Code": Code.SET_PARAMETER, "Parameter": Parameter.SELECT, "Selection": controller}
        self._command(number, f"to use {controller.name}", Acknowledges.PARAMETER, fields)

    def position(self, number: int) -> int:
        """Where an axis at rest stands by its module, counts."""
        fields = {"Code": Code.MOVE, "Move": Move.STOP}
        return self._command(number, "to say where it stands", Acknowledges.STOP, fields).counts

    def to(self, targets: Mapping[int, float], seconds: float) -> dict[int, MotionEnd]:
        """Move axes to points (mm, degrees), all at once; return how each arrived, after `seconds` at most."""
        asked = self.port.now()
        with self._stopping():
            for number, target in targets.items():
                argument = round(target * THOUSAND)
                self._send(number, Code=Code.MOVE, Move=Move.TO_POINT, Argument=argument)
            left, accepted, found = set(targets), set[int](), dict[int, MotionEnd]()
            while left:
                patience = PATIENCE if left - accepted else seconds
                number, result, counts = self._answer(left, Acknowledges.TO_POINT, asked + patience)
                if result is None:
                    silent = sorted(left - accepted) or sorted(left)
                    self._fail(silent[0], f"was told to move to {targets[silent[0]]:g} and did not "
                               f"{'answer' if left - accepted else 'arrive'} within {patience:g} s; see to its power, "
                               "its cable and its gains")  # fmt: skip
                elif result == Result.ACCEPTED:
                    accepted.add(number)
                elif result == Result.CARRIED_OUT:
                    found[number] = MotionEnd(counts, self.port.now() - asked)
                    left.discard(number)
                elif not (number in accepted and result in REFUSED and self.port.now() >= asked + PATIENCE):
                    # within the patience the acceptance may be another host's, and the refusal ours
                    self._fail(number, f"was told to move to {targets[number]:g}: {reason(result)}")
        return found

    def turn(self, number: int, speed: float) -> None:
        """Turn a tool at `speed` (rev/min, + clockwise) from now on; 0 stops it. First it comes to rest."""
        if number in self._turning:
            self._turning.discard(number)
            self._command(number, "to stop", Acknowledges.STOP, {"Code": Code.MOVE, "Move": Move.STOP})
            with self._stopping():
                _, result, _ = self._answer({number}, Acknowledges.START, self.port.now() + _RUNDOWN)
                if result is None:
                    self._fail(number, f"was told to stop and did not say within {_RUNDOWN:g} s that it is at rest; it "
                               "may still turn: see to its power and cable")  # fmt: skip
        if speed:
            thousandths, direction = round(abs(speed) * THOUSAND), int(speed > 0)
            fields = {"Code": Code.MOVE, "Move": Move.START, "Direction": direction, "Argument": thousandths}
            self._command(number, f"to turn at {speed:g} rev/min", Acknowledges.START, fields)
            self._turning.add(number)
            self._turned = self.port.now()

    def rest(self, seconds: float) -> None:
        """Let time pass; tools go on turning."""
        until = self.port.now() + seconds
        with self._stopping():
            while self._hear(until) is not None:
                pass

    def stop(self) -> None:
        """Zero volts on all of them, now, whatever they do. It raises after all have been told, if one could not be."""
        failed = None
        for number in self._names:
            try:
                self._send(number, Code=Code.MOVE, Move=Move.STOP)
            except BaseException as error:  # a second Ctrl-C, too, comes after the last has been told
                failed = failed or error
        self._turning.clear()
        if failed is not None:
            raise failed

    # --- parts

    def _send(self, number: int, **fields: Any) -> None:
        self.port.send(messages.encode("Command", number, **fields))

    def _command(self, number: int, what: str, answers: Acknowledges, fields: Mapping[str, Any]) -> MotionEnd:
        """A command that is carried out, or accepted, at once."""
        asked = self.port.now()
        with self._stopping():
            self._send(number, **fields)
            _, result, counts = self._answer({number}, answers, asked + PATIENCE)
            if result is None:
                self._fail(number, f"was told {what} and did not answer within {PATIENCE:g} s; see to its power and "
                           "cable (`rds scan` shows who is there, and what they speak)")  # fmt: skip
            elif result > Result.ACCEPTED:
                self._fail(number, f"refused {what}: {reason(result)}")
        return MotionEnd(counts, self.port.now() - asked)

    def _answer(self, numbers: Collection[int], answers: Acknowledges, until: float) -> tuple[int, Result | None, int]:
        """Who of them acknowledges that command next, how, and where it stands; no result if nobody does by then."""
        wanted = acknowledgement(answers)
        while (message := self._hear(until)) is not None:
            if wanted(message) and message.fields["BoardID"] in numbers:
                fields = message.fields
                return fields["BoardID"], Result(fields["Result"]), fields["AcknowledgePosition"]
        return 0, None, 0

    def _hear(self, until: float) -> Decoded | None:
        """The next message until then. Meanwhile each module is asked whether it lives, hears so that the host does,
        and tools have to turn."""
        while True:
            if self.port.now() >= self._alive:
                self._ask_all()
            message = self.port.hear(min(until, self._alive))
            if message is not None:
                self._unanswered[message.fields["BoardID"] if message.kind == "Reply" else message.node] = 0
                self.listen(self.port.now(), message)
                ended = self._turning and self._ends_turning(message)
                if ended and (number := message.fields["BoardID"]) in self._turning:
                    self._turning.discard(number)
                    self._fail(number, f"does not turn any more: {reason(message.fields['Result'])}")
                return message
            if self.port.now() >= until:
                return None

    def _ends_turning(self, message: Decoded) -> bool:
        return acknowledgement(Acknowledges.START, True, lambda: self.port.now() < self._turned + PATIENCE)(message)

    def _ask_all(self) -> None:
        """MachineError naming a module that has answered none of the last questions."""
        self._alive = self.port.now() + _KEEP_ALIVE
        for number in self._names:
            if self._unanswered[number] >= _UNANSWERED:
                self._fail(number, f"has fallen silent: it answered nothing for {_UNANSWERED * _KEEP_ALIVE:g} s; see "
                           "to its power and cable (`rds scan` shows who is there)")  # fmt: skip
            self._unanswered[number] += 1
            self._send(number, Code=Code.READ_PARAMETER, ReadIndex=Parameter.SELECT)

    def _fail(self, number: int, said: str) -> NoReturn:
        raise MachineError(f"{self._names[number]} {said}")

    @contextmanager
    def _stopping(self) -> Iterator[None]:
        """Stop all modules if the block fails or is interrupted."""
        try:
            yield
        except BaseException:
            self.stop()
            raise
