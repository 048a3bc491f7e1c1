"""Response times of modules from a bus log: from a request to the answer to it.

Source: section 9.8 and table 20 of the thesis on the open architecture control system (docs/thesis-reports.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.results.reports.bus_log import read_frames
from rds.results.reports.content import Report, Table
from rds.results.reports.dialects import DIALECTS, pairs_from
from rds.results.reports.pairing import EVERY, Exchanges, exchanges
from rds.results.reports.settings import Setting
from rds.results.reports.statistics import summary

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "dialect": Setting(f"whose requests and answers: {', '.join(DIALECTS)}", default="oacs", text=True),
    "pairs": Setting("own pairs instead, as in 'move start: M#0301 -> 000#04MM00; ...'", text=True),
    "timeout": Setting("an answer later than this is none", "ms", 1000.0, more_than=0),
}

_COLUMNS = ("n", "mean [ms]", "std [ms]", "min [ms]", "max [ms]", "p99 [ms]", "unanswered")


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Response times per message and module, all logs together. InputError for a log without any."""
    pairs = pairs_from(settings["dialect"], settings["pairs"])
    found = Exchanges()
    for path in files:
        frames = read_frames(path)
        _add(found, exchanges(frames, pairs, settings["timeout"] / 1e3))
        if not found.requests:
            wanted = settings["pairs"] or DIALECTS[settings["dialect"]]
            raise InputError(
                f"none of its {len(frames)} frames is a request ({wanted}); give the dialect or pairs of the modules",
                str(path),
            )
    if not found.times:
        asked = sum(found.requests.values())
        raise InputError(
            f"{asked} request{'s' if asked > 1 else ''} and no answer within {settings['timeout']:g} ms; "
            "check the answers of the pairs, and the timeout",
            ", ".join(map(str, files)),
        )
    return Report(
        "response",
        "Response times",
        [path.name for path in files],
        settings,
        [_overview(found), _statistics(found)],
        {"Response times": lambda: picture(found)},
        _findings(found),
    )


def _add(total: Exchanges, more: Exchanges) -> None:
    for key, times in more.times.items():
        total.times.setdefault(key, []).extend(times)
    for key, count in more.requests.items():
        total.requests[key] = total.requests.get(key, 0) + count
    total.strays += more.strays


def name_of(module: int) -> str:
    """What a module is called in a table: its number in hexadecimal."""
    return "all" if module == EVERY else f"{module:#04x}"


def _overview(found: Exchanges) -> Table:
    """Mean response times: a row per message, a column per module, as in table 20."""
    messages = list(dict.fromkeys(pair for pair, _ in found.sides()))
    modules = sorted({module for _, module in found.sides()})
    rows = [[m, *(_mean(found.times.get((m, module))) for module in modules)] for m in messages]
    columns = ["message", *(f"{name_of(module)} [ms]" for module in modules)]
    return Table("Mean response time", columns, rows, digits=dict.fromkeys(columns[1:], 3))


def _mean(times: list[float] | None) -> float | None:
    return 1e3 * summary(times).mean if times else None


def _statistics(found: Exchanges) -> Table:
    rows: list[list[Any]] = []
    for pair, module in found.sides():
        times = found.times.get((pair, module))
        s = summary([1e3 * time for time in times]) if times else None
        numbers = [s.n, s.mean, s.std, s.low, s.high, s.p99] if s else [0, *[None] * 5]
        rows.append([pair, name_of(module), *numbers, found.unanswered(pair, module)])
    note = "Unanswered are requests without an answer in time, those at the very end of a log included."
    if found.strays:
        note += f" {found.strays} answer{'s' if found.strays > 1 else ''} came without a request that waited for them."
    columns = ["message", "module", *_COLUMNS]
    return Table("Statistics", columns, rows, note, {name: 3 for name in columns if "ms" in name})


def _findings(found: Exchanges) -> list[str]:
    said = []
    for pair in dict.fromkeys(pair for pair, _ in found.sides()):
        means = {m: mean for p, m in found.sides() if p == pair and (mean := _mean(found.times.get((p, m))))}
        if len(means) > 1:
            fast, slow = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
            said.append(
                f"{pair}: module {name_of(fast)} answers first, after {means[fast]:.3f} ms on average, "
                f"module {name_of(slow)} last, after {means[slow]:.3f} ms."
            )
    for pair, module in found.sides():
        missing = found.unanswered(pair, module)
        if missing:
            requests = "1 request" if missing == 1 else f"{missing} requests"
            said.append(f"{pair}: module {name_of(module)} left {requests} without an answer in time.")
    return said


def picture(found: Exchanges) -> Picture:
    """Histograms of the response times: a panel per module, a colour and line style per message."""
    import numpy as np

    from rds.core.figure import CYCLE, Picture, dress, legend

    modules = sorted({module for _, module in found.times})
    messages = list(dict.fromkeys(pair for pair, _ in found.sides()))
    longest = 1e3 * max(max(times) for times in found.times.values())
    edges = np.linspace(0.0, longest * 1.02 or 1.0, 61)
    drawn = Picture(2.2 * len(modules) + 0.4)
    grid = drawn.subplots(len(modules), 1, squeeze=False, sharex=True)[:, 0]
    for axes, module in zip(grid, modules, strict=True):
        for at, message in enumerate(messages):
            times = found.times.get((message, module))
            if times:
                line = ("-", (0, (5, 2)), (0, (1, 1.5)))[at % 3]
                colour = CYCLE[at % len(CYCLE)]
                counts, _ = np.histogram(1e3 * np.asarray(times), edges)
                axes.stairs(
                    counts, edges, color=colour, linestyle=line, linewidth=1.5, label=f"{message} ({len(times)})"
                )
        dress(axes, f"{name_of(module)} [answers]", "response time [ms]" if axes is grid[-1] else None)
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set_ylim(bottom=0)
        legend(axes)
    drawn.align_ylabels()
    return drawn
