"""Reconfiguration time: from a change of the modules until the system can be used again.

The data are events (time, what happened) or times that somebody has taken. Source: section 9.2, figure 82 and tables
M28 and M29 of the thesis on the open architecture control system (docs/thesis-reports.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import Column, columns_in, read_columns
from rds.results.reports.settings import Setting
from rds.results.reports.statistics import summary

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "changes": Setting("events that change the modules", default="removed,added", text=True),
    "ready": Setting("the event that says that the system can be used", default="ready", text=True),
}

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
_EXAMPLE = "'time_s,event,module', then '12.5,removed,Z' and '13.1,ready,'"

# s, five trials each: means of tables M28 and M29; changing the modules by hand, configuring and typing a program
THESIS = {
    "3 modules, familiar user": 199.4,
    "4 modules, familiar user": 240.6,
    "3 modules, new user": 366.0,
    "4 modules, new user": 439.8,
}


class Event(NamedTuple):
    """Something that happened."""

    time: float  # s
    what: str
    module: str


@dataclass(frozen=True)
class Change:
    """One reconfiguration."""

    events: Sequence[Event]  # changes of modules, in order
    ready: float  # s

    @property
    def whole(self) -> float:
        """From the first change until ready, s."""
        return self.ready - self.events[0].time

    @property
    def after_last(self) -> float:
        """From the last change until ready, s: what the software took."""
        return self.ready - self.events[-1].time


def changes_in(events: Sequence[Event], changing: Sequence[str], ready: str) -> tuple[list[Change], list[Event]]:
    """Reconfigurations, each from the first change to the next `ready`, and the changes that no `ready` followed."""
    found: list[Change] = []
    pending: list[Event] = []
    for event in sorted(events, key=lambda event: event.time):
        if event.what in changing:
            pending.append(event)
        elif event.what == ready and pending:
            found.append(Change(tuple(pending), event.time))
            pending = []
    return found, pending


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Times and their statistics, all files together. InputError for data or options that will not do."""
    times: dict[str, list[float]] = {}
    tables, findings = [], []
    for path in files:
        columns = read_columns(path)
        if any(column.name.lower() == "event" for column in columns):
            events = _events(path, columns)
            found, pending = _changes(path, events, settings)
            tables.append(_list(path, found))
            times.setdefault("first change until ready", []).extend(change.whole for change in found)
            times.setdefault("last change until ready", []).extend(change.after_last for change in found)
            if moving := _until_moving(events):
                times.setdefault("last module plugged in until moving", []).extend(moving)
            if pending:
                modules = ", ".join(event.module or "?" for event in pending)
                findings.append(f"{path.name}: not ready again at its end, after changes of {modules}.")
        else:
            for column in columns_in(path, columns, tuple(_SECONDS), "times taken", "familiar_3_modules_s"):
                below = next(((line, cell) for line, cell in column.cells.items() if cell.startswith("-")), None)
                values = [_SECONDS[column.unit] * value for value in column.numbers(blanks=True)]
                if below is not None:
                    raise column.fault(below[0], f"{below[1]!r} is negative; give the time taken")
                times.setdefault(column.name, []).extend(values)
    findings += [_finding(name, values) for name, values in times.items()]
    return Report(
        "reconfiguration",
        "Reconfiguration time",
        [path.name for path in files],
        settings,
        [_statistics(times), *tables],
        {"Reconfiguration times": lambda: picture(times)},
        findings,
    )


def _until_moving(events: Sequence[Event]) -> list[float]:
    """From the last `added` until the next `moving`, s."""
    found, plugged = [], None
    for event in events:
        if event.what == "added":
            plugged = event.time
        elif event.what == "moving" and plugged is not None:
            found.append(event.time - plugged)
            plugged = None
    return found


def _events(path: Path, columns: Sequence[Column]) -> list[Event]:
    """The events of a file in the order of their times."""
    named = {column.name.lower(): column for column in columns}
    if "time" not in named:
        raise InputError(f"it has events and no column 'time'; write them as in {_EXAMPLE}", str(path))
    time = named["time"]
    if time.unit not in _SECONDS:
        raise InputError(f"column {time.heading!r} is in {time.unit or 'no unit'}; head it time_s", str(path))
    modules = named["module"].cells if "module" in named else {}
    events = [
        Event(_SECONDS[time.unit] * value, what, modules.get(line, ""))
        for value, (line, what) in zip(time.numbers(), named["event"].cells.items(), strict=True)
    ]
    return sorted(events, key=lambda event: event.time)


def _changes(path: Path, events: Sequence[Event], settings: Mapping[str, Any]) -> tuple[list[Change], list[Event]]:
    changing = [word.strip() for word in settings["changes"].split(",") if word.strip()]
    found, pending = changes_in(events, changing, settings["ready"].strip())
    if not found:
        kinds = ", ".join(dict.fromkeys(event.what for event in events))
        raise InputError(
            f"no {' or '.join(changing) or 'change'} is followed by {settings['ready']!r}; its events are {kinds}: "
            "give the options changes and ready",
            str(path),
        )
    return found, pending


def _list(path: Path, found: Sequence[Change]) -> Table:
    columns = ["start [s]", "changes", "first change until ready [s]", "last change until ready [s]"]
    rows = [
        [
            change.events[0].time,
            ", ".join(f"{event.module} {event.what}".strip() for event in change.events),
            *(change.whole, change.after_last),
        ]
        for change in found
    ]
    return Table(f"Reconfigurations in {path.name}", columns, rows, digits={n: 3 for n in columns if "[s]" in n})


def _statistics(times: Mapping[str, Sequence[float]]) -> Table:
    columns = ["time", "n", "mean [s]", "std [s]", "min [s]", "max [s]"]
    rows: list[list[Any]] = []
    for name, values in times.items():
        s = summary(values)
        rows.append([name, s.n, s.mean, s.std, s.low, s.high])
    note = "For comparison, means of five trials by hand in the thesis: " + "; ".join(
        f"{name} {seconds:.1f} s" for name, seconds in THESIS.items()
    )
    return Table("Reconfiguration time", columns, rows, note + ".", {name: 3 for name in columns if "[s]" in name})


def _finding(name: str, values: Sequence[float]) -> str:
    s = summary(values)
    return f"{name}: {s.mean:.3g} s on average, {s.low:.3g} to {s.high:.3g} s, {s.n} time{'s' if s.n > 1 else ''}."


def picture(times: Mapping[str, Sequence[float]]) -> Picture:
    """Mean of each kind of time as a bar, each time as a point."""
    from rds.core.figure import BLACK, BLUE, Picture, dress

    drawn = Picture(0.6 * len(times) + 1.2)
    axes = drawn.subplots()
    for at, values in enumerate(times.values()):
        axes.barh(at, summary(values).mean, height=0.6, color=BLUE, alpha=0.55)
        axes.plot(values, [at] * len(values), "|", color=BLACK, markersize=14)
    dress(axes, "", "time [s]")
    axes.grid(False, axis="y")
    axes.set_yticks(range(len(times)), [name.replace("_", " ") for name in times])
    axes.invert_yaxis()
    axes.set_xlim(left=0)
    return drawn
