"""A bus log as columns: each signal of each message, with the times at which it was received.

A DBC file says what its messages are; their signals are called `Message.Signal`. Without one, our own are known:
the cyclic messages (command.slot_0 ..., answer_2.position) and those of the distributed modules.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import can
import numpy as np

from rds.bus.modules.rds import frames
from rds.bus.tools.decode import load_dbc, own_dbc
from rds.bus.tools.log_formats import TEXTS
from rds.bus.tools.logs import LogFile
from rds.core.errors import InputError, MachineError
from rds.core.limits import UNPACKED, allow
from rds.core.progress import Progress
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.table import Column, Table

Signal = tuple[str, str | None, float]
_LOOK = 1 << 16  # frames between two looks at how much memory they take


def read_can(path: Path, dbc: Sequence[Path] = (), progress: Progress | None = None) -> Table:
    """All signals of a log in one of python-can's formats. InputError for a damaged log, or one without a known signal.

    Times are those that the recorder gave each frame, from the first frame on.
    """
    databases = [load_dbc(file) for file in dbc]
    twice = _described_twice(databases, dbc)
    own = own_dbc() if not databases else None  # another bus may use the same identifiers for something else
    if own is not None:
        databases.append(load_dbc(own))
    times: dict[str, array[float]] = {}
    values: dict[str, array[float]] = {}
    units: dict[str, str | None] = {}
    senders: dict[str, tuple[int, Any]] = {}  # identifier and channel of the frames that a column is from
    unknown: dict[int, int] = {}
    misfits = number = 0
    misfit = ""  # the first one's reason
    start: float | None = None
    size = path.stat().st_size if path.is_file() else 0
    log = LogFile(path)
    for number, message in enumerate(log, 1):
        if progress is not None and number % 4096 == 0:
            progress(
                min(number * 40, size), size
            )  # a frame takes about 40 bytes: the readers do not tell where they are
        if number % _LOOK == 0:
            size_now = 16 * sum(map(len, times.values()))
            allow(size_now, UNPACKED, f"its signals take {size_now} bytes and more", "give a part of it", path)
        if message.is_error_frame or message.is_remote_frame:
            continue
        start = message.timestamp if start is None else start
        if (message.arbitration_id, message.is_extended_id) in twice:
            raise twice[message.arbitration_id, message.is_extended_id]
        try:
            signals = list(_signals(message, databases, cyclic=not dbc))
        except ValueError as error:
            misfits, misfit = misfits + 1, misfit or f"{message.arbitration_id:#x}: {error}"
            continue
        if not signals:
            unknown[message.arbitration_id] = unknown.get(message.arbitration_id, 0) + 1
        for name, unit, value in signals:
            if name not in times:
                times[name], values[name], units[name] = array("d"), array("d"), unit
                senders[name] = message.arbitration_id, message.channel
            elif senders[name] != (message.arbitration_id, message.channel):
                raise _two_senders(name, senders[name], message, path)
            times[name].append(message.timestamp - start)
            values[name].append(value)
    if not number:
        what = (
            f"no bus could carry any of its {log.impossible} frames (identifier, or length)" if log.impossible else ""
        )
        raise InputError(f"{what or 'it holds no frames'}; record it again or take another copy", str(path))
    if not times:
        seen = ", ".join(f"{identifier:#x}" for identifier in sorted(unknown)[:8]) or "none"
        raise InputError(
            f"none of its {number} frames is known (unknown identifiers: {seen}; {misfits} frames do not fit their "
            f"description{_first(misfit)}); give the DBC file that describes them: "
            f'dbc = "axes.dbc" under [bus] in {path.name}.map.toml',
            str(path),
        )
    findings = []
    if path.suffix.lower() in TEXTS and not _ends(path):
        what = "its last line has no end: the recording was cut there, and its last frame may be wrong"
        findings.append(Finding("cut", what, Gravity.WARNING))
    if own is not None:
        named = ", ".join(sorted({name.partition(".")[0] for name in times})[:8])
        what = f"no DBC file is given, so frames were read as those of RDS's own modules ({named}); where others sent "
        what += 'them, give the DBC file that describes them: dbc = "axes.dbc" under [bus] in a map'
        findings.append(Finding("frames", what, Gravity.WARNING if unknown or misfits else Gravity.NOTE))
    if unknown:
        findings.append(Finding("frames", f"{sum(unknown.values())} frames of {len(unknown)} identifiers are unknown"))
    if misfits:
        what = f"{misfits} frames do not fit the description of their message, and were left out{_first(misfit)}"
        findings.append(Finding("frames", what, Gravity.WARNING))
    if log.impossible:
        what = f"{log.impossible} frames that no bus could carry (identifier, or length) were left out"
        findings.append(Finding("frames", what, Gravity.WARNING))
    if log.skipped:
        findings.append(Finding("frames", f"{log.skipped} lines describe no frame"))
    columns = {
        name: Column(name, units[name], np.frombuffer(values[name]).copy(), np.frombuffer(times[name]).copy())
        for name in sorted(times)
    }
    return Table(path, "can", columns, findings=tuple(findings))


def _two_senders(name: str, before: tuple[int, Any], message: can.Message, path: Path) -> InputError:
    """The error that a signal is in frames of two identifiers, or on two channels of the recorder."""
    identifier, channel = before
    if identifier != message.arbitration_id:
        what = f"{name} is in frames of {identifier:#x} and of {message.arbitration_id:#x}, and would be one column"
        return InputError(f"{what}; rename one of the two messages in the DBC files", str(path))
    what = f"{name} ({identifier:#x}) was received on two channels, {channel} and {message.channel}, and would be one "
    remedy = "column; make a log of one of them, in Python `with can.Logger('one.log') as log: [log(m) for m in "
    return InputError(f"{what}{remedy}can.LogReader(FILE) if m.channel == {channel!r}]`", str(path))


def _ends(path: Path) -> bool:
    """Whether the last line of a text is whole."""
    with open(path, "rb") as stream:
        stream.seek(-1, 2)
        return stream.read() in b"\r\n"


def _first(reason: str) -> str:
    return f", the first {reason:.200}" if reason else ""


def _described_twice(databases: Sequence[Any], files: Sequence[Path]) -> dict[tuple[int, bool], InputError]:
    """By identifier and whether it is an extended one: what to say if such a frame is met, as it is two messages."""
    seen: dict[tuple[int, bool], tuple[str, list[Any], Path]] = {}
    found = {}
    for database, path in zip(databases, files, strict=True):
        for message in database.messages:
            layout = [(s.name, s.start, s.length, s.byte_order, s.scale, s.offset, s.unit) for s in message.signals]
            key = (message.frame_id, bool(message.is_extended_frame))
            name, signals, earlier = seen.setdefault(key, (message.name, layout, path))
            if (name, signals) != (message.name, layout):
                what = f"identifier {message.frame_id:#x} is {message.name!r} there, and {name!r} in {earlier.name}"
                found[key] = InputError(
                    f"{what}, with other signals or names; remove one of the descriptions", str(path)
                )
    return found


def _signals(message: can.Message, databases: Sequence[Any], cyclic: bool) -> Iterator[Signal]:
    """The numbers in a frame, with unit; none for an unknown one. ValueError for one that does not fit."""
    own = None if message.is_extended_id or not cyclic else _cyclic(message.arbitration_id, bytes(message.data))
    if own is not None:
        yield from own
        return
    for database in databases:
        try:
            description = database.get_message_by_frame_id(
                message.arbitration_id, force_extended_id=message.is_extended_id
            )
        except KeyError:
            continue
        if bool(description.is_extended_frame) != message.is_extended_id:
            continue
        try:
            decoded = description.decode(bytes(message.data), decode_choices=False)
        except Exception as error:  # cantools raises errors of bitstruct, its own and plain ones
            raise ValueError(str(error)) from error
        units = {signal.name: signal.unit for signal in description.signals}
        for name, value in decoded.items():
            if isinstance(value, int | float):
                yield f"{description.name}.{name}", units.get(name) or None, float(value)
        return


def _cyclic(identifier: int, data: bytes) -> list[Signal] | None:
    try:
        if identifier in (frames.COMMAND, frames.MORE_VOLTAGES):
            first = frames.SLOTS * (identifier == frames.MORE_VOLTAGES)
            volts = frames.decode_voltages(identifier, data)
            return [(f"command.slot_{i}", "V", value) for i, value in enumerate(volts, first)]
        if identifier - frames.ANSWER in frames.NODES:
            answer = frames.decode_answer(identifier, data)
            if answer.kind == frames.Kind.ANSWER:
                return [(f"answer_{identifier - frames.ANSWER}.position", "counts", float(answer.counts))]
            return []
    except MachineError:
        return None
    return None
