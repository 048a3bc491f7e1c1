"""Text logs that python-can does not read: SavvyCAN's and GVRET's CSV, BusMaster, CRTD, Microchip's CAN BUS Analyzer,
and what `candump -t a`, `-t z` and `-t A` show on a terminal. `candump -L` is known here too, and read elsewhere.

They are recognized by their first lines, not by their names: .csv, .log and .txt are used by several tools.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import TextIO

import can

from rds.core.errors import InputError

_HEAD = 2048  # characters that are looked at
_STANDARD = 0x7FF
_DAY = 86400.0  # s
_DATED = 1e8  # s: times beyond are of a clock, which may be set back; below they begin with the recording
Parse = Callable[[str], can.Message | None]  # a line; None: it describes no frame. ValueError, IndexError: damaged

_CRTD = re.compile(r"\d+\.\d+\s+\d*(?:[RT](?:11|29)|C[A-Z]{2})\b")
_MICROCHIP = re.compile(r"\s*(?://-{3,}|Microchip Technology)")
_BUSMASTER = re.compile(r"\*{3}BUSMASTER")
_SHOWN_FRAME = (
    r"(?P<channel>\S+)\s+(?:(?P<way>RX|TX)\s+(?P<switched>\S)\s+(?P<passive>\S)\s+)?"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})\s+\[(?P<size>\d+)\]"
)
_SHOWN = re.compile(rf"\s*\((?:(?P<time>\d+\.\d+)|(?P<date>\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+))\)\s+{_SHOWN_FRAME}")
_SHOWN_UNTIMED = re.compile(rf"\s*{_SHOWN_FRAME}")
_LOGGED = re.compile(r"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#")
LOGGED, UNTIMED = "candump -L", "candump without times"  # kinds that `read_other` does not read
_GVRET = re.compile(r"Time ?Stamp,\s*ID,\s*Extended,", re.IGNORECASE)


def kind_of(file: TextIO) -> str | None:
    """The tool that wrote a text, by its beginning, from which it is read again; None for none of these."""
    head = file.read(_HEAD)
    file.seek(0)
    first = head.lstrip("\ufeff")
    patterns = {
        "GVRET": _GVRET,
        "BusMaster": _BUSMASTER,
        "Microchip": _MICROCHIP,
        "CRTD": _CRTD,
        "candump": _SHOWN,
        LOGGED: _LOGGED,
        UNTIMED: _SHOWN_UNTIMED,
    }
    for kind, pattern in patterns.items():
        if pattern.match(first):
            return kind
    return None


def parser(kind: str) -> Parse:
    """What makes a frame of a line of this kind; it keeps what headings say."""
    parsers: dict[str, Callable[[], Parse]] = {
        "GVRET": _Gvret,
        "BusMaster": _BusMaster,
        "Microchip": _Microchip,
        "CRTD": _Crtd,
        "candump": _Candump,
    }
    return parsers[kind]()


def read_other(file: TextIO, kind: str, path: str, skip: Callable[[], None]) -> Iterator[can.Message]:
    """The frames of a log; `skip` is called for each line that is something else. InputError at a damaged line."""
    parse = parser(kind)
    for number, line in enumerate(file, 1):
        text = line.strip().lstrip("\ufeff")
        if not text:
            continue
        try:
            message = parse(text)
        except InputError as error:
            raise InputError(str(error), f"{path}:{number}") from error
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(
                f"it can't be read as a line of {kind} ({error}): {text[:60]!r}; correct the line, or take it out",
                f"{path}:{number}",
            ) from error
        if message is None:
            skip()
        else:
            yield message


def _message(
    stamp: float,
    identifier: int,
    extended: bool,
    data: bytes,
    size: int,
    is_rx: bool = True,
    remote: bool = False,
    channel: str | None = None,
) -> can.Message:
    if not remote and len(data) < size:
        raise ValueError(f"{len(data)} bytes of data, and its length says {size}")
    return can.Message(
        timestamp=stamp,
        arbitration_id=identifier,
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=size,
        data=b"" if remote else data[:size],
        is_rx=is_rx,
        channel=channel,
    )


class _Gvret:
    """Time in µs, identifier in hexadecimal, with or without a direction; bus, length, bytes."""

    def __init__(self) -> None:
        self._columns: list[str] = []

    def __call__(self, line: str) -> can.Message | None:
        words = [word.strip() for word in line.split(",")]
        if not self._columns:
            self._columns = [word.lower().replace(" ", "") for word in words]
            return None
        row = dict(zip(self._columns, words, strict=False))
        size = int(row["len"])
        first = self._columns.index("len") + 1
        data = bytes(int(word, 16) for word in words[first : first + size])
        extended = row["extended"].lower() in ("true", "1")
        stamp = int(row["timestamp"]) * 1e-6
        received = row.get("dir", "Rx").lower() != "tx"
        return _message(stamp, int(row["id"], 16), extended, data, size, received, channel=row.get("bus"))


class _BusMaster:
    """Time of day to 0.1 ms, direction, channel, identifier, kind (s, x, sr, xr), length, bytes; HEX or DEC."""

    def __init__(self) -> None:
        self._base = 16
        self._days, self._last = 0, 0.0  # that the log has lasted, and the time before

    def __call__(self, line: str) -> can.Message | None:
        if line.startswith("***"):
            if "***DEC***" in line:
                self._base = 10
            if "***RELATIVE MODE***" in line:
                what = "its head says RELATIVE MODE: distances to the line before, which are no times; "
                raise InputError(what + "log in BusMaster with system or absolute time")
            return None
        words = line.split()
        if len(words) < 6 or ":" not in words[0]:
            return None
        hours, minutes, seconds, parts = words[0].split(":")
        stamp = int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(parts) * 10.0 ** -len(parts)
        self._days += stamp < self._last - _DAY / 2  # past midnight
        self._last = stamp
        kind, size = words[4].lower(), int(words[5])
        if kind not in ("s", "x", "sr", "xr"):
            return None
        data = bytes(int(word, self._base) for word in words[6 : 6 + size])
        identifier = int(words[3], self._base)
        received, remote = words[1].lower() != "tx", kind.endswith("r")
        return _message(stamp + self._days * _DAY, identifier, kind[0] == "x", data, size, received, remote, words[2])


class _Crtd:
    """Time in s, kind (R11, T29, ... with a bus before it), identifier and bytes in hexadecimal."""

    def __call__(self, line: str) -> can.Message | None:
        words = line.split()
        kind = words[1].lstrip("0123456789").upper()
        bus = words[1][: len(words[1]) - len(kind)] or None
        if kind not in ("R11", "R29", "T11", "T29"):
            return None
        data = bytes(int(word, 16) for word in words[3:])
        received = kind[0] == "R"
        return _message(float(words[0]), int(words[2], 16), kind.endswith("29"), data, len(data), received, channel=bus)


class _Microchip:
    """Time in ms, RX or TX, identifier, length, bytes; between semicolons."""

    def __call__(self, line: str) -> can.Message | None:
        words = [word.strip() for word in line.split(";")]
        if len(words) < 4 or not words[0].replace(".", "", 1).isdigit():
            return None
        identifier, size = int(words[2], 16), int(words[3])
        data = bytes(int(word, 16) for word in words[4 : 4 + size] if word)
        stamp = float(words[0]) * 1e-3
        return _message(stamp, identifier, identifier > _STANDARD, data, size, words[1].upper() != "TX")


class _Candump:
    """Time in s or date in brackets, channel, identifier, length in brackets, bytes in hexadecimal.

    With -x the direction comes before the identifier, and of CAN FD whether the data are fast (B) and the sender error
    passive (E). A length of two digits means CAN FD.
    """

    def __init__(self) -> None:
        self._times: list[float] = []  # the first, and the last

    def __call__(self, line: str) -> can.Message | None:
        found = _SHOWN.match(line)
        if found is None:
            raise ValueError("no time in brackets, identifier and length")
        words = line[found.end() :].split()
        identifier, size = found["id"], int(found["size"])
        if len(found["size"]) > 2:  # four digits: CAN XL
            return None
        remote = words[:1] == ["remote"]
        data = b"" if remote else bytes(int(word, 16) for word in words[:size])
        stamp = float(found["time"]) if found["time"] else datetime.fromisoformat(found["date"]).timestamp()
        if self._times and self._times[0] < _DATED and stamp < self._times[-1]:
            raise ValueError("its time goes back: `candump -t d` writes the distance to the frame before; use -t a")
        self._times = [*self._times[:1], stamp]
        received, channel = found["way"] != "TX", found["channel"]
        if "ERRORFRAME" in words:
            return can.Message(timestamp=stamp, is_error_frame=True, channel=channel)
        message = _message(stamp, int(identifier, 16), len(identifier) > 3, data, size, received, remote, channel)
        message.is_fd = len(found["size"]) == 2
        message.bitrate_switch = message.is_fd and found["switched"] == "B"
        message.error_state_indicator = message.is_fd and found["passive"] == "E"
        return message
