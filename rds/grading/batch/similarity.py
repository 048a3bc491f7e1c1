"""Submissions of like structure, pointed out for the instructor to look at. A hint, and never a deduction.

A program is read as the sequence of its syntax tree's nodes, without names, numbers, texts, comments, docstrings and
layout. Of all runs of `GRAM` nodes, those of the smallest hash in each window of `WINDOW` are its fingerprints
(winnowing: Schleimer, Wilkerson and Aiken, 2003): a common passage of GRAM + WINDOW - 1 nodes or more is always found.
Fingerprints of the hand-out's template, and those that more than half of a large class share, count for nothing.
"""

from __future__ import annotations

import ast
import hashlib
from array import array
from bisect import bisect_left
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

GRAM = 12  # nodes
WINDOW = 6  # of grams
LEAST_SCORE = 0.5  # of a pair that is worth a look
LEAST_COMMON = 6  # fingerprints; less is chance
_CLASS = 12  # submissions from which on what many share is taken for common knowledge
_MANY = 0.5

Lines = tuple[int, int]  # first and last
Fingerprints = Mapping[int, Lines]


class Packed(Mapping[int, Lines]):
    """Fingerprints in a tenth of the memory that a dict of them takes: a whole class's are compared at once."""

    def __init__(self, prints: Fingerprints):
        self._values = array("Q", sorted(prints))
        self._lines = array("I", (number for value in self._values for number in prints[value]))

    def __getitem__(self, value: int) -> Lines:
        place = bisect_left(self._values, value)
        if place == len(self._values) or self._values[place] != value:
            raise KeyError(value)
        return self._lines[2 * place], self._lines[2 * place + 1]

    def __iter__(self) -> Iterator[int]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)


@dataclass(frozen=True)
class Pair:
    """Two students, the share of the smaller program's fingerprints that both have, and where: lines of either."""

    first: str
    second: str
    score: float
    common: int
    first_lines: tuple[Lines, ...]
    second_lines: tuple[Lines, ...]
    source: str = ""  # what the instructor has that both took it from, as far as that is known


@dataclass(frozen=True)
class Identical:
    """Students whose files are the same to the last byte, their SHA-256, and the instructor's file that it also is."""

    students: tuple[str, ...]
    sha256: str
    source: str = ""


@dataclass(frozen=True)
class SameLoop:
    """Students, and files of others, whose runs are the same to the last bit in all cases that everybody has alike."""

    students: tuple[str, ...]
    others: tuple[str, ...] = ()


def same_loops(found: Mapping[str, Mapping[str, str]], others: Mapping[str, Mapping[str, str]]) -> list[SameLoop]:
    """Groups of those who behave the same: by name and case a hash of the run. Nobody without a run is in one."""
    groups: dict[tuple[tuple[str, str], ...], tuple[list[str], list[str]]] = {}
    for place, names in enumerate((found, others)):
        for name, cases in names.items():
            if cases:
                groups.setdefault(tuple(sorted(cases.items())), ([], []))[place].append(name)
    made = [SameLoop(tuple(sorted(own)), tuple(sorted(rest))) for own, rest in groups.values()]
    alike = [each for each in made if each.students and len(each.students) + len(each.others) > 1]
    return sorted(alike, key=lambda group: (-len(group.students), group.students))


def identical_files(given: Mapping[str, str], own: Mapping[str, str]) -> list[Identical]:
    """Groups of students with the same file, the largest first, however many of a class they are: by SHA-256 of each.

    `own` are those of the instructor's files by name; a single student who handed in one of these is a group, too.
    """
    groups: dict[str, list[str]] = {}
    for student, sha256 in given.items():
        groups.setdefault(sha256, []).append(student)
    names = {sha256: name for name, sha256 in own.items()}
    found = [
        Identical(tuple(sorted(students)), sha256, names.get(sha256, ""))
        for sha256, students in groups.items()
        if len(students) > 1 or sha256 in names
    ]
    return sorted(found, key=lambda group: (-len(group.students), group.students))


def fingerprints(code: bytes) -> Fingerprints:
    """The fingerprints of a Python file with the lines each comes from; none if Python cannot read it.

    Parses what somebody wrote: call it in a process that may crash.
    """
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return {}
    words: list[tuple[str, int]] = []
    _walk(tree, words)
    grams = [
        (_hash(" ".join(word for word, _ in words[n : n + GRAM])), _span(line for _, line in words[n : n + GRAM]))
        for n in range(len(words) - GRAM + 1)
    ]
    chosen: dict[int, Lines] = {}
    for n in range(max(len(grams) - WINDOW + 1, min(len(grams), 1))):
        # the rightmost of the smallest, as in the paper: neighbouring windows then choose the same
        value, lines = min(reversed(grams[n : n + WINDOW]), key=lambda gram: gram[0])
        chosen.setdefault(value, lines)
    return chosen


