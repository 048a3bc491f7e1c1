"""What a file of logged data holds, and what its reader must know before believing an estimate from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.identification.logs.guess import draft, guess
from rds.identification.logs.log import Clock, Finding, Gravity, Log
from rds.identification.logs.map import LogMap
from rds.identification.logs.read_log import choose_map, is_own, logs_of, own_logs, table_of
from rds.identification.logs.steps import step_of
from rds.identification.logs.table import Column

GRAVITIES = (Gravity.FAULT, Gravity.WARNING, Gravity.NOTE)  # the worst first
_NAMED = 3  # logs that are named where a finding is of some of them


@dataclass(frozen=True)
class ColumnFacts:
    """One column: unit ("" where none is given), range and smallest step in it, and how many cells have no number."""

    name: str
    unit: str
    values: int
    missing: int
    low: float | None
    high: float | None
    step: float | None
    words: bool = False


@dataclass(frozen=True)
class Description:
    """A file described. `draft` is a map to correct, where none was given and none could be guessed."""

    path: Path
    format: str
    sha256: str
    columns: tuple[ColumnFacts, ...]
    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]  # of the file and of all its logs, the gravest first, each once
    map: str  # where the meaning of the columns is from: a file's name, "guessed", "own result", "" for nowhere
    draft: str = ""

    @property
    def usable(self) -> bool:
        """Whether there is a log, and nothing is at fault with it."""
        return bool(self.logs) and not any(f.gravity is Gravity.FAULT for f in self.findings)

    def to_json(self) -> dict[str, Any]:
        """The description in JSON's types; docs/data.md says what each key is."""
        return {
            "file": str(self.path),
            "format": self.format,
            "sha256": self.sha256,
            "usable": self.usable,
            "map": self.map,
            "columns": [vars(column) for column in self.columns],
            "logs": [_log_json(log) for log in self.logs],
            "findings": [_finding_json(finding) for finding in self.findings],
            "draft": self.draft,
        }


def describe(
    path: str | Path,
    mapping: LogMap | str | Path | None = None,
    progress: Progress | None = None,
    find_map: bool = True,
) -> Description:
    """Describe a file, with or without a map; `find_map` looks for one beside it.

    InputError for a file or map that cannot be read. Data that make no log (a doubtful meaning, a time that goes back,
    blanks) are a finding: the columns are described all the same.
    """
    path = Path(path)
    chosen = choose_map(path, mapping) if find_map or mapping is not None else None
    if chosen is None and is_own(path):
        logs = own_logs(path)
        return Description(
            path, "result", logs[0].sha256, _log_columns(logs), tuple(logs), _gathered(logs, ()), "own result"
        )
    table = table_of(path, chosen, progress)
    columns = tuple(_facts(column) for column in table.columns.values())
    source, text = ("the map given" if chosen.path is None else str(chosen.path)) if chosen else "", ""
    own: list[Finding] = []
    if chosen is None:
        found = guess(table)
        chosen = found.map
        if chosen is None:
            text = draft(table) if found.is_log else ""
            own.append(Finding("map", found.problem, Gravity.FAULT))
        else:
            source = "guessed"
    logs = []
    if chosen is not None:
        try:
            logs = logs_of(table, chosen)
        except InputError as error:
            own.append(Finding("log", str(error).removeprefix(f"{path}: "), Gravity.FAULT))
    findings = _gathered(logs, (*own, *(() if logs else table.findings)))
    return Description(path, table.format, table.sha256, columns, tuple(logs), findings, source, text)


def _gathered(logs: Iterable[Log], own: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings of all, each once, the gravest first; those of some logs among several name them."""
    logs = list(logs)
    seen: dict[tuple[str, str], Finding] = {(f.kind, f.what): f for f in own}
    names: dict[tuple[str, str], list[str]] = {}
    for log in logs:
        for finding in log.findings:
            known = names.setdefault((finding.kind, finding.what), [])
            known += [] if log.name in known else [log.name]
    for log in logs:
        for finding in log.findings:
            of = names[finding.kind, finding.what]
            what = finding.what
            if len(of) < len(logs):
                rest = f" and {len(of) - _NAMED} more" if len(of) > _NAMED else ""
                what = f"{', '.join(of[:_NAMED])}{rest}: {what}"
            seen.setdefault((finding.kind, what), replace(finding, what=what))
    return tuple(sorted(seen.values(), key=lambda finding: GRAVITIES.index(finding.gravity)))


def _facts(column: Column) -> ColumnFacts:
    if column.text is not None:
        return ColumnFacts(column.name, column.unit or "", len(column.values), 0, None, None, None, words=True)
    return _numbers(column.name, column.unit or "", column.values)


def _numbers(name: str, unit: str, values: np.ndarray) -> ColumnFacts:
    good = np.isfinite(values)
    missing = int(len(values) - good.sum())
    kept = values if not missing else values[good]
    if not len(kept):
        return ColumnFacts(name, unit, len(values), missing, None, None, None)
    return ColumnFacts(name, unit, len(values), missing, float(kept.min()), float(kept.max()), step_of(kept))


def _log_columns(logs: Iterable[Log]) -> tuple[ColumnFacts, ...]:
    found: list[ColumnFacts] = []
    for log in logs:
        if not found:
            found.append(_numbers("time", "s", log.time))
        axis = f"{log.name.rpartition(':')[2]} " if ":" in log.name else ""
        for name, values in quantities(log).items():
            found.append(_numbers(f"{axis}{name}", log.units.get(name, ""), values))
    return tuple(found)


def quantities(log: Log) -> Mapping[str, np.ndarray]:
    """The logged quantities of a log by name, without the time."""
    return {"command": log.command, "position": log.position, **log.extra}


def _log_json(log: Log) -> dict[str, Any]:
    steps = np.diff(log.time)
    return {
        "name": log.name,
        "samples": len(log),
        "duration": float(log.time[-1] - log.time[0]),
        "sample_period": log.sample_period,
        "jitter": float(np.std(steps)),
        "worst_step": float(np.abs(steps - np.median(steps)).max()),
        "quantities": {
            name: {"unit": log.units.get(name, ""), "low": float(values.min()), "high": float(values.max())}
            for name, values in quantities(log).items()
        },
        "resolution": log.resolution,
        "voltage_range": list(log.voltage_range) if log.voltage_range else None,
        "closed_loop": log.closed_loop,
        "force_gain": log.force_gain,
        "clocks": [_clock_json(clock) for clock in log.clocks],
        "findings": [_finding_json(finding) for finding in log.findings],
    }


def _clock_json(clock: Clock) -> dict[str, Any]:
    about = {k: v if not isinstance(v, float) or np.isfinite(v) else None for k, v in vars(clock).items()}
    return about | {"quantities": list(clock.quantities)}


def _finding_json(finding: Finding) -> dict[str, Any]:
    return {"kind": finding.kind, "what": finding.what, "gravity": str(finding.gravity), "sample": finding.sample}
