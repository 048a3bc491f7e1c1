"""Build: the student's files of an experiment, checked in a process of their own, with each fault at its line."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

from rds.checks.report import Fault
from rds.core.errors import InputError

LARGEST = 1 << 20  # bytes of a file that is shown and checked
_LINE = re.compile(r"(?:, line |:)(\d+)")


@dataclass(frozen=True)
class Mark:
    """What was found: `line` of the file (None: of the whole file), and the sentence."""

    line: int | None
    text: str
    fault: bool = True  # else a warning


@dataclass(frozen=True)
class Checked:
    """One file: its role ("controller", "model", "interpolator", "signal"), its text, and what was found in it."""

    role: str
    path: Path
    text: str
    marks: tuple[Mark, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether it will do; warnings do not count."""
        return not any(mark.fault for mark in self.marks)

    @property
    def sentence(self) -> str:
        """The verdict in one line."""
        first = next((mark for mark in self.marks if mark.fault), None)
        if first is None:
            return f"{self.path.name}: the {self.role} keeps its interface"
        return f"{self.path.name}{f', line {first.line}' if first.line else ''}: {first.text}"


@dataclass
class Builds:
    """Files that were checked. One that has not changed since, nor what it imports beside it, is not checked again."""

    _kept: dict[tuple[str, Path, float, int], tuple[str, Checked]] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def check(
        self, role: str, path: Path, T: float, pulse: Callable[[], None] = lambda: None, axes: int = 0
    ) -> Checked:
        """Check the file at `path`, which stands for `role`, for a loop of `T` s. Takes seconds the first time.

        `axes` is how many a coupled controller drives together; 0 where each axis has its own.
        `pulse()` is called ten times a second meanwhile: what it raises ends the check.
        """
        data = _read(path)
        if isinstance(data, str):
            return Checked(role, path, "", (Mark(None, data),))
        digest, key = hashlib.sha256(b"\0".join(_with_imports(path, data, set()))).hexdigest(), (role, path, T, axes)
        with self._lock:
            before = self._kept.get(key)
        if before is not None and before[0] == digest:
            return before[1]
        checked = _checked(role, path, data.decode("utf-8", "replace"), T, pulse, axes)
        with self._lock:
            self._kept[key] = digest, checked
        return checked

    def latest(self) -> list[Checked]:
        """What was found in each file that was checked, as it was then."""
        with self._lock:
            return [checked for _, checked in self._kept.values()]

    def require(
        self,
        files: Iterable[tuple[str, Path]],
        T: float,
        pulse: Callable[[], None] = lambda: None,
        axes: int = 0,
    ) -> list[Checked]:
        """What was found, where all files will do; InputError naming the first that won't. Else as `check`."""
        found = []
        for role, path in files:
            found.append(self.check(role, path, T, pulse, axes))
            if not found[-1].ok:
                raise InputError(found[-1].sentence)
        return found


def _checked(role: str, path: Path, text: str, T: float, pulse: Callable[[], None], axes: int) -> Checked:
    try:
        if role == "signal":
            from rds.references.rows import read_rows

            read_rows(path)
            return Checked(role, path, text)
        if role == "model" and path.suffix == ".toml":
            from rds.identification.fit.model_file import read_model

            read_model(path)
            return Checked(role, path, text)
        return _python(role, path, text, T, pulse, axes if role == "controller" else 0)
    except InputError as error:
        # the message without its place, which the mark is
        said = str(error).removeprefix(f"{error.where}: ").removeprefix(f"{path}:").strip()
        return Checked(role, path, text, (_mark(said, path, text, error.where),))


def _python(role: str, path: Path, text: str, T: float, pulse: Callable[[], None], axes: int) -> Checked:
    from rds.checks import check_file

    report = check_file(path, T, coupled=bool(axes), axes=axes or 2, pulse=pulse)
    marks, notes = [], []
    for each in report.reports:
        if each.interface in (role, "file"):
            marks += [_mark(_words(fault), path, text) for fault in each.faults]
            marks += [_mark(_words(warning), path, text, fault=False) for warning in each.warnings]
            notes += [*each.notes, *([f"time per call: {each.timing}"] if each.timing else [])]
    marks += [_mark(_words(warning), path, text, fault=False) for warning in report.warnings]
    if role not in report.interfaces and not marks:
        what = " and ".join(report.interfaces)
        marks.append(Mark(None, f"it holds a {what} and no {role}; name the file of your {role}"))
    return Checked(role, path, text, tuple(marks), tuple(notes))


def _words(fault: Fault) -> str:
    """What is wrong first: a rule that stands before it reads as if it were kept."""
    return f"{fault.message} (rule: {fault.clause})"


def _mark(text: str, path: Path, source: str, where: str | None = None, fault: bool = True) -> Mark:
    """The line that a message names, of this file."""
    name = re.escape(path.name)
    found = re.search(f"{name}{_LINE.pattern}", where or "") or re.search(f"{name}{_LINE.pattern}", text)
    return Mark(int(found.group(1)) if found else _line_of(text, source), text, fault)


def _line_of(message: str, source: str) -> int | None:
    """The line of what a message speaks of without a line: a global, else a function."""
    for told, written in ((r"global `(\w+)`", r"\s*global\b.*\b{}\b"), (r"\b(\w+)\(\)", r"\s*def {}\b")):
        for name in re.findall(told, message):
            for number, line in enumerate(source.splitlines(), start=1):
                if re.match(written.format(name), line):
                    return number
    return None


def _with_imports(path: Path, data: bytes, seen: set[str]) -> Iterator[bytes]:
    """The file's own bytes, and those of the files beside it that it imports, in turn."""
    yield data
    try:
        found = list(ast.walk(ast.parse(data)))
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # no Python, or half typed
        return
    names = [alias.name for each in found if isinstance(each, ast.Import) for alias in each.names]
    names += [each.module for each in found if isinstance(each, ast.ImportFrom) and each.module and not each.level]
    for name in sorted({each.partition(".")[0] for each in names} - seen):
        seen.add(name)
        beside = path.with_name(f"{name}.py")
        if isinstance(imported := _read(beside), bytes):
            yield from (name.encode(), *_with_imports(beside, imported, seen))


def _read(path: Path) -> bytes | str:
    """The content, or the sentence why there is none."""
    if not path.is_file():
        return f"there is no such file in {path.parent}; save your file there, or name another"
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except OSError as error:
        return f"it cannot be read: {error.strerror}"
    return data if len(data) <= LARGEST else f"it is larger than {LARGEST >> 20} MB; that is no file to run"
