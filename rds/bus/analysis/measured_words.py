"""What a log laid over its schedule says, in words: the table, what does not go together, and what tracking loses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.bus.analysis.analysis_report import aligned, time_text
from rds.bus.analysis.cycles import OTHER_PERIOD
from rds.bus.analysis.messages import HOST

if TYPE_CHECKING:
    from rds.bus.analysis.measured import Delays, Measured

WITHIN, BEYOND, UNBOUNDED, ABSENT = "within", "beyond", "unbounded", "absent"
RESOLUTION = 1e-6  # s: of the times in a log

_HEAD = ("message", "frames", "median", "largest", "bound", "of the period", "largest at", "")
_BITRATES = (10_000, 20_000, 33_333, 50_000, 83_333, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
_OTHER_RATE = 0.05
_DOUBT = 3.0 * RESOLUTION  # s: closer frames than that are not explained by rounded times
_NAMED = 6


def text(measured: Measured) -> str:
    """The log against the bounds, as `rds bus analyse --measured` prints it."""
    said = [*findings(measured), *tracking(measured)]
    amount = f"{measured.frames} frames in {measured.seconds:.6g} s, load {measured.load:.1f} %"
    return "\n".join(
        [
            f"measured: {measured.path}, {amount}",
            stamps(measured),
            "",
            *aligned([_HEAD, *map(_cells, measured.rows)], left=(0, len(_HEAD) - 1)),
            *["", *said],
        ]
    ).rstrip()


def stamps(measured: Measured) -> str:
    """Whose times they are, and how far they can be trusted."""
    known = "times are the log's, of the end of each frame, to 1 µs; who stamped them it does not say"
    if not measured.wire.closer > _DOUBT:
        return f"{known}. No frame is closer to the one before than the wire allows"
    return (
        f"{known}. Frames are up to {time_text(measured.wire.closer)} closer to the one before than "
        f"{measured.analysis.bitrate / 1e3:g} kbit/s allows: each delay is uncertain by that, if software or an "
        "adapter stamped them late, or the bus has no bit timing"
    )


def findings(measured: Measured) -> list[str]:
    """What is beyond its bound and what may be wrong in the schedule; what the log has and the schedule does not."""
    late = [row for row in measured.rows if row.verdict == BEYOND]
    said = [_beyond(row) for row in late]
    causes = _evidence(measured)
    if late:
        said.append("The schedule that was analysed is not that of this bus. " + _suspects(measured, late, causes))
    said += causes
    absent = [row.name for row in measured.rows if row.verdict == ABSENT]
    if absent:
        said.append(f"Not in the log, or in no cycle of it: {_few(absent)}.")
    if extra := [f"{row.name} ({row.extra})" for row in measured.rows if row.extra]:
        said.append(
            f"Frames of no cycle or instant of their period are left out: {_few(extra)}. They belong to set-up, answer "
            "other frames, or are sent by events."
        )
    if any(not row.by_cycle and row.frames for row in measured.rows):
        said.append(
            "Where messages come by a period of their own, the log does not tell its phase: delays count from the "
            "earliest grid that it allows, and the largest is a lower bound."
        )
    if any(row.by_cycle and row.frames for row in measured.rows):
        said.append("Answers count from the start of their cycle's first frame; what that one waited comes on top.")
    return said


def tracking(measured: Measured) -> list[str]:
    """What the delays are to a loop that is closed over this bus."""
    if not measured.cycle:
        rows = [row for row in measured.rows if row.largest is not None]
        if not rows:
            return ["Tracking: no message of the log has a delay that can be measured."]
        worst = max(rows, key=lambda row: (row.largest or 0.0) / row.period)
        share = 100.0 * (worst.largest or 0.0) / worst.period
        return [
            f"Tracking: at most {share:.1f} % of its period is taken by the delay of a message ({worst.name}). A loop "
            "that is closed over it bears that besides its sample: `rds network cost EXPERIMENT.toml --delay "
            f"uniform:low={_low(worst):.3g},high={worst.largest:.3g}` tells what it costs."
        ]
    sensor = measured.cycle["sensor"]
    whole = sensor[np.isfinite(sensor)]
    lost = len(sensor) - len(whole)
    if not len(whole):
        return [f"Tracking: none of {lost} cycles has all its frames."]
    period = min(row.period for row in measured.rows if row.by_cycle)
    middle, most = float(np.median(whole)), float(whole.max())
    said = (
        f"Tracking: the last frame of a cycle comes {time_text(middle)} (median) and at most {time_text(most)} after "
        f"its first frame, {100 * middle / period:.1f} % and {100 * most / period:.1f} % of the sample period. A "
        f"position of that age is up to {most * 1e3:.3g} µm behind for each mm/s of the axis."
    )
    if measured.overrun or lost:
        said += (
            f" Of {len(sensor)} cycles {measured.overrun} end after the next one has begun, and {lost} have frames "
            "missing: such a cycle costs the loop a sample of delay."
        )
    answers = {message.name for message in measured.analysis.messages if message.after is not None}
    at_once = any(row.sender == HOST for row in measured.analysis.rows if row.name in answers)
    next_command = (
        "RDS's host sends the voltages with the next command, so a cycle that is complete in time costs its loop no "
        "more than that one sample. For a host that sends them at once: "
    )
    how = ("" if at_once else next_command) + (
        "--trace FILE.csv writes the delays of each "
        "cycle, and `rds network cost EXPERIMENT.toml --delays FILE.csv` tells what their mean and jitter cost; `rds "
        "design lqg` tells the margins."
    )
    return [said, how]


def _low(row: Delays) -> float:
    return float(row.values.min()) if len(row.values) else 0.0


def _beyond(row: Delays) -> str:
    often = f"; {int((row.values > row.bound).sum())} of {row.frames} frames are beyond it" if row.by_cycle else ""
    return (
        f"{row.name} is beyond its bound by {time_text(row.beyond)}: {time_text(row.largest or 0.0)} at "
        f"{row.at:.6f} s of the log (stamp {row.stamp:.6f}){often}. Of that time "
        f"frames of the schedule had the bus for {time_text(row.during.scheduled)}, foreign frames for "
        f"{time_text(row.during.foreign)}, and nobody for {time_text(row.during.free)}."
    )


def _suspects(measured: Measured, late: list[Delays], causes: list[str]) -> str:
    """Where to look: what the log shows, then senders, which are late where the bus was free for longer than that."""
    said = ["What else the log shows is below."] if causes else []
    free = [row for row in late if row.during.free >= row.beyond]
    if not free:
        return " ".join(said)
    if measured.analysis.machine:
        host = ["the host was later than assumed (--host-jitter)"] if any(not row.by_cycle for row in free) else []
        slow = "modules answered later than assumed (--response-time, which `rds report response` measures)"
        own = [*host, *([slow] if any(row.by_cycle for row in free) else [])]
    else:
        own = ["senders were later than the table says (its jitter column), or send by events and not by the period"]
    names = _few([row.name for row in free])
    return " ".join([*said, f"While {names} came late, the bus was free for longer than that: {', and '.join(own)}."])


def _evidence(measured: Measured) -> list[str]:
    """What in the log contradicts the schedule's assumptions."""
    said = []
    rate, assumed = measured.wire.bitrate, measured.analysis.bitrate
    if rate is not None and abs(rate / assumed - 1.0) > _OTHER_RATE:
        near = min(_BITRATES, key=lambda each: abs(each / rate - 1.0))
        other = "the sender leaves pauses" if near == assumed else f"try --bitrate {near}"
        said.append(
            f"Bit rate: the closest frames follow each other as at about {rate / 1e3:.0f} kbit/s, not at "
            f"{assumed / 1e3:g}: {other}, or the stamps are not those of the wire."
        )
    for row in measured.rows:
        if row.log_period is not None and abs(row.log_period / row.period - 1.0) > OTHER_PERIOD:
            period = f"{row.log_period * 1e3:.4g} ms in the log, {row.period * 1e3:.4g} ms in the schedule"
            said.append(f"Period: {row.name} comes every {period}; its delays count by the log's.")
        if row.missing:
            said.append(f"Missing: {row.name} did not come in {row.missing} of its periods.")
        if row.pauses:
            again = f"{row.pauses} time{'s' if row.pauses > 1 else ''}"
            said.append(f"Pauses: {row.name} began anew {again}, after a pause or with another phase.")
        if row.longer:
            said.append(f"Length: {row.longer} frames of {row.name} have more bytes than in the schedule.")
    if measured.errors:
        free = " and the bounds are those of a bus without errors" if measured.analysis.errors is None else ""
        said.append(f"Errors: error frames in the log: {measured.errors}{free} (--errors).")
    if measured.foreign:
        load = sum(each.load for each in measured.foreign)
        before = sum(each.load for each in measured.foreign if each.above)
        each = [f"{f.text} ({f.frames}, {f.load:.2g} %)" for f in measured.foreign]
        said.append(
            f"Foreign: identifiers that are not in the schedule: {len(measured.foreign)}, {load:.2g} % of the bus, "
            f"{before:.2g} % before messages of it: {_few(each)}. A machine's set-up and scans are among such frames."
        )
    return said


def _cells(row: Delays) -> tuple[str, ...]:
    if row.median is None or row.largest is None or row.at is None:
        return (row.name, str(row.frames), "-", "-", time_text(row.bound), "-", "-", row.verdict)
    beyond = f" by {time_text(row.beyond)}" if row.beyond else ""
    share = f"{100 * row.largest / row.period:.1f} %"
    times = (time_text(row.median), time_text(row.largest), time_text(row.bound))
    return (row.name, str(row.frames), *times, share, f"{row.at:.6f} s", row.verdict + beyond)


def _few(names: list[str]) -> str:
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
