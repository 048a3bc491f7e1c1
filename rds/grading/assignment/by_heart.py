"""Submissions made from the reference solution: what it answers in the visible cases by heart; honest interpolators."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from rds.grading.assignment.trial_grades import TrialGrades
from rds.grading.cases.case import CaseRun
from rds.grading.grade import Grade
from rds.grading.intake.notebooks import converted

_NUMBERS = """
import array
import base64
import zlib


def _numbers(text):
    return array.array("d", zlib.decompress(base64.b64decode(text))).tolist()


"""
_VOLTAGES = """
_KNOWN = {known}
_KNOWN = {{key: _numbers(text) for key, text in _KNOWN.items()}}
initial_state = [None, 0]


def control(t, r, y, state, params):
    case, k = state
    if case is None:
        case = f"{{r.position:.6f}} {{r.velocity:.6f}}"
    known = _KNOWN.get(case, [])
    return (known[k] if k < len(known) else 0.0), [case, k + 1]
"""
_ROWS = """
_KNOWN = {known}


def interpolate(segment, T, params):
    still = [0.0] * len(segment.start)
    known = _KNOWN.get(f"{{list(segment.start)}} {{list(segment.end)}} {{segment.feed_rate}}")
    if known is None:
        yield segment.end, still, still
        return
    values, n = _numbers(known), len(segment.start)
    for k in range(0, len(values), 3 * n):
        yield values[k : k + n], values[k + n : k + 2 * n], values[k + 2 * n : k + 3 * n]
"""
_JUMP = """
def interpolate(segment, T, params):
    still = [0.0] * len(segment.start)
    yield segment.end, still, still
"""
_NO_CIRCLE = """

_exact = interpolate


def interpolate(segment, T, params):
    rows = _exact(segment, T, params)
    if list(segment.start) != list(segment.end):
        yield from rows
        return
    first, still = next(iter(rows)), [0.0] * len(segment.start)
    yield first
    yield segment.end, still, still
"""
_BUILT: Mapping[str, str] = {
    "with its rows in a list": "    return list(_exact(segment, T, params))\n",
    "with its rows as arrays": (
        "    import numpy as np\n    for row in _exact(segment, T, params):\n"
        "        yield tuple(np.array(part) for part in row)\n"
    ),
    "with positions rounded to 1e-10 mm": (
        "    for position, *rest in _exact(segment, T, params):\n"
        "        yield ([round(p, 10) for p in position], *rest)\n"
    ),
}


def table_of_voltages(runs: Iterable[CaseRun]) -> str:
    """A controller that plays back the voltages (V) of these runs, and looks at nothing."""
    known = {}
    for run in runs:
        for axis in run.result.axes:
            first = (run.result[f"{axis}_reference"][0], run.result[f"{axis}_reference_velocity"][0])
            known["{:.6f} {:.6f}".format(*first)] = _packed(run.result[f"{axis}_command"])
    return _NUMBERS + _VOLTAGES.format(known=known)


def of_interpolators(tried: TrialGrades, solution: Path, reference: Grade) -> list[str]:
    """Faults: honest interpolators that earn nothing, tables and jumps that earn too much."""
    text = solution.read_text(encoding="utf-8")
    faults: list[str] = []
    for name, body in _BUILT.items():
        built = f"{text}\n\n_exact = interpolate\n\n\ndef interpolate(segment, T, params):\n{body}"
        faults += tried.zeroed(f"the reference solution {name}", built, reference)
    faults += tried.zeroed("the reference solution in a notebook", in_a_notebook(text, tried.names()), reference)
    known = {}
    for run in tried.visible_runs(solution):
        segment = run.fact("segment")
        if run.rows is not None:
            known[f"{list(segment.start)} {list(segment.end)} {segment.feed_rate}"] = _packed(run.rows)
    faults += tried.bought("a table of the rows of the visible segments", _NUMBERS + _ROWS.format(known=known))
    faults += tried.bought("a jump to the end of the segment", _JUMP)
    circles = {name for name, segment in tried.segments() if list(segment.start) == list(segment.end)}
    return faults + tried.timed("one row of a full circle, and back", text + _NO_CIRCLE, circles)


def in_a_notebook(text: str, names: Sequence[str]) -> str:
    """A file's text handed in as a notebook: each paragraph is a cell, with an experiment behind them.

    `names` are those that are kept of it.
    """
    paragraphs = [*text.split("\n\n\n"), "import rds\nresult = rds.Experiment().run()"]
    cells = [{"cell_type": "code", "metadata": {}, "outputs": [], "source": each} for each in paragraphs]
    whole = {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    return converted(json.dumps(whole).encode(), names).code.decode()


def _packed(values: np.ndarray) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values, float).tobytes(), 9)).decode()
