"""What a bus will do, before it runs: load, and each message's worst response against its deadline."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from numbers import Real
from typing import Any, NamedTuple, Protocol, TypeVar

from rds.bus.analysis.messages import Message, in_order, messages_of
from rds.bus.analysis.response_times import NS, Errors, Response, responses
from rds.bus.analysis.schedule import Slot, occupied, one_cycle
from rds.bus.medium.bits import INTERFRAME
from rds.bus.modules.dialects import DEFAULT, SERIAL_DIALECTS, check_dialect
from rds.core.errors import InputError
from rds.machines.machine import Machine

MET, MISSED, UNBOUNDED = "met", "missed", "unbounded"
HIGHEST_BITRATE, HIGHEST_DATA_BITRATE = 1_000_000, 8_000_000  # bit/s: ISO 11898-1, and CAN FD transceivers


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_R = TypeVar("_R", bound=_Named)


def row_called(name: str, rows: Sequence[_R]) -> _R:
    """The row of the message called `name`; InputError names those there are."""
    for row in rows:
        if row.name == name:
            return row
    raise InputError(f"no message {name!r}; there are {', '.join(row.name for row in rows)}")


class Row(NamedTuple):
    """One message; times in s. `bits` and `longest_bits` include the interframe space."""

    name: str
    identifier: int
    extended: bool
    sender: str
    size: int  # bytes
    period: float
    jitter: float  # of its own; answers inherit besides the response of what they answer
    deadline: float
    bits: int  # exact, with the table's data
    longest_bits: int
    transmission: float  # longest
    blocking: float
    response: float  # worst case; inf if unbounded
    verdict: str  # met, missed, unbounded
    reason: str  # why it is unbounded

    @property
    def identifier_text(self) -> str:
        """The identifier in hexadecimal, as many digits as its kind has."""
        return f"{self.identifier:#010x}" if self.extended else f"{self.identifier:#05x}"


@dataclass(frozen=True)
class Analysis:
    """The analysis of a bus; rows from the highest priority to the lowest.

    `load_percent` takes each message's exact length with its data (the longest where the table has none), and
    `worst_load_percent` the longest possible; both count interframe spaces, which nobody else can use.
    """

    title: str
    bitrate: int  # bit/s
    data_bitrate: int | None
    errors: Errors | None
    messages: tuple[Message, ...]
    rows: tuple[Row, ...]
    load_percent: float
    worst_load_percent: float
    cycle: tuple[Slot, ...]  # one release of each message at once, exact lengths; ns
    worst_cycle: float  # s until the last response at worst; inf if one is unbounded
    assumed: str = ""  # what the worst cases rest on, in words
    machine: bool = False  # of a machine, whose host and modules have options; else of a message table

    @property
    def met(self) -> bool:
        """Whether every message surely keeps its deadline."""
        return all(row.verdict == MET for row in self.rows)

    def row(self, name: str) -> Row:
        """The row of the message called `name`; InputError names those there are."""
        return row_called(name, self.rows)

    def to_json(self) -> dict[str, Any]:
        """The analysis as plain values for json.dumps: times in µs, null for what is unbounded."""
        return {
            "title": self.title,
            "bitrate": self.bitrate,
            "data_bitrate": self.data_bitrate,
            "load_percent": round(self.load_percent, 4),
            "worst_load_percent": round(self.worst_load_percent, 4),
            "cycle_us": self.cycle[-1].end / 1e3,
            "worst_cycle_us": _microseconds(self.worst_cycle),
            "met": self.met,
            "assumed": self.assumed,
            "messages": [_plain(row) for row in self.rows],
        }

    def __str__(self) -> str:
        rate = f"{self.bitrate / 1e3:g} kbit/s"
        if self.data_bitrate is not None:
            rate += f", data at {self.data_bitrate / 1e3:g} kbit/s"
        lines = [
            f"{self.title}: {rate}",
            f"bus load {self.load_percent:.1f} % with the table's data, {self.worst_load_percent:.1f} % at worst",
            f"one cycle of all messages {time_text(self.cycle[-1].end / NS)}, {time_text(self.worst_cycle)} at worst",
            *([f"if {self.assumed}"] if self.assumed else []),
            "",
            *_table(self.rows),
        ]
        reasons = [f"{row.name}: unbounded, for {row.reason}" for row in self.rows if row.reason]
        return "\n".join(lines + (["", *reasons] if reasons else []))


def analyse(
    machine: Machine,
    bitrate: int = 1_000_000,
    sample_period: float | None = None,
    *,
    dialect: str = DEFAULT,
    response_time: float = 0.0,
    host_jitter: float = 0.0,
    errors: Errors | None = None,
    cia402: Mapping[str, Any] | None = None,
) -> Analysis:
    """The bus of a machine: what host and modules say in each sample period, in their `dialect`.

    `bitrate` in bit/s; times in s: `sample_period` (default: the machine's), the modules' longest `response_time` from
    a command's arrival to their answer being ready, and how late the host's command can be. Without `errors` the bus
    is taken to be free of them. `cia402` is that dialect's `[bus.cia402]` table. Raises InputError for values that
    can't be.
    """
    check_dialect(dialect)
    if dialect in SERIAL_DIALECTS:
        raise InputError(
            f"dialect {dialect} has no CAN frames: `rds bus analyse --dialect {dialect}` analyses its line"
        )
    period = machine.sample_period if sample_period is None else sample_period
    if dialect == "cia402":
        from rds.bus.modules.cia402.messages import messages_of_drives
        from rds.bus.modules.cia402.settings import read_settings

        table = messages_of_drives(read_settings(cia402 or {}, machine), period, response_time, host_jitter)
    else:  # the distributed modules take the same cyclic frames
        table = messages_of(machine, period, response_time, host_jitter)
    assumed = [
        f"modules answer {_within(response_time)}",
        f"the host is {f'up to {time_text(host_jitter)} late' if host_jitter else 'on time'}",
        _words(errors),
    ]
    title = f"{machine.name}, {1 / period:g} Hz" + ("" if dialect == DEFAULT else f", dialect {dialect}")
    found = analyse_messages(table, bitrate, errors=errors, title=title, assumed=", ".join(assumed))
    return replace(found, machine=True)


def analyse_messages(
    messages: Iterable[Message],
    bitrate: int = 1_000_000,
    data_bitrate: int | None = None,
    errors: Errors | None = None,
    title: str = "bus",
    assumed: str = "",
) -> Analysis:
    """The bus of a message table of one's own; `data_bitrate` (bit/s) for CAN FD frames with the bit-rate switch.

    `assumed` is said with the results: on what the times in the table rest.
    """
    bitrate, data_bitrate = _rates(bitrate, data_bitrate)
    table = in_order(messages)
    found = responses(table, bitrate, data_bitrate, errors)
    rows = tuple(_row(message, result, bitrate, data_bitrate) for message, result in zip(table, found, strict=True))
    exact = sum(occupied(message.exact(), bitrate, data_bitrate) / message.period for message in table)
    worst = sum(occupied(message.most(), bitrate, data_bitrate) / message.period for message in table)
    return Analysis(
        title=title,
        bitrate=bitrate,
        data_bitrate=data_bitrate,
        errors=errors,
        messages=tuple(table),
        rows=rows,
        load_percent=100 * exact / NS,
        worst_load_percent=100 * worst / NS,
        cycle=tuple(one_cycle(table, bitrate, data_bitrate)),
        worst_cycle=max(row.response for row in rows),
        assumed=assumed,
    )


def _within(response_time: float) -> str:
    return f"within {time_text(response_time)}" if response_time else "at once"


def _words(errors: Errors | None) -> str:
    """What is assumed of errors."""
    if errors is None:
        return "there are no errors"
    more = "" if errors.interval == inf else f", and one more every {time_text(errors.interval)}"
    return f"{errors.burst} error{'s come' if errors.burst > 1 else ' comes'} at once{more}"


def _rates(bitrate: int, data_bitrate: int | None) -> tuple[int, int | None]:
    """Whole numbers of bit/s: 500e3 is one, too."""
    for rate in (bitrate,) if data_bitrate is None else (bitrate, data_bitrate):
        if not (isinstance(rate, Real) and rate % 1 == 0.0):
            raise InputError(f"bit rate {rate!r} must be a whole number of bit/s, such as 500000")
    if not 1000 <= bitrate <= HIGHEST_BITRATE:
        raise InputError(f"bit rate {bitrate!r} bit/s must be from 1000 to {HIGHEST_BITRATE} (125000, 250000, 500000)")
    if data_bitrate is not None and not bitrate <= data_bitrate <= HIGHEST_DATA_BITRATE:
        raise InputError(f"data bit rate {data_bitrate!r} bit/s must be from {bitrate} to {HIGHEST_DATA_BITRATE}")
    return int(bitrate), None if data_bitrate is None else int(data_bitrate)


def _row(message: Message, result: Response, bitrate: int, data_bitrate: int | None) -> Row:
    deadline = message.period if message.deadline is None else message.deadline
    response = inf if result.time is None else result.time / NS
    verdict = UNBOUNDED if result.time is None else MET if response <= deadline else MISSED
    return Row(
        name=message.name,
        identifier=message.identifier,
        extended=message.extended,
        sender=message.sender or "",
        size=message.size,
        period=message.period,
        jitter=message.jitter,
        deadline=deadline,
        bits=message.exact().total + INTERFRAME,
        longest_bits=message.most().total + INTERFRAME,
        transmission=occupied(message.most(), bitrate, data_bitrate) / NS,
        blocking=result.blocking / NS,
        response=response,
        verdict=verdict,
        reason=result.reason,
    )


def _plain(row: Row) -> dict[str, Any]:
    plain = {key: value for key, value in row._asdict().items() if not isinstance(value, float)}
    times = {f"{key}_us": _microseconds(value) for key, value in row._asdict().items() if isinstance(value, float)}
    return {**plain, **times}


def _microseconds(seconds: float) -> float | None:
    return None if seconds == inf else round(seconds * 1e6, 3)


def time_text(seconds: float) -> str:
    """The time in µs, to 0.1 µs; "unbounded" for inf."""
    return UNBOUNDED if seconds == inf else f"{round(seconds * 1e6, 1):.12g} µs"


def _table(rows: Iterable[Row]) -> list[str]:
    head = ("message", "identifier", "bytes", "bits", "longest", "period", "blocking", "response", "deadline", "")
    cells = [head] + [
        (
            row.name,
            row.identifier_text,
            str(row.size),
            str(row.bits),
            str(row.longest_bits),
            time_text(row.period),
            time_text(row.blocking),
            time_text(row.response),
            time_text(row.deadline),
            row.verdict,
        )
        for row in rows
    ]
    return aligned(cells, left=(0, 9))


def aligned(cells: Sequence[Sequence[str]], left: Container[int]) -> list[str]:
    """Lines of equal columns, to the right but for those in `left`."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if column in left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