def similar_pairs(
    found: Mapping[str, Fingerprints],
    template: Iterable[Fingerprints] = (),
    sources: Mapping[str, Fingerprints] | None = None,
    others: Mapping[str, Fingerprints] | None = None,
) -> list[Pair]:
    """The pairs of students whose programs are alike, the most alike first. `found` is by student.

    `sources` are what the instructor has of it, such as a solution: the one that holds most of what a pair has in
    common, and half of it at least, is named. `others` are programs of no student of this class, by names that no
    student has: each is compared with the students', and not with other ones.
    """
    foreign = others or {}
    known = {value for prints in template for value in prints}
    if len(found) >= _CLASS:
        known |= _in_several(found.values(), max(int(_MANY * len(found)) + 1, 3))
    everybody = {**foreign, **found}
    sizes = {name: sum(value not in known for value in prints) for name, prints in everybody.items()}
    shared_values = _in_several(everybody.values(), 2) - known  # what one alone has is no more than its number
    holders: dict[int, list[str]] = {}
    for student in sorted(everybody):
        for value in everybody[student]:
            if value in shared_values:
                holders.setdefault(value, []).append(student)
    groups: dict[tuple[str, ...], list[int]] = {}  # what the same students have: many have all of a file in common
    for value, students in holders.items():
        groups.setdefault(tuple(students), []).append(value)
    parts = list(groups.values())
    together = [sorted(names, key=lambda name: (name not in found, name)) for names in groups]  # students come first
    groups_of: dict[str, list[int]] = {}
    for number, names in enumerate(together):
        for name in names:
            groups_of.setdefault(name, []).append(number)

    @cache
    def lines(student: str, numbers: tuple[int, ...]) -> tuple[Lines, ...]:
        return _joined(everybody[student][value] for number in numbers for value in parts[number])

    pairs = []
    for first in found:  # one after the other: all pairs of a class together need not have room in memory
        shared: dict[str, list[int]] = {}  # numbers of groups
        for number in groups_of.get(first, ()):
            names = together[number]
            for second in names[names.index(first) + 1 :]:
                shared.setdefault(second, []).append(number)
        for second, numbers in shared.items():
            common = sum(len(parts[number]) for number in numbers)
            score = common / min(sizes[first], sizes[second])
            if common >= LEAST_COMMON and score >= LEAST_SCORE:
                which = tuple(numbers)
                both = [value for number in numbers for value in parts[number]]
                named = [(sum(value in prints for value in both), name) for name, prints in (sources or {}).items()]
                most, source = max(named, default=(0, ""))
                source = source if most >= LEAST_SCORE * common else ""
                pairs.append(Pair(first, second, score, common, lines(first, which), lines(second, which), source))
    return sorted(pairs, key=lambda pair: (-pair.score, pair.first, pair.second))


def _in_several(programs: Collection[Fingerprints], least: int) -> set[int]:
    """The fingerprints that at least so many programs have."""
    held = [np.fromiter(prints, np.uint64, len(prints)) for prints in programs]
    values, counts = np.unique(np.concatenate([np.zeros(0, np.uint64), *held]), return_counts=True)
    return set(values[counts >= least].tolist())


def _joined(spans: Iterable[Lines]) -> tuple[Lines, ...]:
    """Ranges of lines, joined where they touch."""
    whole: list[Lines] = []
    for first, last in sorted(spans):
        if whole and first <= whole[-1][1] + 1:
            whole[-1] = (whole[-1][0], max(whole[-1][1], last))
        else:
            whole.append((first, last))
    return tuple(whole)


def _walk(tree: ast.AST, words: list[tuple[str, int]]) -> None:
    """The nodes of the tree from outside in, by their kinds alone, each with its line. Without recursion."""
    todo: list[tuple[ast.AST, int]] = [(tree, 1)]
    while todo:
        node, line = todo.pop()
        line = getattr(node, "lineno", line)
        if isinstance(node, ast.expr_context | ast.alias | ast.arguments | ast.Module):
            pass  # says nothing that the nodes around it do not say
        elif isinstance(node, ast.Constant):
            words.append((type(node.value).__name__ if isinstance(node.value, str | bytes) else "number", line))
        else:
            words.append((type(node).__name__, line))
        todo.extend((child, line) for child in reversed(_children(node)))


def _children(node: ast.AST) -> list[ast.AST]:
    """Its parts; a function's, class's or file's without the docstring, annotations and other texts that do nothing."""
    skipped = {"annotation", "returns", "type_comment"}
    found: list[ast.AST] = []
    for name, value in ast.iter_fields(node):
        if name in skipped:
            continue
        parts = value if isinstance(value, list) else [value]
        found += [part for part in parts if isinstance(part, ast.AST) and not _does_nothing(part)]
    return found


def _does_nothing(node: ast.AST) -> bool:
    return isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))


def _span(lines: Iterable[int]) -> Lines:
    seen = list(lines)
    return min(seen), max(seen)


def _hash(text: str) -> int:
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")
