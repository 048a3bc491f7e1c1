"""Pairs of submissions that are alike, as a table for the class's page and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict

from rds.grading.batch.similarity import LEAST_SCORE, Identical, Lines, Pair
from rds.grading.feedback.plain_text import one_line
from rds.results.html import table

MOST = 100  # pairs on the page; the file has all
_NAME = 60  # characters
_NOTE = (
    "How much of the smaller program's structure both have, whatever the names, numbers, comments and layout. What "
    "the template or half of the class have too is left out. Short programs are often alike by themselves: this is "
    "where to look, and no finding. No points depend on it."
)


def pairs_html(pairs: Sequence[Pair], identical: Sequence[Identical] = ()) -> str:
    """Who handed in the same file, and a table of the most alike; a sentence where there are none."""
    return _same(identical) + _alike(pairs)


def _same(identical: Sequence[Identical]) -> str:
    if not identical:
        return ""
    rows = [
        [len(group.students), ", ".join(one_line(each, _NAME) for each in group.students), group.source or "–"]
        for group in identical
    ]
    return table(["students", "the same file, to the last byte", "which is also"], rows)


def _alike(pairs: Sequence[Pair]) -> str:
    if not pairs:
        return f'<p class="note">No two submissions share {100 * LEAST_SCORE:.0f} % of their structure or more.</p>'
    rows = [
        [
            one_line(pair.first, _NAME),
            one_line(pair.second, _NAME),
            f"{100 * pair.score:.0f} %",
            _ranges(pair.first_lines),
            _ranges(pair.second_lines),
            pair.source or "–",
        ]
        for pair in pairs[:MOST]
    ]
    note = _NOTE if len(pairs) <= MOST else f"{_NOTE} The first {MOST} of {len(pairs)} pairs; similarity.json has all."
    heads = ["student", "student", "in common", "lines of the first", "lines of the second", "both from"]
    return table(heads, rows, "", note)


def pairs_json(pairs: Sequence[Pair], identical: Sequence[Identical] = ()) -> bytes:
    """All pairs, with their ranges of lines, and who handed in the same file."""
    whole = {"identical": [asdict(group) for group in identical], "pairs": [asdict(pair) for pair in pairs]}
    return json.dumps(whole, indent=1).encode() + b"\n"


def _ranges(lines: Sequence[Lines]) -> str:
    return ", ".join(str(first) if first == last else f"{first}–{last}" for first, last in lines)
