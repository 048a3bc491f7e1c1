"""Where a program is, as an operator wants to see it: positions and distances to the limits, modes, feed, spindle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from html import escape

from rds.core.types import Ending
from rds.machines import Machine
from rds.modes.loop.execution import State
from rds.nc.active import Modes, modes_at
from rds.nc.run.run import LOCKS, Status
from rds.results import Result

STATES = (
    "runs",
    "held",
    "stops (M0, M1 or single step): Resume goes on",
    "waits for the tool: change it, then Resume",
    "dwells",
    "waits for the spindle",
    "goes home",
    "is over",
)
_NEAR = 0.05  # of the travel: nearer to a limit than this is said


def status_html(status: Status | None, modes: Mapping[int, Modes], machine: Machine, override: float) -> str:
    """The display; dashes where nothing is known. `override` in per cent."""
    now = None if status is None else modes_at(modes, status.line)
    return _head(status, override, now) + _positions(status, now, machine) + _modes(now)


def at_the_end(status: Status, result: Result) -> Status:
    """Where a run came to its end, by its last row; `status` is any of before."""
    measured = {name: float(result[f"{name}_measured"][-1]) for name in status.measured}
    reference = {name: float(result[f"{name}_reference"][-1]) for name in status.reference}
    line, time = int(result["program_line"][-1]), float(result["time"][-1])
    share = 1.0 if result.meta.get("ending") == Ending.DONE else status.share
    ended = replace(status, time=time, line=line, state=State.OVER, feed=0.0, share=share, to_go={})
    return replace(ended, measured=measured, reference=reference)


def _head(status: Status | None, override: float, modes: Modes | None) -> str:
    if status is None:
        return '<p class="rds-state" role="status">Nothing runs. Positions show here as soon as a run has begun.</p>'
    lock = LOCKS.get(status.whose_feed)
    locked = f" <b>({lock})</b>" if lock else ""
    return (
        f'<p class="rds-state" role="status"><b>Line {status.line}</b> {STATES[status.state]} · '
        f"{status.time:.1f} s · {status.share:.0%} of the program</p>"
        f'<p class="rds-state">Feed <b>{status.feed:.0f}</b> mm/min{_wanted(modes)}, override {override:.0f} %'
        f"{locked}</p>"
    )


def _wanted(modes: Modes | None) -> str:
    """The feed as programmed, where it is one by the minute in mm."""
    if modes is None or not {"G94", "G21"} <= {*modes.words} or not modes.feed:
        return ""
    return f" of {modes.feed:g}"


def _positions(status: Status | None, modes: Modes | None, machine: Machine) -> str:
    work = {}
    if status is not None and modes is not None:
        # the tip on the work, whose place has the tool's length in it already
        shown = replace(modes, tool_offset=(0.0, 0.0, 0.0)) if status.tip else modes
        work = shown.work(status.measured | status.tip)
    rows = []
    for name, axis in machine.axes.items():
        at = None if status is None else status.measured.get(name)
        low, high = axis.travel
        if axis.unit == "rev/min":
            wanted = None if status is None else status.reference.get(name)
            rows.append(
                f'<tr><th scope="row">{escape(name.capitalize())}</th><td class="rds-dro">{_number(at, 0)}</td>'
                f'<td colspan="3">rev/min, {_number(wanted, 0)} wanted</td></tr>'
            )
            continue
        digits = 3 if axis.unit == "mm" else 2
        to_go = None if status is None else status.to_go.get(name)
        large = f'<td class="rds-dro">{_number(work.get(name, at), digits)}</td>'
        cells = [_number(to_go, digits), _number(at, digits), _bar(at, low, high, axis.unit)]
        rest = "".join(f"<td>{cell}</td>" for cell in cells)
        rows.append(f'<tr><th scope="row">{escape(name)} <small>{escape(axis.unit)}</small></th>{large}{rest}</tr>')
    heads = ("Axis", "Work", "To go", "Machine", "Within the travel; to the nearest limit")
    head = f"<tr>{''.join(f'<th scope=col>{each}</th>' for each in heads)}</tr>"
    return f'<table class="rds-positions">{head}{"".join(rows)}</table>'


def _bar(at: float | None, low: float, high: float, unit: str) -> str:
    if at is None:
        return f"{low:g} to {high:g} {escape(unit)}"
    share = min(max((at - low) / (high - low), 0.0), 1.0)
    left = min(at - low, high - at)
    near = left < _NEAR * (high - low)
    sign = "⚠ " if near else ""
    tip = f"from {low:g} to {high:g} {escape(unit)}"
    return (
        f'<span class="rds-travel" title="{tip}"><i style="left:{100 * share:.1f}%"></i></span> '
        f"{sign}{left:.1f} to {'low' if at - low < high - at else 'high'}"
    )


def _modes(modes: Modes | None) -> str:
    if modes is None:
        return "<p>Active modes: –</p>"
    words = " ".join(f"<code>{escape(word)}</code>" for word in modes.words)
    tool = f"T{modes.tool}" if modes.tool else "no tool"
    return (
        f"<p>Active modes: {words} <code>F{modes.feed:g}</code> <code>S{modes.speed:g}</code> <code>{tool}</code></p>"
    )


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
