"""A virtual distributed module: what a board of the thesis did, behind one CAN node. It knows frames and time, no bus.

It speaks both ways: the messages of the oacs dialect (messages.py), and the cyclic frames of
rds/bus/modules/rds/frames.py, which `rds.bus.modules.rds.module.AxisModule` answers here too, over this module's
plant. While cyclic commands come the node's own motions are refused; a motion under way gives way to them.

Frames that it wants to send carry the instant from which they may be sent: a board takes its time to answer.
"""

from __future__ import annotations

import logging
import secrets
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.codes import Acknowledges, Code, MessageToHost, Mode, Parameter, Result
from rds.bus.modules.oacs.command_handling import carry_out_command
from rds.bus.modules.oacs.iso_tp import Sender
from rds.bus.modules.oacs.messages import Frame
from rds.bus.modules.oacs.module_data import ModuleData
from rds.bus.modules.oacs.mover import Mover
from rds.bus.modules.oacs.pid import FIELDS, Tuning
from rds.bus.modules.oacs.plant import Plant
from rds.bus.modules.oacs.readings import Readings
from rds.bus.modules.oacs.transfer import encode_description
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import HIGHEST_VOLTAGE, Status
from rds.bus.modules.rds.module import AxisModule, machine_parameters
from rds.core.errors import MachineError
from rds.machines.machine import Axis

LOG = logging.getLogger(__name__)

HEARTBEAT = 5e-3  # s between two looks at a module in motion; what it does then depends on bus time alone


class DueFrame(NamedTuple):
    """A frame, and the instant from which it may be sent."""

    at: float
    order: int
    frame: Frame


