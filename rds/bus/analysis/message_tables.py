"""Message tables of others: DBC files, and CSV files of identifiers, periods and lengths."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from rds.bus.analysis.messages import Message
from rds.core.errors import InputError

ENDINGS = (".dbc", ".csv")
CONVERTIBLE = (".kcd", ".sym", ".arxml")  # by cantools
_NEEDED = ("identifier", "length")
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_OF_TIME = ("period", "jitter", "deadline")
_COLUMNS = (
    *_NEEDED,
    "name",
    "sender",
    "extended",
    "fd",
    *(f"{column}_{unit}" for column in _OF_TIME for unit in _TIMES),
)
_YES, _NO = ("1", "yes", "true", "x"), ("", "0", "no", "false")
_HIGHEST_STANDARD = 0x7FF
_SWITCH = "CANFD_BRS"
_OFF = ("0", "no", "off", "false")
_LONGEST = 8  # bytes that a classic frame carries
_NO_MESSAGE = "VECTOR__INDEPENDENT_SIG_MSG"  # where Vector's editor keeps signals of no message


class MessageTable(NamedTuple):
    """Messages of a file, and the names of those that are left out: it gives no period, or no frame carries them."""

    messages: list[Message]
    without_period: list[str]
    transported: Sequence[str] = ()  # of more than 8 bytes, and not CAN FD: J1939's or ISO's transport protocol


def is_message_table(path: Path) -> bool:
    """Whether a file's name says that it is one. InputError for one that has to be converted."""
    if path.suffix.lower() in CONVERTIBLE:
        converted = path.with_suffix(".dbc").name
        raise InputError(f"convert it: `cantools convert {path.name} {converted}`, and name {converted}", str(path))
    return path.suffix.lower() in ENDINGS


def read_messages(path: Path, period: float | None = None) -> MessageTable:
    """The messages of a DBC file or a CSV table. `period` (s) is for those whose period the file does not say.

    Without it they are left out, and named. InputError for a file that is none, with the line of a CSV table.
    """
    if not path.is_file():
        raise InputError("there is no such file; check the name", str(path))
    found = _of_dbc(path, period) if path.suffix.lower() == ".dbc" else _of_csv(path, period)
    if not found.messages and not found.without_period and not found.transported:
        raise InputError("there are no messages in it; name a table of messages", str(path))
    if not found.messages and found.transported and not found.without_period:
        what = f"{found.transported[0]} has more than 8 bytes, and so have all messages of the file: one classic frame"
        cure = "if they are CAN FD, say so by the attribute VFrameFormat; else name the frames that carry them"
        raise InputError(f"{what} carries none of them; {cure}", str(path))
    if not found.messages:
        raise InputError("no message of the file has a period; give one for all by --sample-period, in s", str(path))
    return found


def _of_dbc(path: Path, period: float | None) -> MessageTable:
    """By the attribute GenMsgCycleTime (ms); CAN FD by VFrameFormat, its bit-rate switch by CANFD_BRS."""
    from rds.bus.tools.decode import load_dbc

    messages: list[Message] = []
    silent: list[str] = []
    transported: list[str] = []
    database = load_dbc(path)
    for entry in database.messages:
        if entry.name == _NO_MESSAGE:
            continue
        if entry.length > _LONGEST and not entry.is_fd:
            transported.append(entry.name)
            continue
        its_period = _period(entry.cycle_time) or period
        if its_period is None:
            silent.append(entry.name)
            continue
        messages.append(
            Message(
                name=entry.name,
                identifier=entry.frame_id,
                extended=entry.is_extended_frame,
                size=entry.length,
                period=its_period,
                sender=entry.senders[0] if entry.senders else None,
                fd=entry.is_fd,
                bitrate_switch=entry.is_fd and _switches_rate(entry, database),
            )
        )
    return MessageTable(messages, silent, transported)


def _period(cycle_time: Any) -> float | None:
    """In s, of GenMsgCycleTime in ms; None for 0, and for what is no time, as of an attribute that is a text."""
    try:
        found = float(cycle_time or 0) * 1e-3
    except (TypeError, ValueError, OverflowError):
        return None
    return found if isfinite(found) and found > 0.0 else None


