"""What a conformance check found: sentences that a student can act on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Fault:
    """One broken clause of an interface, and what to do about it."""

    clause: str
    message: str

    def __str__(self) -> str:
        return f"{self.clause}: {self.message}"


@dataclass(frozen=True)
class Timing:
    """Time per call (of an interpolator: per row) in µs.

    Each call is measured twice where it can be, and the shorter one counts: what another program did to the
    machine meanwhile is not the student's.
    """

    calls: int
    p50: float
    p99: float
    max: float

    def __str__(self) -> str:
        return f"{self.p50:.1f} µs (99 %: {self.p99:.1f} µs, longest {self.max:.1f} µs, {self.calls} calls)"


@dataclass(frozen=True)
class CheckReport:
    """The verdict on one interface ("controller", "model", "interpolator") of the subject called `name`."""

    interface: str
    name: str
    faults: tuple[Fault, ...] = ()
    warnings: tuple[Fault, ...] = ()
    timing: Timing | None = None
    notes: tuple[str, ...] = ()  # what it does and does not do, neither good nor bad

    @property
    def ok(self) -> bool:
        """Whether every clause is kept; warnings do not count."""
        return not self.faults

    def to_json(self) -> dict[str, Any]:
        """As plain dicts, lists, strings and numbers."""
        timing = self.timing and {
            "calls": self.timing.calls,
            "p50": self.timing.p50,
            "p99": self.timing.p99,
            "max": self.timing.max,
        }
        return {
            "interface": self.interface,
            "name": self.name,
            "ok": self.ok,
            "faults": [{"clause": f.clause, "message": f.message} for f in self.faults],
            "warnings": [{"clause": f.clause, "message": f.message} for f in self.warnings],
            "notes": list(self.notes),
            "timing": timing,
        }

    def __str__(self) -> str:
        verdict = "keeps its interface" if self.ok else "does not keep its interface"
        lines = [f"{self.name}: the {self.interface} {verdict}"]
        lines += [f"  fault: {fault}" for fault in self.faults]
        lines += [f"  warning: {warning}" for warning in self.warnings]
        lines += [f"  {note}" for note in self.notes]
        if self.timing:
            lines.append(f"  time: {self.timing}")
        return "\n".join(lines)

    __repr__ = __str__  # what a notebook shows


@dataclass(frozen=True)
class FileReport:
    """The verdict on a student's file (or function, or notebook): one report for each interface that it fills.

    A file that was not even loaded when its process ended has one report on the interface "file".
    """

    path: str
    reports: tuple[CheckReport, ...]
    warnings: tuple[Fault, ...] = ()

    @property
    def interfaces(self) -> tuple[str, ...]:
        """The interfaces that the file fills."""
        return tuple(report.interface for report in self.reports)

    @property
    def ok(self) -> bool:
        """Whether all of them are kept."""
        return all(report.ok for report in self.reports)

    def to_json(self) -> dict[str, Any]:
        """As plain dicts, lists, strings and numbers."""
        return {
            "path": self.path,
            "interfaces": list(self.interfaces),
            "ok": self.ok,
            "reports": [report.to_json() for report in self.reports],
            "warnings": [{"clause": f.clause, "message": f.message} for f in self.warnings],
        }

    def __str__(self) -> str:
        return "\n".join([*map(str, self.reports), *(f"warning: {warning}" for warning in self.warnings)])

    __repr__ = __str__  # what a notebook shows


class Findings:
    """Faults and warnings as a check comes upon them; the first of each clause stands for the rest."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []
        self.warnings: list[Fault] = []
        self.notes: list[str] = []

    def fault(self, clause: str, message: str) -> None:
        """Note a broken clause."""
        _add(self.faults, clause, message)

    def warn(self, clause: str, message: str) -> None:
        """Note something that keeps the letter of a clause and will hurt all the same."""
        _add(self.warnings, clause, message)

    def tried(self, samples: int, of: int, seconds: float) -> None:
        """Note that a run ended before its end, because it had taken its time."""
        self.notes.append(f"only the first {samples} of {of} samples were tried: they took {seconds:g} s")

    def report(self, interface: str, name: str, timing: Timing | None = None) -> CheckReport:
        """All of it."""
        return CheckReport(interface, name, tuple(self.faults), tuple(self.warnings), timing, tuple(self.notes))


def _add(found: list[Fault], clause: str, message: str) -> None:
    if all(fault.clause != clause for fault in found):
        found.append(Fault(clause, message))


def read_report(data: Any) -> CheckReport:
    """The report that `to_json` gave, from data that may be anything; ValueError if it is not one."""
    if not isinstance(data, dict):
        raise ValueError(f"a report is a table, not {data!r:.80}")
    timing = data.get("timing")
    if timing is not None:
        keys = ("calls", "p50", "p99", "max")
        if not isinstance(timing, dict) or not all(_is_number(timing.get(key)) for key in keys):
            raise ValueError(f"timing is {timing!r:.80}")
        timing = Timing(*(timing[key] for key in keys))
    notes = data.get("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise ValueError(f"notes is {notes!r:.80}")
    faults, warnings = read_faults(data, "faults"), read_faults(data, "warnings")
    return CheckReport(_text(data, "interface"), _text(data, "name"), faults, warnings, timing, tuple(notes))


def read_faults(data: dict[str, Any], key: str) -> tuple[Fault, ...]:
    entries = data.get(key)
    if not isinstance(entries, Sequence) or isinstance(entries, str) or not all(isinstance(e, dict) for e in entries):
        raise ValueError(f"{key} is {entries!r:.80}")
    return tuple(Fault(_text(entry, "clause"), _text(entry, "message")) for entry in entries)


def _text(data: dict[str, Any], key: str) -> str:
    value = data.get(key)
    if not isinstance(value, str):
        raise ValueError(f"{key} is {value!r:.80}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
