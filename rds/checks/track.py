"""Whether the rows of an interpolator lead along the segment, from its start to its end."""

from __future__ import annotations

import numpy as np

from rds.checks import clauses
from rds.checks.paths import chord_distances, distances, name_of, swept
from rds.checks.report import Findings
from rds.checks.rows import Trace
from rds.core.geometry import length, sweep
from rds.core.types import ArcSegment
from rds.core.values import shown

PATH = 0.05  # mm: several counts of a mill's encoder, and several steps of a reference-pulse interpolator
END = 0.05  # mm
CLOSE = 0.006  # mm: an end farther off than this and nearer than END is worth a word
_ANGLE = 0.05  # rad
_DISAGREEMENT = 0.1  # of the feed rate, root mean square
_QUICK, _SLOW = 0.8, 3.0  # of the time that the feed rate gives


def judge_track(found: Findings, trace: Trace, T: float) -> None:
    """Note in `found` where the rows of a complete `trace`, sampled every `T` s, leave their segment."""
    segment, rows = trace.segment, trace.rows
    position, name = rows[:, 0, :], name_of(segment)
    start = float(np.linalg.norm(position[0] - segment.start))
    if start > END + 2 * segment.feed_rate * T:
        said = f"{name} starts at {shown(segment.start)} and the first row at {shown(position[0].tolist())}"
        found.fault(clauses.START, f"{said}; start there, or one sample further")
    end = float(np.linalg.norm(position[-1] - segment.end))
    said = f"{name} ends at {shown(segment.end)} and the last row at {shown(position[-1].tolist())}, {end:.3g} mm away"
    if end > END:
        found.fault(clauses.END, f"{said}; let the last row be the end")
    elif end > CLOSE:
        found.warn(clauses.END, f"{said}; let the last row be the end")
    away = distances(segment, position)
    if away.max() > PATH:
        k = int(away.argmax())
        found.fault(
            clauses.PATH, f"row {k} of {name}, {shown(position[k].tolist())}, is {away[k]:.3g} mm beside the path"
        )
    elif isinstance(segment, ArcSegment):
        _judge_sweep(found, segment, position)
    _judge_speed(found, trace, T)


def follows_chord(trace: Trace) -> bool:
    """Whether an arc was taken for the straight line between its ends."""
    return trace.complete and bool(chord_distances(trace.segment, trace.rows[:, 0, :]).max() <= PATH)


def _judge_sweep(found: Findings, segment: ArcSegment, position: np.ndarray) -> None:
    went, wanted = swept(segment, position), sweep(segment)
    if abs(went - wanted) > _ANGLE:
        said = f"on {name_of(segment)} the rows go round by {np.degrees(went):.0f}°, not by {np.degrees(wanted):.0f}°"
        remedy = "counter-clockwise is positive, and an end equal to the start is a full circle"
        found.fault(clauses.SWEEP, f"{said}; {remedy}")


def _judge_speed(found: Findings, trace: Trace, T: float) -> None:
    segment, rows = trace.segment, trace.rows
    taken, wanted = len(rows) * T, length(segment) / segment.feed_rate
    if not _QUICK * wanted - 2 * T <= taken <= _SLOW * wanted + 1.0:
        said = (
            f"{name_of(segment)} takes {taken:.3g} s, and {wanted:.3g} s at its feed rate of {segment.feed_rate:g} mm/s"
        )
        found.warn(clauses.FEED, f"{said}; move by feed_rate·T in a sample")
    if len(rows) < 5:
        return
    measured = (rows[2:, 0, :] - rows[:-2, 0, :]) / (2 * T)
    difference = np.sqrt(np.mean((rows[1:-1, 1, :] - measured)[1:-1] ** 2)) / segment.feed_rate
    if difference > _DISAGREEMENT:
        said = (
            f"the velocities of {name_of(segment)} differ from the change of position by {difference:.0%} of the feed"
        )
        found.warn(clauses.VELOCITY, f"{said}; a controller that feeds velocity forward will push the wrong way")