def _switches_rate(entry: Any, database: Any) -> bool:
    """Whether a CAN FD frame's data go at the data bit rate: Vector's words are "0", "1"; yes if absent."""
    attribute = entry.dbc.attributes.get(_SWITCH)
    if attribute is not None:
        return str(attribute.value).lower() not in _OFF
    definition = database.dbc.attribute_definitions.get(_SWITCH)
    return definition is None or str(definition.default_value).lower() not in _OFF


def _of_csv(path: Path, period: float | None) -> MessageTable:
    messages: list[Message] = []
    silent: list[str] = []
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        head = file.readline()
        separator = max(",;\t", key=head.count)
        columns = [column.strip().lower() for column in head.rstrip("\r\n").split(separator)]
        _check_columns(columns, path)
        reader = csv.reader(file, delimiter=separator)
        try:
            for row in reader:
                if not row or row[0].lstrip().startswith("#"):
                    continue
                where = f"{path}:{reader.line_num + 1}"
                if len(row) != len(columns):
                    raise InputError(f"the line has {len(row)} columns, and the heading {len(columns)}", where)
                message = _message(dict(zip(columns, map(str.strip, row), strict=True)), period, where)
                if isinstance(message, str):
                    silent.append(message)
                else:
                    messages.append(message)
        except csv.Error as error:
            where = f"{path}:{reader.line_num + 1}"
            raise InputError(f"the line cannot be read ({error}); repair it", where) from error
        except InputError as error:  # of a message that cannot be
            if error.where:
                raise
            raise InputError(str(error), where) from error
    return MessageTable(messages, silent)


def _check_columns(columns: list[str], path: Path) -> None:
    missing = [column for column in _NEEDED if column not in columns]
    unknown = [column for column in columns if column not in _COLUMNS]
    if missing or unknown:
        what = f"has no column {' and no column '.join(missing)}" if missing else f"has the column {unknown[0]!r}"
        raise InputError(f"the first line {what}; the columns are {', '.join(_COLUMNS)}", f"{path}:1")
    meant = [next((column for column in _OF_TIME if name.startswith(f"{column}_")), name) for name in columns]
    if twice := next((column for column in meant if meant.count(column) > 1), None):
        raise InputError(f"{twice} is given twice; leave one out", f"{path}:1")


def _message(row: Mapping[str, str], period: float | None, where: str) -> Message | str:
    """The message of a line, or its name if no period is known."""
    identifier = _whole(row["identifier"], "identifier", where)
    name = row.get("name") or f"{identifier:#x}"
    its_period = _time(row, "period", where) or period
    if its_period is None:
        return name
    extended = _flag(row.get("extended", ""), "extended", where) or identifier > _HIGHEST_STANDARD
    is_fd = _flag(row.get("fd", ""), "fd", where)
    return Message(
        name=name,
        identifier=identifier,
        extended=extended,
        size=_whole(row["length"], "length", where),
        period=its_period,
        jitter=_time(row, "jitter", where) or 0.0,
        deadline=_time(row, "deadline", where),
        sender=row.get("sender") or None,
        fd=is_fd,
        bitrate_switch=is_fd,
    )


def _time(row: Mapping[str, str], column: str, where: str) -> float | None:
    """In s; None where the table says nothing."""
    for unit, factor in _TIMES.items():
        text = row.get(f"{column}_{unit}")
        if text:
            try:
                return float(text) * factor
            except ValueError:
                raise InputError(f"{column} {text!r} must be a number of {unit}", where) from None
    return None


def _whole(text: str, column: str, where: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise InputError(f"{column} {text!r} must be a whole number, as in 291 or 0x123", where) from None


def _flag(text: str, column: str, where: str) -> bool:
    if text.lower() in _YES or text.lower() in _NO:
        return text.lower() in _YES
    raise InputError(f"{column} {text!r} must be yes or no", where)
