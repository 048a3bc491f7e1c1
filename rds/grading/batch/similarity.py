"""Submissions of like structure, pointed out for the instructor to look at. A hint, and never a deduction.

A program is read as the sequence of its syntax tree's nodes, without names, numbers, texts, comments, docstrings and
layout. Of all runs of `GRAM` nodes, those of the smallest hash in each window of `WINDOW` are its fingerprints
(winnowing: Schleimer, Wilkerson and Aiken, 2003): a common passage of GRAM + WINDOW - 1 nodes or more is always found.
Fingerprints of the hand-out's template, and those that more than half of a large class share, count for nothing.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rds.core.errors import InputError

if TYPE_CHECKING:
    from sqlite3 import Connection

GRAM = 12  # nodes
WINDOW = 6  # of grams
LEAST_SCORE = 0.5  # of a pair that is worth a look
LEAST_COMMON = 6  # fingerprints; less is chance
_CLASS = 12  # submissions from which on what many share is taken for common knowledge
_MANY = 0.5
_CACHE = 256  # kB
_RUN_TEXT = frozenset({"exec", "eval", "compile"})
_KEPT = 1000  # ranges of lines: where many are alike, most have the same in common

Lines = tuple[int, int]  # first and last
Fingerprints = Mapping[int, Lines]
Program = tuple[str, Fingerprints]  # with whose it is
IntArray = NDArray[np.int_]


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
class Uncompared:
    """A student whose program is not compared, or not all of it: the lines that run text, or why it was not read."""

    student: str
    lines: tuple[Lines, ...] = ()
    why: str = ""


@dataclass(frozen=True)
class SameLoop:
    """Students, and files of others, whose runs are the same to the last bit in all cases that everybody has alike."""

    students: tuple[str, ...]
    others: tuple[str, ...] = ()


def same_loops(found: Mapping[str, bytes], others: Mapping[str, bytes]) -> list[SameLoop]:
    """Groups of those who behave the same: by name a hash of all runs. Nobody without a run is in one."""
    groups: dict[bytes, tuple[list[str], list[str]]] = {}
    for place, names in enumerate((found, others)):
        for name, runs in names.items():
            if runs:
                groups.setdefault(runs, ([], []))[place].append(name)
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
    """The fingerprints of a Python file with the lines each comes from; see `fingerprints_and_text`."""
    return fingerprints_and_text(code)[0]


def fingerprints_and_text(code: bytes) -> tuple[Fingerprints, tuple[Lines, ...]]:
    """The fingerprints of a Python file, and the lines that run text (`exec`): what that is has no structure here.

    Each with the lines that it comes from; none if Python cannot read the file. Parses what somebody wrote: call it in
    a process that may crash.
    """
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(2 * limit)  # what could be read where it was graded can be here, deeper in the stack
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return {}, ()
    finally:
        sys.setrecursionlimit(limit)
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
    return chosen, _lines_that_run_text(tree)


def _lines_that_run_text(tree: ast.AST) -> tuple[Lines, ...]:
    names = (node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in _RUN_TEXT)
    return _joined((node.lineno, node.lineno) for node in names)


def similar_pairs(
    found: Iterable[Program],
    template: Iterable[Fingerprints] = (),
    sources: Mapping[str, Fingerprints] | None = None,
    others: Iterable[Program] = (),
) -> list[Pair]:
    """The pairs of students whose programs are alike, the most alike first. `found` is by student.

    `sources` are what the instructor has of it, such as a solution: the one that holds most of what a pair has in
    common, and half of it at least, is named. `others` are programs of no student of this class, by names that no
    student has: each is compared with the students', and not with other ones. `found` is read before `others`, each
    once, into a file without a name: the fingerprints of a whole class need not have room in memory. InputError where
    the disk has none.
    """
    import sqlite3  # for more than one submission: the time of a single one is that of its imports

    known = {value for prints in template for value in prints}
    try:
        with closing(sqlite3.connect("")) as table:
            return _Programs(table, found, others, known).pairs(sources or {})
    except sqlite3.Error as error:
        said = f"programs cannot be compared: {error}; make room in the temporary folder, and go on with --resume"
        raise InputError(said) from error


class _Programs:
    """In a table of SQLite's: `prints` has the fingerprints of all, `shared` who has which in common."""

    def __init__(self, table: Connection, found: Iterable[Program], others: Iterable[Program], known: Set[int]):
        self._table = table
        table.execute(f"PRAGMA cache_size = -{_CACHE}")
        table.execute("CREATE TABLE prints (owner, value, first, last, PRIMARY KEY (owner, value)) WITHOUT ROWID")
        self._names: list[str] = []
        self._put(found)
        self._students = len(self._names)
        self._put(others)
        self._sizes = np.zeros(len(self._names), int)  # how many there are of each that count
        self._share(known)

    def pairs(self, sources: Mapping[str, Fingerprints]) -> list[Pair]:
        """The most alike first; of those that are as much alike, those with no common source, then the longest."""
        lines = lru_cache(_KEPT)(self._lines)
        found = []
        for first in range(self._students):
            for second, common, score in self._alike(first):
                values = common.tolist()
                named = [(sum(value in prints for value in values), name) for name, prints in sources.items()]
                most, source = max(named, default=(0, ""))
                ends = sorted((first, second), key=lambda owner: (owner >= self._students, self._names[owner]))
                one, two = (lines(owner, common.tobytes()) for owner in ends)
                source = source if most >= LEAST_SCORE * len(values) else ""
                found.append(Pair(self._names[ends[0]], self._names[ends[1]], score, len(values), one, two, source))
        return sorted(found, key=lambda pair: (-pair.score, pair.source != "", -pair.common, pair.first, pair.second))

    def _put(self, programs: Iterable[Program]) -> None:
        for name, prints in programs:
            rows = ((len(self._names), value, *lines) for value, lines in prints.items())
            self._table.executemany("INSERT INTO prints VALUES (?, ?, ?, ?)", rows)
            self._names.append(name)

    def _share(self, known: Set[int]) -> None:
        """What two or more have, but not most of a large class, nor what is `known`."""
        least = max(int(_MANY * self._students) + 1, 3) if self._students >= _CLASS else self._students + 1
        self._table.execute("CREATE TABLE shared (value INTEGER PRIMARY KEY, owners)")
        rows = self._table.execute("SELECT value, owner FROM prints ORDER BY value, owner")
        for value, group in groupby(rows, itemgetter(0)):
            owners = np.fromiter((owner for _, owner in group), np.uint32)
            if value not in known and np.count_nonzero(owners < self._students) < least:
                self._sizes[owners] += 1
                if len(owners) > 1:
                    self._table.execute("INSERT INTO shared VALUES (?, ?)", (value, owners.tobytes()))

    def _alike(self, first: int) -> Iterator[tuple[int, IntArray, float]]:
        """Those after the `first` whose programs are like it, with the fingerprints that both have, and the score."""
        which = "SELECT value, owners FROM prints JOIN shared USING (value) WHERE owner = ? ORDER BY value"
        rows = self._table.execute(which, (first,)).fetchall()
        if not rows:
            return
        each = [np.frombuffer(owners, np.uint32) for _, owners in rows]
        holders = np.concatenate(each)
        counts = np.bincount(holders, minlength=len(self._names))
        scores = counts / np.maximum(np.minimum(self._sizes, self._sizes[first]), 1)
        seconds = np.flatnonzero((counts >= LEAST_COMMON) & (scores >= LEAST_SCORE))
        seconds = seconds[seconds > first]
        if not len(seconds):
            return
        values = np.repeat(np.array([value for value, _ in rows]), [len(owners) for owners in each])
        values, ends = values[np.argsort(holders, kind="stable")], np.cumsum(counts)
        for second in seconds.tolist():
            yield second, values[ends[second] - counts[second] : ends[second]], float(scores[second])

    def _lines(self, owner: int, common: bytes) -> tuple[Lines, ...]:
        values = set(np.frombuffer(common, int).tolist())
        rows = self._table.execute("SELECT value, first, last FROM prints WHERE owner = ?", (owner,))
        return _joined((first, last) for value, first, last in rows if value in values)


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
    whole = int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")
    return whole >> 1  # the largest integers of SQLite have 63 bits
