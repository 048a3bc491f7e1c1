"""What goes over a bus, counted: per identifier and in all. No I/O: frames in, numbers out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple

import can

from rds.bus.medium.bits import SHORTEST_ERROR, frame_bits
from rds.core.errors import InputError

BITRATE = 1_000_000  # bit/s
_NS = 1e-9


class Key(NamedTuple):
    """Frames that are counted together."""

    extended: bool
    identifier: int
    remote: bool

    def __str__(self) -> str:
        text = f"0x{self.identifier:08X}" if self.extended else f"0x{self.identifier:03X}"
        return f"{text} remote" if self.remote else text


@dataclass(frozen=True)
class Row:
    """Frames of one identifier. Times in s, rates in Hz."""

    key: Key
    count: int
    rate: float  # while it was sent: 1 by the mean period; NaN for less than two frames
    period: float  # mean; NaN for less than two frames
    jitter: float  # standard deviation of the period; NaN for less than three frames
    shortest: float  # period
    longest: float
    load: float  # % of the bit rate
    data: bytes  # of the last frame
    last: can.Message


@dataclass(frozen=True)
class Snapshot:
    """All that was counted until now."""

    rows: tuple[Row, ...]  # by identifier
    seconds: float  # that were watched
    frames: int  # data and remote frames
    errors: int  # error frames
    impossible: int  # frames that CAN doesn't have, of unknown length on the wire
    rate: float  # frames/s
    load: float  # % of the bit rate, exact frame lengths with interframe space
    last_error: can.Message | None = None  # error frame


class Statistics:
    """Counts frames on a bus of `bitrate` bit/s; the fast part of FD frames takes `data_bitrate`, by default the same.

    Frames are judged by their time stamps. The load takes each frame's exact length on the wire, stuffing, CRC and
    interframe space included, and an error frame's least, 17 bits. Above 100 % no real bus of this bit rate could
    carry them: the built-in bus without timing can.

    Raises InputError for a bit rate that is not positive.
    """

    def __init__(self, bitrate: int = BITRATE, data_bitrate: int | None = None):
        for rate in (bitrate, data_bitrate):
            if rate is not None and rate <= 0:
                raise InputError(f"bit rate {rate!r} bit/s must be more than 0; 1000000 is usual")
        self.bitrate, self.data_bitrate = bitrate, data_bitrate
        self._rows: dict[Key, _Counts] = {}
        self._errors = self._impossible = 0
        self._last_error: can.Message | None = None
        self._busy = 0  # ns
        self._first: float | None = None
        self._last = 0.0  # s, stamps

    def add(self, message: can.Message) -> None:
        """Count one frame."""
        stamp = message.timestamp
        if self._first is None:
            self._first = self._last = stamp
        self._last = max(self._last, stamp)
        if message.is_error_frame:
            self._errors += 1
            self._last_error = message
            self._busy += SHORTEST_ERROR * 1_000_000_000 // self.bitrate
            return
        key = Key(message.is_extended_id, message.arbitration_id, message.is_remote_frame)
        counts = self._rows.get(key)
        if counts is None:
            counts = self._rows[key] = _Counts(message)
        else:
            counts.add(message)
        duration = self._duration(message)
        counts.busy += duration
        self._busy += duration

    def _duration(self, message: can.Message) -> int:
        try:
            bits = frame_bits(
                message.arbitration_id,
                message.data,
                message.is_extended_id,
                message.is_remote_frame,
                message.is_fd,
                message.bitrate_switch,
                message.error_state_indicator,
                message.dlc if message.is_remote_frame else None,
            )
        except InputError:
            self._impossible += 1
            return 0
        return bits.time(self.bitrate, self.data_bitrate, interframe=True)

    def snapshot(self, seconds: float | None = None) -> Snapshot:
        """What was counted in `seconds`; by default from the first frame's time stamp to the last's."""
        if seconds is None:
            seconds = self._last - self._first if self._first is not None else 0.0
        rows = tuple(self._rows[key].row(key, seconds) for key in sorted(self._rows))
        frames = sum(row.count for row in rows)
        return Snapshot(
            rows=rows,
            seconds=seconds,
            frames=frames,
            errors=self._errors,
            impossible=self._impossible,
            rate=_per(frames, seconds),
            load=100.0 * _per(self._busy * _NS, seconds),
            last_error=self._last_error,
        )


class _Counts:
    """Running numbers of one identifier; mean and variance by Welford's recurrence (Technometrics 4, 1962)."""

    __slots__ = ("busy", "count", "first", "last", "longest", "mean", "shortest", "squares")

    def __init__(self, message: can.Message):
        self.count = 1
        self.first = message.timestamp
        self.last = message
        self.mean = self.squares = 0.0
        self.shortest = float("inf")
        self.longest = 0.0
        self.busy = 0  # ns on the wire

    def add(self, message: can.Message) -> None:
        period = message.timestamp - self.last.timestamp
        self.last = message
        deviation = period - self.mean
        self.mean += deviation / self.count  # as many periods as frames before this one
        self.squares += deviation * (period - self.mean)
        self.count += 1
        self.shortest = min(self.shortest, period)
        self.longest = max(self.longest, period)

    def row(self, key: Key, seconds: float) -> Row:
        nan = float("nan")
        several = self.count > 1
        return Row(
            key=key,
            count=self.count,
            rate=_per(1.0, self.mean) if several else nan,
            period=self.mean if several else nan,
            jitter=sqrt(self.squares / (self.count - 2)) if self.count > 2 else nan,
            shortest=self.shortest if several else nan,
            longest=self.longest if several else nan,
            load=100.0 * _per(self.busy * _NS, seconds),
            data=bytes(self.last.data),
            last=self.last,
        )


def since(now: Snapshot, before: Snapshot) -> Snapshot:
    """`now` with the rates and loads of the time between the two; counts and periods stay those of all the time."""
    seconds = now.seconds - before.seconds
    earlier = {row.key: row for row in before.rows}

    def recent(row: Row) -> Row:
        old = earlier.get(row.key)
        count = row.count - (old.count if old else 0)
        busy = row.load * now.seconds - (old.load * before.seconds if old else 0.0)
        return replace(row, rate=_per(count, seconds), load=max(0.0, _per(busy, seconds)))

    return replace(
        now,
        rows=tuple(recent(row) for row in now.rows),
        seconds=seconds,
        rate=_per(now.frames - before.frames, seconds),
        load=max(0.0, _per(now.load * now.seconds - before.load * before.seconds, seconds)),
    )


def _per(amount: float, time: float) -> float:
    return amount / time if time > 0.0 else 0.0
