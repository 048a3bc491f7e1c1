"""A bus's message table: what is sent how often, and who wins arbitration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from rds.bus.medium import station
from rds.bus.medium.bits import Bits, frame_bits, header, least_bits, most_bits
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.core.errors import InputError
from rds.machines.machine import Machine

HOST = "host"


@dataclass(frozen=True)
class Message:
    """One periodic (or, with `period` as the least distance, sporadic) message. Times in s.

    A message is released `jitter` at most after the instant that its period gives; one with `after` is released by
    the arrival of the message of that name, `jitter` at most later, once for each. `deadline`, by default the period,
    counts from the instant that the period gives, for `after` too.

    Raises InputError for values that no message can have.
    """

    name: str
    identifier: int
    extended: bool
    size: int  # bytes of data; for a remote frame, the length it asks for
    period: float
    jitter: float = 0.0
    deadline: float | None = None
    data: bytes | None = None  # what is typically sent: gives the exact length
    sender: str | None = None
    remote: bool = False
    fd: bool = False
    bitrate_switch: bool = False
    after: str | None = None

    def __post_init__(self) -> None:
        if not 1e-9 <= self.period < 1e6:
            raise self._wrong(f"period {self.period!r} s must be at least 1e-9 and less than 1e6")
        if not 0.0 <= self.jitter < 1e6:
            raise self._wrong(f"jitter {self.jitter!r} s must be from 0 to less than 1e6")
        if self.deadline is not None and not 0.0 < self.deadline < 1e6:
            raise self._wrong(f"deadline {self.deadline!r} s must be more than 0 and less than 1e6")
        if self.data is not None and (len(self.data) != self.size or self.remote):
            raise self._wrong(f"data of {len(self.data)} bytes contradict {'remote' if self.remote else self.size}")
        try:
            size, dlc = (0, self.size) if self.remote else (self.size, None)
            header(self.identifier, size, self.extended, self.remote, self.fd, self.bitrate_switch, dlc=dlc)
        except InputError as error:
            raise self._wrong(str(error)) from None

    def most(self) -> Bits:
        """Most bits that the frame can have, whatever its data."""
        if self.remote:
            return self._with(b"")
        return most_bits(self.size, self.extended, self.fd, self.bitrate_switch)

    def least(self) -> Bits:
        """Fewest bits that the frame can have."""
        if self.remote:
            return self._with(b"")
        return least_bits(self.size, self.extended, self.fd, self.bitrate_switch)

    def exact(self) -> Bits:
        """Exact bits of the frame with its data; where none are given, the most."""
        return self.most() if self.data is None else self._with(self.data)

    def _with(self, data: bytes) -> Bits:
        dlc = self.size if self.remote else None
        return frame_bits(self.identifier, data, self.extended, self.remote, self.fd, self.bitrate_switch, dlc=dlc)

    def _wrong(self, what: str) -> InputError:
        return InputError(f"message {self.name!r}: {what}")


def priority(message: Message) -> int:
    """What the message shows during arbitration, as a number: the lower wins."""
    return station.priority(message.identifier, message.extended, message.remote)


def in_order(messages: Iterable[Message]) -> list[Message]:
    """The messages from the highest priority to the lowest.

    Raises InputError if the table is empty, if two messages have one name or would collide (equal in arbitration), or
    if an `after` names no message of the table, itself, or one that in turn waits for it.
    """
    table = sorted(messages, key=priority)
    if not table:
        raise InputError("a message table without messages; give at least one")
    for first, second in pairwise(table):
        if priority(first) == priority(second):
            raise InputError(
                f"messages {first.name!r} and {second.name!r} have the same identifier {first.identifier:#x}; "
                "on a bus each needs its own"
            )
    name, times = Counter(message.name for message in table).most_common(1)[0]
    if times > 1:
        raise InputError(f"{times} messages are called {name!r}; each needs a name of its own")
    _check_after(table)
    return table


def _check_after(table: Sequence[Message]) -> None:
    after = {message.name: message.after for message in table}
    for message in table:
        seen = [message.name]
        while (before := after[seen[-1]]) is not None:
            if before not in after:
                raise InputError(f"message {seen[-1]!r} comes after {before!r}, which is not in the table")
            if before in seen:
                raise InputError(f"messages wait for each other: {' after '.join([*seen, before])}")
            seen.append(before)


def messages_of(
    machine: Machine, sample_period: float | None = None, response_time: float = 0.0, host_jitter: float = 0.0
) -> list[Message]:
    """What goes over a machine's bus in each sample period: the command, and each module's answer to it.

    A machine of five to eight axes has the frame with their voltages before the command. The first frame is released by
    the host's clock, `host_jitter` s late at most. Answers are released by the command's arrival, at each module
    `response_time` s later at most; their deadline is the end of the sample period, when the next command is due. The
    data are those of a machine at rest. Set-up and call are left out: they are sent before a run.

    Raises InputError for a machine with more axes than commands have slots.
    """
    period = machine.sample_period if sample_period is None else sample_period
    if len(machine.axes) > frames.MOST_AXES:
        raise InputError(f"{len(machine.axes)} axes; commands carry {frames.MOST_AXES} voltages", machine.path)
    command = Message(
        name="command",
        identifier=frames.COMMAND,
        extended=False,
        size=8,
        period=period,
        jitter=host_jitter,
        deadline=period,
        data=frames.encode_voltages([]),
        sender=HOST,
    )
    rest = frames.encode_answer(Answer(counts=0, status=Status.ENABLED, kind=Kind.ANSWER, ticks=1))
    answers = [
        Message(
            name=f"answer {axis.name}",
            identifier=frames.answer_identifier(axis.node),
            extended=False,
            size=8,
            period=period,
            jitter=response_time,
            deadline=period,
            data=rest,
            sender=axis.name,
            after=command.name,
        )
        for axis in machine.axes.values()
    ]
    answers += [
        Message(
            name=f"force {axis.name}",
            identifier=frames.FORCE,
            extended=False,
            size=8,
            period=frames.FORCE_EVERY * period,
            jitter=response_time,
            deadline=period,
            data=frames.encode_force(0.0, 0),
            sender=axis.name,
            after=command.name,
        )
        for axis in machine.axes.values()
        if axis.module.get("load_cell")
    ]
    if len(machine.axes) <= frames.SLOTS:
        return in_order([command, *answers])
    more = replace(command, name="voltages 5 to 8", identifier=frames.MORE_VOLTAGES)
    return in_order([more, replace(command, after=more.name, jitter=0.0), *answers])
