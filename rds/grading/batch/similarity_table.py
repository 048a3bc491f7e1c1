"""Pairs of submissions that are alike, as a table for the class's page and as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rds.grading.batch.similarity import LEAST_SCORE, Identical, Lines, Pair, SameLoop, Uncompared
from rds.grading.feedback.plain_text import one_line
from rds.results.html import table

MOST = 100  # pairs on the page; the file has all
_OPEN = 10  # pairs that are shown at once; more are folded, so that what stands below is not pushed away
_NAME = 60  # characters
_NOTE = (
    "How much of the smaller program's structure both have, whatever the names, numbers, comments and layout. What "
    "the template or half of the class have too is left out. Short programs are often alike by themselves: this is "
    "where to look, and no finding. No points depend on it."
)
_UNCOMPARED = (
    "These programs, or these lines of them, are not compared; read them. What a program runs by exec, eval or compile "
    "stands in a text, which may come from somebody else's program."
)
_LOOPS = (
    "In all cases that are the same for everybody these runs are equal to the last bit, whatever the programs look "
    "like. Who takes the same simple law with the same gains has them too: it is where to look, and no finding."
)


def found_html(found: Mapping[str, Any]) -> str:
    """What `alike_json` holds: who handed in the same file, whose loops are the same, the most alike programs; and
    whose are not compared."""
    if not found:
        return ""
    same = _same(found.get("identical", ())) + _loops(found.get("loops", ())) + _alike(found.get("pairs", ()))
    return same + _uncompared(found.get("uncompared", ()))


def _same(identical: Sequence[Mapping[str, Any]]) -> str:
    if not identical:
        return ""
    rows = [[len(group["students"]), _names(group["students"]), group["source"] or "–"] for group in identical]
    return table(["students", "the same file, to the last byte", "which is also"], rows)


def _loops(loops: Sequence[Mapping[str, Any]]) -> str:
    if not loops:
        return ""
    rows = [[len(group["students"]), _names(group["students"]), _names(group["others"]) or "–"] for group in loops]
    return table(["students", "the same closed loop, to the last bit", "as have"], rows, "", _LOOPS)


def _uncompared(uncompared: Sequence[Mapping[str, Any]]) -> str:
    if not uncompared:
        return ""
    rows = [
        [one_line(each["student"], _NAME), _ranges(each["lines"]) or "all", one_line(each["why"]) or "runs text"]
        for each in uncompared
    ]
    return table(["student", "lines that are not compared", "why"], rows, "", _UNCOMPARED)


def _names(names: Sequence[str]) -> str:
    return ", ".join(one_line(each, _NAME) for each in names)


def _alike(pairs: Sequence[Mapping[str, Any]]) -> str:
    if not pairs:
        return f'<p class="note">No two submissions share {100 * LEAST_SCORE:.0f} % of their structure or more.</p>'
    rows = [
        [
            one_line(pair["first"], _NAME),
            one_line(pair["second"], _NAME),
            f"{100 * pair['score']:.0f} %",
            _ranges(pair["first_lines"]),
            _ranges(pair["second_lines"]),
            pair["source"] or "–",
        ]
        for pair in pairs[:MOST]
    ]
    note = _NOTE if len(pairs) <= MOST else f"{_NOTE} The first {MOST} of {len(pairs)} pairs; similarity.json has all."
    heads = [
        "student",
        "student, or file of others",
        "in common",
        "lines of the first",
        "lines of the second",
        "both from",
    ]
    many = f"{len(pairs)} pairs of programs" if len(pairs) > 1 else "one pair of programs"
    summary = f"{many} with {100 * LEAST_SCORE:.0f} % of their structure or more in common"
    is_open = " open" if len(pairs) <= _OPEN else ""
    return f"<details{is_open}><summary>{summary}</summary>{table(heads, rows, '', note)}</details>"


def alike_json(
    pairs: Sequence[Pair],
    identical: Sequence[Identical] = (),
    loops: Sequence[SameLoop] = (),
    uncompared: Sequence[Uncompared] = (),
) -> bytes:
    """All pairs, with their ranges of lines, who handed in the same file, whose loops are the same, and who is not
    compared."""
    parts: dict[str, Sequence[Any]] = {"identical": identical, "loops": loops, "pairs": pairs, "uncompared": uncompared}
    whole = {name: [asdict(each) for each in found] for name, found in parts.items()}
    return json.dumps(whole, indent=1).encode() + b"\n"


def _ranges(lines: Sequence[Lines]) -> str:
    return ", ".join(str(first) if first == last else f"{first}–{last}" for first, last in lines)
