"""Bus logs in python-can's formats: read with every damage named, written with every omission counted.

What formats there are, and what each keeps, is in log_formats.py. Read besides, whatever they are called: SavvyCAN's
and GVRET's CSV, BusMaster's .log, CRTD (.txt, .crtd) and the .can of Microchip's CAN BUS Analyzer (other_logs.py).

It is readable up to the last `flush()`, at most a second before. Times are exact to 1 µs in all; .asc keeps them from
its first frame on. Of an error frame, text formats keep that there was one.
"""

from __future__ import annotations

import gzip
import math
import re
import sqlite3
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO, cast

import can
from can.io.blf import BLFParseError
from can.util import dlc2len

from rds.bus.tools import log_lock, log_writers
from rds.bus.tools.log_formats import ENDINGS, FORMATS, PACKED, READ_ONLY, TEXTS, named
from rds.bus.tools.log_lines import Lines
from rds.bus.tools.mf4 import asammdf_missing, bring_asammdf, close_unopened
from rds.bus.tools.other_logs import LOGGED, UNTIMED, kind_of, read_other
from rds.core.errors import InputError
from rds.core.private_files import open_private

_LOOKED_AT = 1 << 14  # characters
_FRAME = re.compile(r"(?m)^\s*\(\d+\.\d+\)\s")
_DAMAGE = (
    ValueError,
    IndexError,
    KeyError,
    TypeError,
    OverflowError,
    EOFError,
    struct.error,
    NotImplementedError,
    AssertionError,
)


def ending(path: Path) -> tuple[str, bool]:
    """The format's ending in small letters, and whether the file is compressed. InputError for one that is not ours."""
    suffix = path.suffix.lower()
    packed = suffix == ".gz"
    if packed:
        suffix = path.with_suffix("").suffix.lower()
    if suffix not in ENDINGS or (packed and suffix not in TEXTS):
        raise InputError(
            f"there is no log format {path.suffix if not packed else suffix + '.gz'!r}; "
            f"end the name in {', '.join(ENDINGS)}, or {', '.join(PACKED)}",
            str(path),
        )
    return suffix, packed


def is_of_frames(path: Path) -> bool:
    """Whether a text is a log of frames, be it damaged: its lines begin with a time in brackets, or it is another's.

    A terminal calls what it has saved .log, too.
    """
    with path.open(encoding="utf-8", errors="replace") as text:
        return kind_of(text) is not None or _FRAME.search(text.read(_LOOKED_AT)) is not None


# --- reading


class LogFile:
    """A log to iterate over, again and again. `skipped` counts lines of the last pass that describe no frame.

    `impossible` counts frames that no bus could carry, which are left out: identifiers too large, too many bytes.

    Raises InputError at once if there is no such file or format, and while iterating, with the line or the offset,
    where the log is damaged.
    """

    def __init__(self, path: str | Path):
        self.path = path = Path(path)
        self.skipped = self.impossible = 0
        if path.suffix.lower() in READ_ONLY and path.is_file():
            self._ending, self._packed = path.suffix.lower(), False
        else:
            self._ending, self._packed = ending(path)
        if not path.is_file():
            raise InputError("there is no such log; check the name", str(path))

    def __iter__(self) -> Iterator[can.Message]:
        try:
            self.impossible = 0
            is_text = self._ending in TEXTS or self._ending in READ_ONLY
            for message in self._texts() if is_text else self._records():
                if _is_impossible(message):
                    self.impossible += 1
                else:
                    yield message
        except OSError as error:
            raise InputError(f"it can't be read: {error.strerror or error}", str(self.path)) from error

    def _texts(self) -> Iterator[can.Message]:
        """The frames of a text, by the tool that wrote it."""
        with self._open() as file:
            kind = None if self._packed else kind_of(file)
            if kind == UNTIMED:
                raise InputError("candump has written no times; record with `candump -L` or `-t a`", f"{self.path}:1")
            if kind is None and self._ending in READ_ONLY:
                raise InputError(
                    "it is no log of candump, CRTD or Microchip's CAN BUS Analyzer; is it a log?", str(self.path)
                )
            if kind not in (None, LOGGED):
                self.skipped = 0
                yield from read_other(file, kind, str(self.path), self._skip)
                return
        yield from self._lines(".log" if kind == LOGGED else self._ending)

    def _skip(self) -> None:
        self.skipped += 1

    def _lines(self, ending: str) -> Iterator[can.Message]:
        with self._open() as file:
            rules = FORMATS[ending].rules
            assert rules is not None, f"{ending} is no text"
            lines = Lines(file, str(self.path), rules, self.path.stat().st_size if self._packed else 0)
            found, before = False, -math.inf
            try:
                reader = named(FORMATS[ending].reader)(cast(TextIO, lines))
                for message in reader:
                    lines.frames += 1
                    problem = _problem(message)
                    if message.timestamp <= before and getattr(reader, "timestamps_format", "") == "relative":
                        what = "its head says `timestamps relative`: distances to the line before, which are no times; "
                        raise InputError(what + "save it with absolute ones", str(self.path))
                    before = message.timestamp
                    if problem:
                        raise lines.fault(problem)
                    found = True
                    yield message
            except (*_DAMAGE, zlib.error, gzip.BadGzipFile) as error:
                raise lines.fault(f"it can't be read as {ending}: {error or 'damaged'}") from error
            nothing = None if found else lines.nothing()
            if nothing:
                raise nothing
            self.skipped = lines.skipped

    def _open(self) -> TextIO:
        if self._packed:
            return cast(TextIO, gzip.open(self.path, "rt", encoding="utf-8", errors="replace"))
        return self.path.open(encoding="utf-8", errors="replace")

    def _records(self) -> Iterator[can.Message]:
        damage: tuple[type[Exception], ...] = (*_DAMAGE, zlib.error, sqlite3.Error, BLFParseError)
        if look := FORMATS[self._ending].look:
            named(look)(self.path)
        if self._ending == ".mf4":
            bring_asammdf()
            damage = (Exception,)  # asammdf raises whatever its decoder trips over
        number = 0
        reader: Any = None
        try:
            reader = can.LogReader(self.path)
            for number, message in enumerate(reader, 1):  # noqa: B007
                problem = _problem(message)
                if problem:
                    raise ValueError(problem)
                yield message
        except NotImplementedError as error:
            raise asammdf_missing(self.path) from error
        except damage as error:
            if self._ending == ".mf4":
                close_unopened(error)
            what = f"after {number} frames" if number else "it"
            raise InputError(
                f"{what} can't be read as {self._ending}: {error or 'damaged'}; record it again, or use another log",
                str(self.path),
            ) from error
        finally:
            if reader is not None:
                reader.stop()


