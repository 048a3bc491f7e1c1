"""A recorded bus laid over its schedule: each message's measured delays beside its worst-case response time.

Both count from the instant that the period gives (for answers: from the cycle's first frame) to the end of the
interframe space. What a log cannot tell makes the measured delay shorter and never longer (`cycles`), so one beyond
the bound says that the schedule which was analysed is not that of the bus.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rds.bus.analysis.analysis_report import Analysis, Row, row_called
from rds.bus.analysis.cycles import Paired, from_grid, from_releaser
from rds.bus.analysis.measured_words import (
    ABSENT,
    BEYOND,
    RESOLUTION,
    UNBOUNDED,
    WITHIN,
    findings,
    stamps,
    text,
    tracking,
)
from rds.bus.analysis.messages import Message, priority
from rds.bus.medium.bits import INTERFRAME, frame_bits
from rds.bus.tools.statistics import Key, Statistics
from rds.core.errors import InputError

if TYPE_CHECKING:
    import can

_TOLERANCE = 2.0 * RESOLUTION  # a delay is the difference of two times
_DENSE, _ALIKE = 0.01, 0.03  # share of the frames that tell the bit rate; they agree to that
_FEW = 20  # frames
_SET_BACK = 0.05  # s: by less, adapters deliver frames out of their order


class BusOccupancy(NamedTuple):
    """Who had the bus while a frame was late, s."""

    scheduled: float = 0.0
    foreign: float = 0.0
    free: float = 0.0


class Delays(NamedTuple):
    """The measured delays of one message, s; None where there are none. `at` and `stamp` are of the largest."""

    name: str
    frames: int  # that have a delay
    median: float | None
    largest: float | None
    at: float | None  # s since the log's first frame
    stamp: float | None  # s, as in the log
    bound: float  # worst-case response; inf if unbounded
    verdict: str  # within, beyond, unbounded, absent
    by_cycle: bool  # from the cycle's first frame; else by the period's instants, whose phase is not known
    period: float  # s: the schedule's
    log_period: float | None  # s: the log's
    missing: int  # instants without a frame
    extra: int  # frames without an instant
    pauses: int
    longer: int  # frames with more bytes than in the schedule
    values: np.ndarray  # of each frame
    during: BusOccupancy  # of the largest

    @property
    def beyond(self) -> float:
        """By how much the largest delay is beyond the bound, s; 0 if it is not."""
        return self.largest - self.bound if self.verdict == BEYOND and self.largest is not None else 0.0


class Foreign(NamedTuple):
    """Frames of an identifier that the schedule does not have."""

    text: str  # the identifier
    frames: int
    load: float  # %
    above: int  # messages of the schedule that give way to it


class Wire(NamedTuple):
    """What the distances between the ends of frames say of stamps and bit rate."""

    bitrate: float | None  # bit/s of frames that follow each other without a pause; None where too few do
    closer: float  # s: by which the closest frame ends too soon after the one before for the bit rate


@dataclass(frozen=True)
class Measured:
    """A log against an analysis; rows in the analysis's order."""

    path: str
    analysis: Analysis
    seconds: float
    frames: int
    errors: int  # error frames
    load: float  # %
    rows: tuple[Delays, ...]
    foreign: tuple[Foreign, ...]  # the heaviest load first
    wire: Wire
    cycle: Mapping[str, np.ndarray] = field(default_factory=dict)  # s, of each cycle: sensor, actuator; NaN: incomplete
    overrun: int = 0  # cycles whose last answer came after the next one had begun

    @property
    def met(self) -> bool:
        """Whether no measured delay is beyond its bound."""
        return all(row.verdict != BEYOND for row in self.rows)

    def row(self, name: str) -> Delays:
        """The row of the message called `name`; InputError names those there are."""
        return row_called(name, self.rows)

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps: times in µs but for those of the log, in s."""
        return {
            "log": self.path,
            "seconds": round(self.seconds, 6),
            "frames": self.frames,
            "error_frames": self.errors,
            "load_percent": round(self.load, 4),
            "within": self.met,
            "time_stamps": stamps(self),
            "messages": [_plain(row) for row in self.rows],
            "foreign": [
                {"identifier": f.text, "frames": f.frames, "load_percent": round(f.load, 4), "goes_before": f.above}
                for f in self.foreign
            ],
            "findings": findings(self),
            "tracking": tracking(self),
        }

    def __str__(self) -> str:
        return text(self)


def measured(analysis: Analysis, path: str | Path) -> Measured:
    """The delays in the log `path`, of any format that is read, against the bounds of `analysis`.

    InputError for a log that cannot be read, of several buses, without a frame of the schedule, whose time goes back.
    """
    from rds.bus.tools.logs import LogFile

    path = Path(path)
    if path.is_dir():
        said = "it is a folder, and --measured takes a bus log: a saved run keeps no frames; record them while it runs"
        raise InputError(f"{said} (`rds bus record run.log`)", str(path))
    return of_frames(analysis, _forward(LogFile(path), path), str(path))


def _forward(frames: Iterable[can.Message], path: Path) -> Iterator[can.Message]:
    """The frames of a log; InputError where its clock was set back, as two times of the bus would be mixed."""
    latest = -inf
    for number, frame in enumerate(frames, 1):
        latest = max(latest, frame.timestamp)
        if (back := latest - frame.timestamp) > _SET_BACK:
            said = f"its time stamps go back by {back:.6g} s at frame {number}, to {frame.timestamp:.6f} s"
            raise InputError(f"{said}: its clock was set, or two logs were joined; keep one part of it", str(path))
        yield frame


def of_frames(analysis: Analysis, frames: Iterable[can.Message], path: str = "log") -> Measured:
    """The same of frames in hand, which need not be in the order of their times."""
    log = _Log(analysis, path)
    for frame in sorted(frames, key=lambda frame: frame.timestamp):
        log.add(frame)
    counted = log.statistics.snapshot()
    if not any(log.frames.values()):
        seen = ", ".join(str(row.key) for row in counted.rows[:6]) or "none"
        wanted = ", ".join(row.identifier_text for row in analysis.rows[:6])
        raise InputError(
            f"none of its {counted.frames} frames is in the schedule ({wanted}); it has {seen}: "
            "name the machine or the table, and the --dialect, of this bus",
            path,
        )
    paired = _pair(analysis, log)
    cycle, overrun = _cycles(analysis.messages, log, paired)
    rows = tuple(
        _row(row, message, log, paired[message.name])
        for row, message in zip(analysis.rows, analysis.messages, strict=True)
    )
    foreign = [
        Foreign(str(row.key), row.count, row.load, _above(row.key, analysis.messages))
        for row in counted.rows
        if row.key not in log.frames
    ]
    return Measured(
        path=path,
        analysis=analysis,
        seconds=counted.seconds,
        frames=counted.frames,
        errors=counted.errors,
        load=counted.load,
        rows=rows,
        foreign=tuple(sorted(foreign, key=lambda each: -each.load)),
        wire=log.wire(),
        cycle=cycle,
        overrun=overrun,
    )


class _Log:
    """The frames of a log by message: starts, and ends with the interframe space, in s since the first frame."""

    def __init__(self, analysis: Analysis, path: str):
        self.bitrate, self.data_bitrate, self.path = analysis.bitrate, analysis.data_bitrate, path
        self.statistics = Statistics(self.bitrate, self.data_bitrate)
        self.keys = {m.name: Key(m.extended, m.identifier, m.remote) for m in analysis.messages}
        self.sizes = {self.keys[m.name]: m.size for m in analysis.messages}
        self.frames: dict[Key, list[tuple[float, float]]] = {key: [] for key in self.sizes}  # start, end
        self.longer = dict.fromkeys(self.sizes, 0)
        self.first: float | None = None
        self._bus: list[tuple[float, float, bool]] = []  # start, end, foreign
        self._space = INTERFRAME / self.bitrate
        self._channel: Any = None
        self._before: float | None = None
        self._gaps: list[tuple[float, int, float]] = []  # to the end before, bits, least time; one bit rate only
        self._times: dict[tuple[Any, ...], tuple[float, int]] = {}

    def add(self, frame: can.Message) -> None:
        """Take the next frame."""
        self.statistics.add(frame)
        if self.first is None:
            self.first = frame.timestamp
        self._channel = frame.channel if self._channel is None else self._channel
        if frame.channel not in (None, self._channel):
            what = f"it has frames of the channels {self._channel} and {frame.channel}, and is to be of one bus"
            raise InputError(f"{what}; keep those of one channel", self.path)
        at = frame.timestamp - self.first
        before, self._before = self._before, at
        if frame.is_error_frame:
            self._before = None
            return
        duration, bits = self._time(frame)
        if before is not None and bits:
            self._gaps.append((at - before, bits, duration + self._space))
        key = Key(frame.is_extended_id, frame.arbitration_id, frame.is_remote_frame)
        self._bus.append((at - duration, at + self._space, key not in self.frames))
        if key in self.frames:
            self.frames[key].append((at - duration, at + self._space))
            self.longer[key] += len(frame.data) > self.sizes[key]

    def _time(self, frame: can.Message) -> tuple[float, int]:
        """How long the frame was on the bus, s, and its bits with the interframe space; 0 for those of two rates."""
        data = bytes(frame.data)
        flags = (frame.is_extended_id, frame.is_remote_frame, frame.is_fd, frame.bitrate_switch)
        what = (frame.arbitration_id, data, flags, frame.dlc)
        if (found := self._times.get(what)) is None:
            dlc = frame.dlc if frame.is_remote_frame else None
            bits = frame_bits(frame.arbitration_id, data, *flags, dlc=dlc)
            time = bits.time(self.bitrate, self.data_bitrate) * 1e-9
            found = time, 0 if bits.fast else bits.total + INTERFRAME
            if len(self._times) < 100_000:
                self._times[what] = found
        return found

    def of(self, message: Message) -> tuple[np.ndarray, np.ndarray]:
        """The message's starts and ends."""
        both = np.array(self.frames[self.keys[message.name]]).reshape(-1, 2)
        return both[:, 0], both[:, 1]

    def during(self, begin: float, end: float) -> BusOccupancy:
        """Who had the bus from `begin` to `end`, s."""
        starts, ends, foreign = np.array(self._bus).T
        taken = np.clip(np.minimum(ends, end) - np.maximum(starts, begin), 0.0, None)
        other = float(taken[foreign > 0.0].sum())
        own = float(taken.sum()) - other
        return BusOccupancy(own, other, max(0.0, end - begin - own - other))

    def wire(self) -> Wire:
        """Bit rate and doubt by the closest frames: those that waited for the one before end just their bits later."""
        if len(self._gaps) < _FEW:
            return Wire(None, 0.0)
        gaps, bits, least = np.array(self._gaps).T
        each = gaps / bits  # s: a bit, or longer where the bus had a pause
        dense = float(np.quantile(each, _DENSE))
        alike = int((np.abs(each / dense - 1.0) < _ALIKE).sum()) if dense > 0.0 else 0
        bitrate = 1.0 / dense if alike >= max(_FEW // 2, 2 * _DENSE * len(each)) else None
        return Wire(bitrate, max(0.0, float((least - gaps).max())))


def _pair(analysis: Analysis, log: _Log) -> dict[str, Paired]:
    """The delays of each message by its name."""
    by_name = {message.name: message for message in analysis.messages}
    found = {}
    for message in analysis.messages:
        root = _root(message, by_name)
        starts, ends = log.of(message)
        if root is message:
            found[message.name] = from_grid(starts, ends, message.period)
            continue
        released, over = log.of(root)
        found[message.name] = from_releaser(released, over, ends, root.period, message.period / root.period)
    return found


def _root(message: Message, by_name: Mapping[str, Message]) -> Message:
    """The message that begins the cycle."""
    while message.after is not None:
        message = by_name[message.after]
    return message


def _row(row: Row, message: Message, log: _Log, paired: Paired) -> Delays:
    delays = paired.delays
    place = int(paired.least.argmax()) if len(delays) else None
    largest = None if place is None else float(paired.least[place])
    at, during = None, BusOccupancy()
    if place is not None and largest is not None:
        end = float(log.of(message)[1][paired.places[place]])
        at, during = end - INTERFRAME / log.bitrate, log.during(end - largest, end)
    if largest is None:
        verdict = ABSENT
    elif row.response == inf:
        verdict = UNBOUNDED
    else:
        verdict = WITHIN if largest <= row.response + _TOLERANCE else BEYOND
    return Delays(
        name=row.name,
        frames=len(delays),
        median=None if largest is None else float(np.median(delays)),
        largest=largest,
        at=at,
        stamp=None if at is None else at + (log.first or 0.0),
        bound=row.response,
        verdict=verdict,
        by_cycle=message.after is not None,
        period=row.period,
        log_period=paired.period,
        missing=paired.missing,
        extra=paired.extra,
        pauses=paired.pauses,
        longer=log.longer[log.keys[row.name]],
        values=delays if largest is None else np.minimum(delays, largest),
        during=during,
    )


def _above(key: Key, messages: Iterable[Message]) -> int:
    """How many messages give way to a foreign frame."""
    frame = Message("foreign", key.identifier, key.extended, 0, 1.0, remote=key.remote)
    return sum(priority(message) > priority(frame) for message in messages)


def _cycles(messages: Iterable[Message], log: _Log, paired: Mapping[str, Paired]) -> tuple[dict[str, np.ndarray], int]:
    """Delays of each cycle, s: until its first frame is there, and from then until its last one is; NaN: not all.

    Besides, how many cycles were not over before the next one.
    """
    by_name = {message.name: message for message in messages}
    cyclic = [m for m in by_name.values() if m.after is not None and m.period == _root(m, by_name).period]
    answers = [message for message in cyclic if len(paired[message.name].delays)]  # a run need not move all axes
    roots = {_root(message, by_name).name for message in answers}
    if len(roots) != 1:
        return {}, 0
    root = by_name[roots.pop()]
    starts, ends = log.of(root)
    last, count = np.zeros(len(starts)), np.zeros(len(starts), int)
    for message in answers:
        found = paired[message.name]
        times = log.of(message)[1][found.places]
        last[found.cycles] = np.maximum(last[found.cycles], times)
        count[found.cycles] += 1
    sensor = np.where(count == len(answers), last - ends, np.nan)
    actuator = np.full(len(starts), np.nan)
    own = paired[root.name]
    actuator[own.places] = own.delays - INTERFRAME / log.bitrate
    return {"sensor": sensor, "actuator": actuator}, int((last[:-1] > ends[1:]).sum())


def _plain(row: Delays) -> dict[str, Any]:
    def micro(seconds: float | None) -> float | None:
        return round(seconds * 1e6, 3) if seconds is not None and isfinite(seconds) else None

    return {
        "name": row.name,
        "frames": row.frames,
        "median_us": micro(row.median),
        "largest_us": micro(row.largest),
        "bound_us": micro(row.bound),
        "beyond_us": micro(row.beyond),
        "verdict": row.verdict,
        "counted_from": "cycle" if row.by_cycle else "period",
        "largest_at_s": None if row.at is None else round(row.at, 6),
        "largest_stamp_s": None if row.stamp is None else round(row.stamp, 6),
        "during_us": {key: micro(value) for key, value in row.during._asdict().items()},
        "period_us": micro(row.period),
        "log_period_us": micro(row.log_period),
        "missing": row.missing,
        "extra": row.extra,
        "pauses": row.pauses,
        "longer_frames": row.longer,
    }
