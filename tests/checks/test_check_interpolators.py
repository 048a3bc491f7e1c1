"""Interpolators known to be bad, each with the clause that it breaks, and good ones without a false alarm."""

from __future__ import annotations

import math
import random
import time

import numpy as np
import pytest

from rds.checks import check_interpolator, clauses
from rds.core.types import ArcSegment, LineSegment

done = 0.0


def line(segment, T, params):
    """Constant speed from start to end."""
    if not isinstance(segment, LineSegment):
        raise ValueError("it interpolates straight lines only")
    start, end = np.array(segment.start), np.array(segment.end)
    length = float(np.linalg.norm(end - start))
    samples = math.ceil(length / segment.feed_rate / T)
    velocity = (end - start) / length * segment.feed_rate
    for k in range(samples):
        yield start + velocity * k * T, velocity, np.zeros(len(start))
    yield end, 0 * velocity, 0 * velocity


def arc(segment, T, params):
    centre = np.array(segment.centre)
    i, j = segment.plane
    radius = math.dist(segment.start, segment.centre)
    first = math.atan2(segment.start[j] - centre[j], segment.start[i] - centre[i])
    last = math.atan2(segment.end[j] - centre[j], segment.end[i] - centre[i])
    turn = (last - first) % (2 * math.pi) or 2 * math.pi
    if segment.clockwise:
        turn = -((first - last) % (2 * math.pi) or 2 * math.pi)
    samples = math.ceil(abs(turn) * radius / segment.feed_rate / T)
    speed = turn / (samples * T)
    for k in range(samples + 1):
        angle = first + speed * k * T
        unit, normal = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        yield centre + radius * unit, radius * speed * normal, -radius * speed**2 * unit


def both(segment, T, params):
    yield from (arc if isinstance(segment, ArcSegment) else line)(segment, T, params)


def trapezoid(segment, T, params):
    """With acceleration, position as lists, rows as lists."""
    start, end = np.array(segment.start), np.array(segment.end)
    length, feed, a = float(np.linalg.norm(end - start)), segment.feed_rate, params["acceleration"]
    direction = (end - start) / length
    ramp = feed / a
    total = length / feed + ramp
    for k in range(1, math.ceil(total / T) + 1):
        t = min(k * T, total)
        if t < ramp:
            s, v, acceleration = a * t * t / 2, a * t, a
        elif t < total - ramp:
            s, v, acceleration = feed * (t - ramp / 2), feed, 0.0
        else:
            s, v, acceleration = length - a * (total - t) ** 2 / 2, a * (total - t), -a
        yield [(start + s * direction).tolist(), (v * direction).tolist(), (acceleration * direction).tolist()]


def whole_list(segment, T, params):
    return list(line(segment, T, params))


def whole_array(segment, T, params):
    return np.array(list(line(segment, T, params)))


def same_buffer(segment, T, params):
    """Yields the same array over and over, with new content."""
    buffer = np.zeros((3, len(segment.start)))
    for row in line(segment, T, params):
        buffer[:] = row
        yield buffer


@pytest.mark.parametrize(
    ("good", "params", "note"),
    [
        (line, None, "LineSegment only"),
        (arc, None, "ArcSegment only"),
        (both, None, None),
        (whole_list, None, "LineSegment only"),
        (whole_array, None, "LineSegment only"),
        (same_buffer, None, "LineSegment only"),
    ],
)
def test_no_false_alarm(good, params, note):
    report = check_interpolator(good, params=params)
    assert report.ok and not report.warnings, str(report)
    assert [n for n in report.notes if note and note in n] or not note, str(report)
    assert report.timing is not None and report.timing.calls > 100


def test_no_false_alarm_over_acceleration():
    report = check_interpolator(trapezoid, params={"acceleration": 400.0})
    assert report.ok, str(report)
    assert [warning.clause for warning in report.warnings] == [clauses.SEGMENTS]  # it cuts the corner of every arc


def remembers(segment, T, params):
    global done
    for position, velocity, acceleration in line(segment, T, params):
        done += T
        yield position + 1e-3 * done, velocity, acceleration


def remembers_segment(segment, T, params, current=[None]):  # noqa: B006
    current[0] = segment
    for k, _ in enumerate(line(segment, T, params)):
        yield from list(line(current[0], T, params))[k : k + 1]


def jitters(segment, T, params):
    for position, velocity, acceleration in line(segment, T, params):
        yield position + 1e-3 * random.random(), velocity, acceleration


def never_ends(segment, T, params):
    while True:
        yield segment.start, [0.0] * len(segment.start), [0.0] * len(segment.start)