class OacsModule:
    """The module of `axis`. `slot` is the place of its voltage in a cyclic command, `start` the bus time now, s."""

    def __init__(
        self,
        axis: Axis,
        data: ModuleData,
        slot: int,
        sample_period: float,
        start: float,
        serial: int | None = None,
        range: float = HIGHEST_VOLTAGE,
    ):
        self.name = axis.name
        self.node = data.node
        self.data = data
        self.serial = secrets.randbelow(words.SERIALS) if serial is None else serial
        self.plant = Plant(machine_parameters(axis), data, start)
        self.mover = Mover(self.plant)
        self.cyclic = AxisModule(axis, slot, sample_period, start, range=range)
        self.cyclic.motion = self.plant
        self.readings = Readings(self)
        self.emergency_input = False
        self.draft: Tuning = self.mover.tuning  # parameters received that do not take effect yet
        self._description = encode_description(data.describe(self.serial, slot + 1))
        self._sender: Sender | None = None
        self._queue: list[DueFrame] = []
        self._order = count()
        self._grid = start  # a line of the grid of slots: when the last general call came
        self._said: tuple[object, ...] = ()
        self._statuses = 0
        self._steady: tuple[object, ...] = ()  # what is looked at in each cycle, to see whether there is more to do
        self._said = self._state()

    @property
    def ticks(self) -> int:
        """Cyclic commands heard."""
        return self.cyclic.ticks

    @property
    def identifiers(self) -> list[int]:
        """What the module listens to; all are standard frames."""
        return [words.GENERAL, words.COMMAND + self.node, words.FLOW + self.node, *self.cyclic.hears]

    @property
    def commanded(self) -> bool:
        """Whether cyclic commands come."""
        return self.cyclic.expires is not None

    @property
    def expires(self) -> float | None:
        """The next instant at which expire() has something to do, bus time in s; None if nothing will be."""
        instants = [due.at for due in self._queue[:1]]
        if self.cyclic.expires is not None:
            instants.append(self.cyclic.expires)
        if self.readings.next is not None:
            instants.append(self.readings.next)
        if (self.plant.busy and not self.commanded) or (self._sender is not None and self._sender.waiting):
            instants.append(self.plant.now + HEARTBEAT)
        return min(instants, default=None)

    # --- what comes in

    def receive(self, identifier: int, data: bytes | bytearray, at: float, extended: bool = False) -> list[Frame]:
        """Take a frame stamped `at` (s); return the frames to send now.

        A frame that makes no sense changes nothing, and is reported in the log; a command to this module is refused
        by an acknowledgement as well, so that its sender need not wait for one in vain.
        """
        if extended:
            return []
        try:
            if frames.MORE_VOLTAGES <= identifier <= frames.CALL:
                return self._cycle(identifier, data, at)
            if identifier == words.FLOW + self.node:
                self._download(data, at)
            elif identifier in (words.GENERAL, words.COMMAND + self.node):
                message = messages.decode(identifier, data)
                self.advance(at)
                self.mover.heard = at
                if identifier == words.GENERAL:
                    self._general_call(message.fields["Code"], at)
                else:
                    carry_out_command(self, message.fields, at)
        except MachineError as error:
            LOG.warning("module %s ignored a frame: %s", self.name, error)
            if identifier == words.COMMAND + self.node:
                self.advance(at)
                self.acknowledge(Acknowledges.UNKNOWN, Result.BAD_VALUE, at)
        return self.expire(at)

    def set_emergency_input(self, active: bool, at: float) -> None:
        """The module's emergency stop button: pressed, it stops this module and tells all others."""
        self.advance(at)
        if active and not self.emergency_input:
            self._latch(at)
            self.send(messages.encode("GeneralCall", Code=Code.EMERGENCY), at)
        self.emergency_input = active
        self._tell(at)

    def set_wire(self, side: int, level: bool | None, at: float) -> None:
        """The wire of the lower (-1) or upper (+1) switch: broken (False), bridged (True) or whole (None)."""
        self.advance(at)
        for switch in self.plant.switches:
            if switch.side == side:
                switch.wire = level
        self.plant.look(at)

    def reset_emergency(self, at: float) -> Result:
        """Release the latch, if the input is released."""
        if self.emergency_input:
            return Result.EMERGENCY_LATCHED
        self.plant.emergency = False
        return Result.CARRIED_OUT

    def _general_call(self, code: int, at: float) -> None:
        if code == Code.EMERGENCY:
            self._latch(at)
            self.acknowledge(Acknowledges.EMERGENCY, Result.CARRIED_OUT, at)
            return
        self._grid = at
        if code == Code.CALL_ONE:
            reply = messages.encode(
                "Reply",
                Code=MessageToHost.CALL_ONE,
                BoardID=self.node,
                **messages.letters("KindText", self.data.kind_text, 5),
            )
        elif code == Code.CALL_TWO:
            reply = messages.encode(
                "Reply",
                Code=MessageToHost.CALL_TWO,
                BoardID=self.node,
                **messages.letters("TypeText", self.data.type_text, 6),
            )
        else:
            reply = messages.encode(
                "Identity",
                Serial=self.serial,
                BoardID=self.node,
                KindCode=self.data.kind,
                Version=words.VERSION,
                Mode=self.mode,
            )
        self.send(reply, at + self.data.response_call)

    def _latch(self, at: float) -> None:
        if not self.plant.emergency:
            LOG.warning("module %s: emergency stop, zero volts until it is reset", self.name)
        self.plant.emergency = True
        self.plant.cut(at)
        self.mover.stop(Result.STOPPED_BY_EMERGENCY, at)

    # --- the cyclic exchange

    def _cycle(self, identifier: int, data: bytes | bytearray, at: float) -> list[Frame]:
        self.mover.heard = at
        if identifier in (frames.COMMAND, frames.DRY_COMMAND) and self.mover.motion is not None:
            self.advance(at)
            self.mover.give_way()
        if identifier == frames.CALL and data == frames.RESET:
            self.reset_emergency(at)
        answers = self._answers(self.cyclic.receive(identifier, data, at))
        # a thousand times a second, in which nothing else happens as a rule: then the answer is all
        state = (self.cyclic.status, self.plant.emergency, self.plant.changes)
        if state == self._steady and not self._queue and self.readings.next is None and not self.mover.finished:
            return answers
        self._steady = state
        return [*answers, *self.expire(at)]

    def _answers(self, answers: list[bytes]) -> list[Frame]:
        """The cyclic answers, with what this dialect knows of the module's state in their status."""
        bits = Status.EMERGENCY | Status.FAULT if self.plant.emergency else Status.NONE
        if self.plant.opened:
            bits |= Status.LIMIT | Status.FAULT
        identifier = self.cyclic.identifier
        if bits:
            decoded = [frames.decode_answer(identifier, data) for data in answers]
            answers = [frames.encode_answer(a._replace(status=a.status | bits)) for a in decoded]
        return [Frame(identifier, data) for data in answers]

    # --- what goes out

    def advance(self, now: float) -> None:
        """Bring the axis and the module's time to `now`, s; the watchdog first, whose instant may lie before."""
        for frame in self._answers(self.cyclic.expire(now)):
            self.send(frame, now)
        self.plant.advance(now)
        for answers, result in self.mover.finished:
            self.acknowledge(answers, result, now)
        self.mover.finished.clear()

    def expire(self, now: float) -> list[Frame]:
        """Do what is due by `now`; return the frames to send now."""
        self.readings.take(now)
        self.advance(now)
        if self._sender is not None and self._sender.waiting:
            for data in self._sender.pump():
                self.send(Frame(words.DOWNLOAD + self.node, data), now)
        self._tell(now)
        ready = []
        while self._queue and self._queue[0].at <= now:
            ready.append(heappop(self._queue).frame)
        return ready

    def send(self, frame: Frame, at: float) -> None:
        """Queue a frame that may be sent from the instant `at` on; frames of one instant keep their order."""
        heappush(self._queue, DueFrame(at, next(self._order), frame))

    def slot(self, at: float) -> float:
        """The first instant from `at` on at which this module may send 0x000 of its own accord."""
        return words.next_slot(self.node, at, self._grid)

    def acknowledge(self, answers: Acknowledges, result: Result, at: float) -> None:
        """Tell the host what became of a command."""
        frame = messages.encode(
            "Reply",
            Code=MessageToHost.ACKNOWLEDGEMENT,
            BoardID=self.node,
            Acknowledges=answers,
            AcknowledgeAxis=ord(self.data.letter),
            Result=result,
            AcknowledgePosition=wrap24(self.plant.counts),
        )
        self.send(frame, self.slot(at + self.data.response_call))

    def start_download(self, at: float) -> None:
        """Answer a data call."""
        self._sender = self._sender or Sender(self.node)
        for data in self._sender.start(self._description):
            self.send(Frame(words.DOWNLOAD + self.node, data), at + self.data.response_download)

    def _download(self, data: bytes | bytearray, at: float) -> None:
        if self._sender is not None and self._sender.waiting:
            self._sender.feed(data)
            for out in self._sender.pump():
                self.send(Frame(words.DOWNLOAD + self.node, out), at)

    def report_parameter(self, parameter: Parameter, at: float) -> None:
        """Say the value of a tuning parameter that is in force."""
        tuning = self.mover.tuning
        value = 0.0 if parameter == Parameter.SELECT else getattr(tuning, FIELDS[parameter])
        frame = messages.encode(
            "Parameter", self.node, Parameter=parameter, Selection=tuning.controller, ParameterValue=value
        )
        self.send(frame, at + self.data.response_call)
        if parameter == Parameter.SELECT:
            self._said = ()  # whoever asks for the controller also learns how the module is

    @property
    def mode(self) -> Mode:
        """What the module does."""
        return Mode.COMMANDED if self.commanded and not self.plant.emergency else self.mover.mode

    def _state(self) -> tuple[object, ...]:
        """What a status message says and is worth a new one when it changes."""
        opened = {switch.side: switch.open for switch in self.plant.switches}
        return (
            self.mover.motion is not None,
            self.mover.homed,
            opened.get(-1, False),
            opened.get(1, False),
            self.plant.emergency,
            self.emergency_input,
            bool(self.cyclic.status & Status.WATCHDOG),
            self.mode,
            self.mover.last_result,
        )

    def _tell(self, at: float) -> None:
        """Send a status message if the state is another than the last that was sent."""
        state = self._state()
        if state == self._said:
            return
        self._said = state
        names = ("Moving", "Homed", "LowLimitOpen", "HighLimitOpen", "EmergencyLatched", "EmergencyInput")
        self._statuses += 1
        frame = messages.encode(
            "Status",
            self.node,
            **{name: int(bool(value)) for name, value in zip(names, state, strict=False)},
            WatchdogCut=int(bool(state[6])),
            Mode=self.mode,
            LastResult=self.mover.last_result,
            Duty=min(round(abs(self.plant.duty)), words.DUTY),
            CountsMissing=min(max(self.plant.counter.missing, 0), 0xFFFF),
            StatusCount=self._statuses & 0xFFFF,
        )
        self.send(frame, at)


def wrap24(counts: int) -> int:
    """A count as 24 bits carry it."""
    return (counts + 0x800000) % 0x1000000 - 0x800000
