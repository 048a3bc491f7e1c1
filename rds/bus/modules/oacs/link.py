"""One module's conversation: a command out, its acknowledgements and positions in, each with a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import can

from rds.bus.modules.oacs import messages, messaging
from rds.bus.modules.oacs.codes import Acknowledges, Code, MessageToHost, Move, Parameter, Result, check_node
from rds.bus.modules.oacs.messages import Decoded
from rds.bus.modules.oacs.refusals import REFUSED, reason
from rds.core.errors import MachineError

PATIENCE = 0.5  # s for a module to say a word
_KEEP_ALIVE = 0.5  # s; modules stop a motion when they hear nothing for 2 s


class CommandEnd(NamedTuple):
    """How a command ended."""

    result: Result
    counts: int  # where the axis stands; a tool: its speed, rev/min
    seconds: float  # from the command to this, on the bus's clock where it has one


class Conversation:
    """With the module `number` on an open `bus`, which stays the caller's."""

    def __init__(self, bus: can.BusABC, number: int, name: str = ""):
        self.bus = bus
        self.number = check_node(number)
        self.name = f"module {name} (number {number})" if name else f"module {number}"
        self.listen: Callable[[messaging.ReceivedMessage], None] = lambda heard: None  # everything that the module says

    def send(self, **fields: Any) -> None:
        """A command."""
        messaging.send(self.bus, messages.encode("Command", self.number, **fields))

    def wait_for(
        self, wanted: Callable[[Decoded], bool], what: str, seconds: float = PATIENCE
    ) -> messaging.ReceivedMessage:
        """The module's next message that is `wanted`. MachineError naming module and `what` after `seconds`."""
        heard = self._hear(wanted, seconds)
        if heard is None:
            raise MachineError(
                f"{self.name} was told {what} and did not answer within {seconds:g} s; check its power and cable "
                "(a scan of the bus shows who is there)"
            )
        return heard

    def _hear(self, wanted: Callable[[Decoded], bool], seconds: float) -> messaging.ReceivedMessage | None:
        """The same, None if it does not come in time. Meanwhile the module hears that the host lives."""
        until = time.monotonic() + seconds
        alive = time.monotonic() + _KEEP_ALIVE
        while True:
            heard = messaging.hear(self.bus, min(until, alive))
            if heard is not None and self._is_mine(heard.message):
                self.listen(heard)
                if wanted(heard.message):
                    return heard
            now = time.monotonic()
            if now >= until:
                return None
            if now >= alive:
                alive = now + _KEEP_ALIVE
                self.send(Code=Code.READ_PARAMETER, ReadIndex=Parameter.SELECT)

    def command(self, what: str, answers: Acknowledges, **fields: Any) -> CommandEnd:
        """Send a command and wait until it is carried out or accepted. MachineError if it is refused, or not heard."""
        asked = time.monotonic()
        self.drain()
        self.send(**fields)
        heard = self.wait_for(acknowledgement(answers), what)
        done = CommandEnd(Result(heard.message.fields["Result"]), heard.message.fields["AcknowledgePosition"], 0.0)
        if done.result > Result.ACCEPTED:
            raise MachineError(f"{self.name} refused {what}: {reason(done.result)}")
        return done._replace(seconds=heard.at - asked)

    def finish(
        self, what: str, answers: Acknowledges, seconds: float, also: Collection[Result] = (Result.CARRIED_OUT,)
    ) -> CommandEnd:
        """Wait until an accepted command is carried out, or ends with one of `also`.

        MachineError if it fails or takes longer than `seconds`.
        Whatever ends the wait otherwise (an error, Ctrl-C), the module is told to stop.
        """
        asked = time.monotonic()
        with self._stopping():
            heard = self.wait_for(acknowledgement(answers, True, _within(PATIENCE)), what, seconds)
        result, counts = Result(heard.message.fields["Result"]), heard.message.fields["AcknowledgePosition"]
        if result not in also:
            raise MachineError(f"{self.name} was told {what} and did not finish: {reason(result)}")
        return CommandEnd(result, counts, heard.at - asked)

    def hold(self, what: str, answers: Acknowledges, seconds: float) -> None:
        """Let an accepted command that has no end of its own go on for `seconds`. MachineError if it ends before."""
        with self._stopping():
            heard = self._hear(acknowledgement(answers, True, _within(PATIENCE)), seconds)
        if heard is not None:
            ended = Result(heard.message.fields["Result"])
            raise MachineError(f"{self.name} was told {what} and did not go on: {reason(ended)}")

    @contextmanager
    def _stopping(self) -> Iterator[None]:
        """Tell the module to stop if the block fails or is interrupted."""
        try:
            yield
        except BaseException:
            self.send(Code=Code.MOVE, Move=Move.STOP)
            raise

    def drain(self) -> None:
        """Take what was said before, so that an old word does not count as the answer to a new command."""
        while messaging.hear(self.bus, 0.0) is not None:
            pass

    def _is_mine(self, message: Decoded) -> bool:
        if message.kind == "Reply":
            return bool(message.fields["BoardID"] == self.number)
        return message.node == self.number and message.kind not in ("Command", "Flow")


def acknowledgement(
    answers: Acknowledges, last: bool = False, soon: Callable[[], bool] = lambda: False
) -> Callable[[Decoded], bool]:
    """Whether a message acknowledges that command; with `last`, as its end.

    A module that does not know the command at all refuses it under a number of its own, at once. What is refused while
    an accepted command is under way is the same command of another host. But `soon` after it the acceptance may have
    been that of another host, and the refusal is ours: it counts then.
    """
    known = {answers} if last else {answers, Acknowledges.UNKNOWN}

    def wanted(message: Decoded) -> bool:
        fields = message.fields
        return (
            message.kind == "Reply"
            and fields["Code"] == MessageToHost.ACKNOWLEDGEMENT
            and fields["Acknowledges"] in known
            and not (last and fields["Result"] == Result.ACCEPTED)
            and not (last and fields["Result"] in REFUSED and not soon())
        )

    return wanted


def _within(seconds: float) -> Callable[[], bool]:
    until = time.monotonic() + seconds
    return lambda: time.monotonic() < until