def _problem(message: can.Message) -> str | None:
    """Why there is no such frame, or None. Mends what python-can's readers make of some files first."""
    size = len(message.data)
    if message.is_fd and message.is_remote_frame:
        message.is_fd = False  # CAN FD has none: it is a classic frame on a bus that carries both
    if message.is_fd and dlc2len(message.dlc) == size:
        message.dlc = size  # was the code of the length
    elif not message.is_fd and message.dlc > 8:
        message.dlc = 8  # codes 9 to 15 mean 8 too, and were taken for those of CAN FD
    if not math.isfinite(message.timestamp):
        return f"its time {message.timestamp} is no number of seconds"
    if message.is_error_frame or _is_impossible(message):
        return None
    if not message.is_remote_frame and size != message.dlc:
        return f"the frame has {size} bytes of data, and its length says {message.dlc}"
    return None


def _is_impossible(message: can.Message) -> bool:
    """Whether no bus could carry it."""
    if message.is_error_frame:
        return False
    highest = 0x1FFFFFFF if message.is_extended_id else 0x7FF
    return not 0 <= message.arbitration_id <= highest or len(message.data) > (64 if message.is_fd else 8)


# --- writing


class LogWriter:
    """A log that is being written. `unkept` counts, by their kind, the frames that the format cannot hold.

    Never overwrites an existing file without `force`, and none that another one is writing. Raises InputError for that
    and for an unknown ending, OSError where the disk says no (whenever it says so); the file then ends with what can be
    read (not .mf4 and .gz).
    """

    def __init__(self, path: str | Path, force: bool = False):
        self.path = path = Path(path)
        self._ending, packed = ending(path)
        self.frames = 0
        self.unkept: Counter[str] = Counter()
        self._last = 0.0
        if not force:
            try:
                open_private(path, "xb").close()
            except FileExistsError:
                raise InputError(
                    "it exists already; choose another name, or overwrite it with --force", str(path)
                ) from None
        else:
            log_lock.release(log_lock.hold(path))  # not while another one writes it
            if path.is_file() or not path.exists():  # no device and no pipe
                open_private(path, "ab").close()  # as private as a new one
        self._writer = log_writers.open_writer(path, self._ending, packed)
        try:
            self._lock = log_lock.hold(path)
        except InputError:
            self._writer.stop()
            raise

    def write(self, message: can.Message) -> None:
        """Add a frame. A time before the last frame's (a clock that was set back) becomes the last frame's."""
        kind = FORMATS[self._ending].unkept(message)
        if kind is not None:
            self.unkept[kind] += 1
            return
        if message.timestamp < self._last:
            message.timestamp = self._last
        self._last = message.timestamp
        try:
            self._writer.on_message_received(message)
        except OSError:
            self._writer.abandon()
            raise
        self.frames += 1

    def flush(self) -> None:
        """Bring everything so far to the disk, in a form that can be read if nothing more follows (not .mf4)."""
        try:
            self._writer.flush()
        except OSError:
            self._writer.abandon()
            raise

    def close(self) -> None:
        """Finish the file. May be called more than once."""
        try:
            self._writer.stop()
        except OSError:
            self._writer.abandon()
            raise
        finally:
            log_lock.release(self._lock)
            self._lock = None
