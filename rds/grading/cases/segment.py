"""An interpolator's case: one line or arc, and the rows that the submission makes of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import length
from rds.core.toml_table import TomlTable
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.grading.cases.case import COUNTS, CaseRun, Submitted
from rds.grading.cases.words import CommonFields, as_own_file, inside, read_common
from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError
from rds.interpolators.segment import checked
from rds.machines import load_machine
from rds.results import Result

_LARGEST = 1e100  # mm, mm/s, mm/s²: beyond it sums of squares are no numbers
_SLOWER, _SPARE = 10, 5000  # rows: so much longer than at constant speed, for a slow start and stop


@dataclass(frozen=True)
class SegmentCase:
    """A segment with its sample period, s. The first sample is the segment's start, at rest, before any row."""

    common: CommonFields
    segment: Segment
    T: float
    params: dict[str, Any]
    axes: tuple[str, ...]
    files: tuple[str, ...] = ()

    name = property(lambda self: self.common.name)
    title = property(lambda self: self.common.title)
    is_visible = property(lambda self: self.common.is_visible)
    runs = 1
    unit = "mm"
    can_be_linearized = False
    is_drawn = False

    def run(self, submitted: Submitted, seed: int, number: int, needs: Iterable[str] = ()) -> CaseRun:
        """The rows of the segment."""
        subject = submitted.subject()
        most = _SLOWER * int(length(self.segment) / self.segment.feed_rate / self.T) + _SPARE
        n = len(self.axes)
        rows = np.array(list(subject.rows(self.segment, self.T, self.params, most)), float).reshape(-1, 3, n)
        if not len(rows):
            raise SubmissionError(Status.BROKE_CONTRACT, "interpolate() yielded no row")
        if np.abs(rows).max() > _LARGEST:
            raise SubmissionError(Status.BROKE_CONTRACT, f"a row of interpolate() holds more than {_LARGEST:g}")
        counts = subject.counts if COUNTS in needs else None
        start = np.zeros((1, 3, n))
        start[0, 0] = self.segment.start
        whole = np.concatenate([start, rows])
        columns = {"time": np.arange(len(whole)) * self.T}
        units = {"time": "s"}
        for k, axis in enumerate(self.axes):
            for part, word, unit in ((0, "", "mm"), (1, "_velocity", "mm/s"), (2, "_acceleration", "mm/s²")):
                columns[f"{axis}_reference{word}"] = whole[:, part, k]
                units[f"{axis}_reference{word}"] = unit
        result = Result(columns, units, {"axes": list(self.axes), "sample_period": self.T, "mode": "interpolation"})
        return CaseRun(self.name, number, result, counts=counts, facts={"segment": self.segment}, rows=rows)


def read(words: TomlTable, folder: Path, machine: str) -> SegmentCase:
    """A table `[[case]]` of an interpolator's assignment, with `[case.segment]`."""
    words = as_own_file(words, {"machine": machine})
    common = read_common(words)
    own = inside(words, "machine", folder) if str(words.any("machine")).endswith(".toml") else None
    rig = load_machine(str(folder / own) if own else words.read("machine"))
    T = words.read("sample_period", rig.sample_period)
    given, table = words.inner("params"), words.inner("segment")
    if table is None:
        raise InputError('[case.segment] is missing; as in `kind = "line"`, start, end, feed_rate', words.place())
    if common.runs != 1:
        raise words.fault("runs", "will not do for a segment: there is nothing to draw; remove it")
    segment = _segment(table, T)
    words.done()
    axes = ("X", "Y", "Z", "A", "B", "C")[: len(segment.start)]
    return SegmentCase(common, segment, T, dict(given.table) if given else {}, axes, (own,) if own else ())


def _segment(words: TomlTable, T: float) -> Segment:
    kind = words.read("kind")
    start, end = _point(words, "start"), _point(words, "end")
    feed = words.read("feed_rate")
    if len(start) != len(end):
        raise words.fault("end", f"must have as many values as start, {len(start)}")
    segment: Segment
    if kind == "line":
        segment = LineSegment(start, end, feed)
    else:
        plane = words.any("plane", [0, 1])
        if not isinstance(plane, list) or len(plane) != 2 or not all(type(axis) is int for axis in plane):
            raise words.fault("plane", "must be two axes by index, as in [0, 1]")
        centre = _point(words, "centre")
        segment = ArcSegment(start, end, centre, feed, words.read("clockwise"), (plane[0], plane[1]))
    words.done()
    try:
        return checked(segment, T)
    except InputError as error:
        raise InputError(str(error), words.place()) from error


def _point(words: TomlTable, key: str) -> tuple[float, ...]:
    given = words.any(key)
    known = isinstance(given, list) and 0 < len(given) <= 6
    if not known or not all(isinstance(v, int | float) and not isinstance(v, bool) and -inf < v < inf for v in given):
        raise words.fault(key, "must be a list of one position for each axis, mm")
    return tuple(float(value) for value in given)