def positions_only(segment, T, params):
    for position, _, _ in line(segment, T, params):
        yield position


def two_axes_always(segment, T, params):
    for row in line(segment, T, params):
        yield tuple(part[:2] for part in row)


def one_axis(segment, T, params):
    for row in line(segment, T, params):
        yield tuple(part[0] for part in row)


def text(segment, T, params):
    for _ in line(segment, T, params):
        yield ["a", "b"], ["a", "b"], ["a", "b"]


def not_a_number(segment, T, params):
    for position, velocity, _ in line(segment, T, params):
        yield position, velocity, velocity * math.nan


def nothing(segment, T, params):
    list(line(segment, T, params))


def no_rows(segment, T, params):
    return iter(())


def three_arrays(segment, T, params):
    rows = np.array(list(line(segment, T, params)))
    return rows[:, 0], rows[:, 1], rows[:, 2]


def stops_short(segment, T, params):
    rows = list(line(segment, T, params))
    yield from rows[: len(rows) // 2]


def starts_late(segment, T, params):
    rows = list(line(segment, T, params))
    yield from rows[len(rows) // 2 :]


def bulges(segment, T, params):
    for k, (position, velocity, acceleration) in enumerate(line(segment, T, params)):
        yield position + [0.0, 0.2 * math.sin(0.01 * k)][: len(position)], velocity, acceleration


def wrong_way(segment, T, params):
    turned = ArcSegment(segment.start, segment.end, segment.centre, segment.feed_rate, not segment.clockwise)
    yield from arc(turned, T, params)


def no_full_circle(segment, T, params):
    if segment.start == segment.end:
        yield segment.start, (0.0, 0.0), (0.0, 0.0)
    else:
        yield from arc(segment, T, params)


def changes_params(segment, T, params):
    params["length"] = 3.0
    yield from line(segment, T, params)


def bug(segment, T, params):
    yield from line(segment, T, params)
    yield 1 / 0


def two_arguments(segment, T):
    yield from line(segment, T, {})


def slow(segment, T, params):
    for row in line(segment, T, params):
        end = time.perf_counter() + 1.5e-3
        while time.perf_counter() < end:
            pass
        yield row


BAD = [
    (remembers, clauses.NO_GLOBALS, "global `done`"),
    (remembers_segment, clauses.NO_GLOBALS, "default argument `current`"),
    (jitters, clauses.DETERMINISTIC, "`random`"),
    (never_ends, clauses.ENDS, "has no end"),
    (positions_only, clauses.ROWS, "yield position, velocity, acceleration"),
    (two_axes_always, clauses.AXES, "3 numbers each"),
    (one_axis, clauses.AXES, "2 numbers each"),
    (text, clauses.ROWS, "2 numbers each"),
    (not_a_number, clauses.FINITE, "nan"),
    (nothing, clauses.ROWS, "returned nothing"),
    (no_rows, clauses.ROWS, "no row at all"),
    (three_arrays, clauses.ROWS, "yield from zip"),
    (stops_short, clauses.END, "mm away"),
    (starts_late, clauses.START, "the first row"),
    (bulges, clauses.PATH, "beside the path"),
    (wrong_way, clauses.SWEEP, "-270°, not by 90°"),
    (no_full_circle, clauses.SWEEP, "full circle"),
    (changes_params, clauses.UNCHANGED, "params"),
    (bug, clauses.RUNS, "ZeroDivisionError"),
    (two_arguments, clauses.ARGUMENTS, "params missing"),
    (slow, clauses.TIME, "compute less"),
]


@pytest.mark.parametrize(("bad", "clause", "detail"), BAD, ids=[b[0].__name__ for b in BAD])
def test_the_broken_clause_is_named(bad, clause, detail):
    budget = {remembers_segment: 10.0, slow: 0.4}.get(bad, 1.0)  # s; the first makes each row anew, the last spins
    report = check_interpolator(bad, budget=budget)
    assert clause in [fault.clause for fault in report.faults], str(report)
    assert detail in str(report)


def wrong_velocity(segment, T, params):
    for position, velocity, acceleration in line(segment, T, params):
        yield position, 0.5 * velocity, acceleration


def twice_the_feed(segment, T, params):
    fast = LineSegment(segment.start, segment.end, 2 * segment.feed_rate)
    yield from line(fast, T, params)


@pytest.mark.parametrize(("odd", "clause"), [(wrong_velocity, clauses.VELOCITY), (twice_the_feed, clauses.FEED)])
def test_what_is_odd_but_allowed_is_a_warning(odd, clause):
    report = check_interpolator(odd)
    assert report.ok
    assert clause in [warning.clause for warning in report.warnings]
