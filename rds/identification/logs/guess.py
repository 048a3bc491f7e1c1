"""What the columns of a file mean, where their names and units leave no doubt; else a draft of a map to correct."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rds.core.toml_text import toml_text
from rds.identification.logs.map import SUFFIX, LogMap, TimeMap
from rds.identification.logs.map_axis import DIMENSIONS, UNKNOWN, AxisMap, ColumnMap
from rds.identification.logs.name_words import (
    drives_nothing,
    is_at_the_motor,
    is_commanded,
    is_never_measured,
    is_no_place,
    role,
    words_of,
)
from rds.identification.logs.table import Column, Table, remedy
from rds.identification.logs.time_columns import RISING, are_alike, begins_anew, go_on_alike, is_coarse, is_even, rises
from rds.identification.logs.units import dimension, factor, known_units

_ACTING = (("voltage",), ("force", "torque"), ("current",))
_NO_LOG = "it is no log over time"
_IN_METRES = re.compile(r"(.+_)?(pos|position|distance|displacement)_m")  # or a measured position
_TOLD = 5  # columns that a sentence names
_ORDINALS = ("reading", "iteration", "move", "index", "n", "count", "sample")


@dataclass(frozen=True)
class Guess:
    """A map, or why there is none; and in any case one to correct."""

    map: LogMap | None
    problem: str  # a sentence; "" where there is a map
    is_log: bool = True  # whether the file can be a log over time at all


def guess(table: Table) -> Guess:
    """The map of a table, from names together with units. Nothing without a unit is ever guessed."""
    time, problem = _time(table)
    if problem:
        spoiled = _spoiled(table, "time")
        problem += _in_turn(table)
        return Guess(None, spoiled or problem, is_log=not spoiled and problem[: len(_NO_LOG)] != _NO_LOG)
    said = ["each signal has its own times"]
    if time:
        said = [f"time is {time!r} [{table.columns[time].unit}]"]
    groups = _groups(table, time)
    axes: dict[str, AxisMap] = {}
    doubts: list[str] = []
    for name, columns in groups.items():
        found, doubt = _axis(columns)
        if doubt:
            doubts.append(f"{name}: {doubt}" if len(groups) > 1 else doubt)
            continue
        axes[name] = AxisMap(name, {q: ColumnMap(c.name, place="the guessed map") for q, c in found.items()})
        said += [f"{_called(q, c)} of {name} is {c.name!r} [{c.unit}]" for q, c in found.items()]
    strange = [c for c in table.columns.values() if _is_strange(c)]
    said += [f"{c.name!r} is not used, as its unit {c.unit!r} is unknown" for c in strange]
    if doubts or not axes:
        for quantity in ("command", "position"):
            spoiled = _spoiled(table, quantity)
            if spoiled and not any(_fitting(columns, quantity) for columns in groups.values()):
                return Guess(None, spoiled, is_log=False)
        problem = "; ".join(doubts) or "no column tells a command and a position by its name and unit"
        return Guess(None, problem + _in_turn(table))
    return Guess(LogMap(TimeMap(time, place="the guessed map"), axes, said=tuple(said)), "")


def _called(quantity: str, column: Column) -> str:
    """What a guess calls a quantity: a position that is a speed, as a spindle's, is called one."""
    return "speed" if quantity == "position" and dimension(column.unit or "") == "angular speed" else quantity


def draft(table: Table) -> str:
    """A map of the file as TOML, with what is most likely, to be corrected by who knows."""
    time, _ = _time(table)
    content: dict[str, object] = {}
    notes = [f"What the columns of {table.path.name} mean. Check every line: it is a draft, not knowledge."]
    columns = [c for c in table.columns.values() if c.text is None]
    named = next((c.name for c in columns if role(c.name) == "time"), None)
    if named is None and not any(c.unit or role(c.name) for c in columns):
        named = next((c.name for c in columns if rises(c.values)), None)
    elif named is None and len(offered := _perhaps_times(columns)) == 1:
        named = offered[0]  # as dSPACE's X
    if not table.own_times:
        time = time or named
        if time is not None:
            content["time"] = {"column": time, "unit": _unit(table, time, "time")}
        else:
            content["time"] = {"rate": UNKNOWN}
            notes.append(
                f"No column tells the time: if the samples are equally spaced, give their rate in Hz for {UNKNOWN!r}."
            )
    axes: dict[str, object] = {}
    for name, columns in _groups(table, time).items():
        parts = {q: _likely(columns, q) for q in ("command", "position", "velocity", "current", "force", "reference")}
        if parts["command"] is None:  # as a guess takes it
            parts["command"], parts["current"] = parts["current"], None
        if parts["force"] is parts["command"]:
            del parts["force"]
        if not _is_of(parts["reference"], parts["position"] or parts["velocity"]):
            parts["reference"] = None
        chosen: dict[str, object] = {
            q: {"column": c.name, "unit": _unit(table, c.name, q)} for q, c in parts.items() if c is not None
        }
        for needed in ("command", "position"):
            if needed not in chosen:
                chosen[needed] = {"column": UNKNOWN, "unit": UNKNOWN}
        if any(c is not None and dimension(c.unit or "") == "counts" for c in parts.values()):
            chosen["resolution"] = UNKNOWN
            notes.append(f"resolution: give mm (or degrees) per encoder count for {UNKNOWN!r}, or name a machine.")
        if parts["velocity"] is not None and parts["position"] in (None, parts["velocity"]):
            del chosen["position"]  # the speed alone will do
        if {"command", "position", "velocity"} & {q for q, c in parts.items() if c is not None}:
            axes[name] = chosen
    if not axes:
        axes["X"] = {q: {"column": UNKNOWN, "unit": UNKNOWN} for q in ("command", "position")}
    missing = [c.name for c in table.columns.values() if c.unit is None and c.text is None]
    if missing:
        notes.append(f"The file gives no unit for {', '.join(missing[:8])}{' ...' if len(missing) > 8 else ''}.")
        notes.append(
            f"Where {UNKNOWN!r} stands, give the unit: a metre taken for a millimetre is a gain 1000 times wrong."
        )
    strange = [f"{c.unit!r} of {c.name!r}" for c in table.columns.values() if _is_strange(c)]
    if strange:
        notes.append(f"Unknown units, for which {UNKNOWN!r} stands here: {', '.join(strange[:8])}.")
    content["axis"] = axes
    return toml_text(content, "\n".join(notes))


def map_path(data: Path) -> Path:
    """Where the map of a data file is found by itself."""
    return data.with_name(data.name + SUFFIX)


def _unit(table: Table, name: str | None, quantity: str) -> str:
    unit = table.columns[name].unit if name is not None and name in table.columns else None
    return unit if unit is not None and dimension(unit) in DIMENSIONS[quantity] else UNKNOWN


def _time(table: Table) -> tuple[str | None, str]:
    """The column of time, or a sentence why there is none; neither where each column has times of its own."""
    if table.own_times:
        return None, ""
    columns = [c for c in table.columns.values() if c.text is None]
    in_time = [c for c in columns if dimension(c.unit or "") == "time"]
    rising = [c for c in in_time if rises(c.values)]
    named = [c for c in rising if role(c.name) == "time"]
    for found in (rising, named):
        if found and all(are_alike(c, found[0]) for c in found):
            return found[0].name, ""  # one alone, or the same in several columns
    for found in (rising, named):
        if found and all(go_on_alike(c, found[0]) for c in found):
            return found[0].name, ""  # a date beside the time since the start
    if rising:
        return None, f"{', '.join(c.name for c in rising)} could each be the time; say which in a map"
    named = [c for c in columns if role(c.name) == "time"]
    if named and not in_time:
        if named[0].unit is not None:
            return None, f"{named[0].name!r} may be the time, but {_unknown(named[0], 'time')}"
        return None, f"{named[0].name!r} may be the time, but nothing gives its unit; give it in a map"
    if columns and not any(c.unit or role(c.name) for c in columns):
        names = ", ".join(c.name for c in columns[:5]) + (" ..." if len(columns) > 5 else "")
        return None, f"nothing tells what {names} are, and in which units; say it in a map"
    return None, _no_series(columns, in_time)


def _spoiled(table: Table, quantity: str) -> str:
    """That the column which tells by its name and unit that it is the quantity has a word among its numbers, or ""."""
    for c in table.columns.values():
        if c.text is not None and role(c.name) == quantity and (c.unit is None or dimension(c.unit) is not None):
            row, cell = c.text
            where = f"holds {cell!r:.60} in data row {row + 1}"
            return f"{quantity} is {c.name!r}, as it seems, and {where}; {remedy(cell)}"
    return ""


def _why_no_time(column: Column) -> str:
    """What a column that is called a time does in its place, and what to do."""
    rows, steps = len(column.values), np.diff(column.values[np.isfinite(column.values)])
    if len(steps) and np.mean(steps < 0.0) >= RISING:
        return f"{column.name!r} goes down from row to row; sort the rows by it, the oldest first"
    if is_coarse(column):
        sentence = (
            f"{column.name!r} stays the same in {int(np.sum(steps == 0.0))} of {rows} rows: its stamps are coarser "
            "than the sample period; export it with more digits, or, if the rows are equally spaced in time, say so in "
            "a map: "
        )
        if dimension(column.unit or "") != "time":
            return sentence + "rate = ... (in Hz) under [time] in place of the column"
        there = column.values[np.isfinite(column.values)]
        new = np.flatnonzero(np.diff(there)) + 1  # a stamp is right where it is new
        if len(new) < 2:
            return sentence + "rate = ... (in Hz) under [time] in its place"
        rate = (new[-1] - new[0]) / ((there[new[-1]] - there[new[0]]) * factor(str(column.unit), "s"))
        return sentence + f"rate = {rate:.4g} (Hz, as its stamps go on the whole) under [time] in its place"
    return f"{column.name!r} does not increase from row to row ({rows} rows)"


def _in_turn(table: Table) -> str:
    """What to do about a table whose rows hold one signal after another, each named in its row; "" of another table."""
    name = next((c.name for c in table.columns.values() if c.text is not None and c.text[1][:1].isalpha()), None)
    bare = all(re.fullmatch(r"column \d+", called) for called in table.columns)  # no headings: dates are in s
    numbers = [c for c in table.columns.values() if c.text is None]
    times = [
        c for c in numbers if (role(c.name) == "time" and (is_coarse(c) or begins_anew(c))) or (bare and c.unit == "s")
    ]
    others = [c for c in numbers if c not in times and dimension(c.unit or "") != "time"]
    values = [c for c in others if np.isfinite(c.values).any()]
    values.sort(key=lambda c: "value" not in words_of(c.name.lower()))
    if name is None or not times or not values:
        return ""
    said = f"; but where {name!r} says in each row which signal it holds, give each signal a column of its own"
    if bare:
        return said
    listed = list(table.columns)  # by number, as names are here without their units
    which = [f"c[{listed.index(each)}]" for each in (times[0].name, name, values[0].name)]
    turned = "d.pivot(index={}, columns={}, values={})".format(*which)
    return f"{said}, in Python by `d = pandas.read_csv(FILE, comment='#'); c = d.columns; {turned}.to_csv('log.csv')`"


def _no_series(columns: Sequence[Column], in_time: Sequence[Column]) -> str:
    """Why a table is no log over time, and what it is instead."""
    units = {dimension(c.unit or "") for c in columns} | {"adc" for c in columns if c.name.endswith("_adc")}
    numbered = next((c.name for c in columns if c.name.lower() in _ORDINALS), None)
    sentence = f"{_NO_LOG}: "
    called = next((c for c in in_time if role(c.name) == "time"), None)
    if called is None and len(in_time) == 1 and is_coarse(in_time[0]):
        called = in_time[0]  # as an oscilloscope rounds it
    if called is not None:
        return sentence + _why_no_time(called)
    if in_time:
        names = ", ".join(c.name for c in in_time[:3]) + (" ..." if len(in_time) > 3 else "")
        sentence += f"its columns in s ({names}) are durations, and none increases from row to row"
    elif numbered:
        sentence += f"no column is a time, and {numbered!r} only numbers the rows"
    else:
        sentence += "no column is a time"
    kinds = {"time": "moves", "counts": "accuracy", "current": "current", "adc": "vibration"}
    kind = next((report for of, report in kinds.items() if of in units), None)
    if kind is not None and (numbered or in_time):
        sentence += f"; such readings are for `rds report {kind}`"
    rising = _perhaps_times(columns)
    if kind is None and rising:
        named = ", ".join(map(repr, rising[:3])) + (" ..." if len(rising) > 3 else "")
        sentence += f"; where the time is {named}, say so in a map, with its unit: column and unit under [time]"
    return sentence + "; if its rows are equally spaced in time, say so in a map: rate = ... (in Hz) under [time]"


def _perhaps_times(columns: Sequence[Column]) -> list[str]:
    """The columns that nothing calls a time, and that go up as one does."""
    rising = [c for c in columns if c.unit is None and rises(c.values) and c.name.lower() not in _ORDINALS]
    return [c.name for c in rising if role(c.name) is None or is_even(c.values)]


def _groups(table: Table, time: str | None) -> dict[str, list[Column]]:
    """Columns by axis: `X_measured`, `X voltage` are those of X; without such beginnings there is one axis."""
    columns = [c for c in table.columns.values() if c.name != time and c.text is None]
    groups: dict[str, list[Column]] = {}
    for column in columns:
        match = re.fullmatch(r"([A-Za-z][A-Za-z0-9]*?)[_. ](.+)", column.name)
        if match and role(match[2]) and (len(match[1]) <= 2 or match[1] == "spindle"):
            groups.setdefault(match[1], []).append(column)
    whole = {n: cs for n, cs in groups.items() if all(_likely(cs, q) is not None for q in ("command", "position"))}
    return whole if whole else {"axis": columns}


def _axis(columns: Sequence[Column]) -> tuple[dict[str, Column], str]:
    """Quantities of one axis, or a sentence on what is in doubt."""
    measured = [c for c in columns if not is_never_measured(c.name)]
    found: dict[str, Column] = {}
    for quantity in ("command", "position"):
        fits = _fitting(measured, quantity)
        if not fits and quantity == "position" and len(speeds := _fitting(measured, "velocity")) == 1:
            found["velocity"] = speeds[0]  # of an axis that is known by its speed alone
            continue
        if not fits:
            bare = [c.name for c in measured if c.unit is None]
            doubt = f"no column tells by its unit that it is the {quantity}"
            roles = (quantity, None, "velocity" if quantity == "position" else None)  # a speed will do
            strange = [c for c in measured if _is_strange(c) and role(c.name) in roles]
            doubt += "".join(f"; {c.name!r}: {_unknown(c, quantity)}" for c in strange[:_TOLD])
            doubt += _passed_over(measured, quantity)
            if quantity == "command" and (parts := [c for c in measured if dimension(c.unit or "") == "ratio"]):
                told = " or ".join(f"{c.name} [{c.unit}]" for c in parts[:_TOLD])
                doubt += f"; where {told} is the command, say so in a map"
            return {}, doubt + (f" (no unit: {', '.join(bare[:_TOLD])})" if bare else "")
        if quantity == "position":
            fits = [*fits, *(c for c in measured if c.unit is None and _IN_METRES.fullmatch(c.name.lower()))]
        if quantity == "position" and len(fits) > 1:  # theta beside a position may be a pendulum's
            fits = [c for c in fits if "theta" not in words_of(c.name)] or fits
        if len(fits) > 1:
            names = ", ".join(c.name + (f" [{c.unit}]" if c.unit else "") for c in fits)
            are_speeds = all(dimension(c.unit or "") == "angular speed" for c in fits)
            return {}, f"{names} could each be the {'speed' if are_speeds else quantity}"
        found[quantity] = fits[0]
    if "position" in found and dimension(found["position"].unit or "") == "counts":
        return {}, f"{found['position'].name!r} is in encoder counts; give the resolution (mm per count) or the machine"
    for quantity in ("velocity", "current", "reference"):
        fits = [c for c in _fitting(measured, quantity) if c not in found.values()]
        if quantity == "reference":
            fits = [c for c in fits if _is_of(c, found.get("position") or found.get("velocity"))]
        if quantity == "velocity" and "position" in found:
            fits = [c for c in fits if _is_rate_of(c, found["position"])]
        if len(fits) == 1:
            found[quantity] = fits[0]
    return found, ""


def _passed_over(columns: Sequence[Column], quantity: str) -> str:
    """What to do where a column has a unit of the quantity, and a word in its name tells that it is another."""
    is_other = drives_nothing if quantity == "command" else is_no_place
    others = [c.name for c in columns if dimension(c.unit or "") in DIMENSIONS[quantity] and is_other(c.name)]
    named = " or ".join(map(repr, others[:_TOLD]))
    return f"; by its name {named} is another quantity; if it is the {quantity}, say so in a map" if named else ""


def _is_of(reference: Column | None, answer: Column | None) -> bool:
    """Whether a reference can be that of what was measured: a speed is not where a position is to go."""
    if reference is None or answer is None or reference.unit is None or answer.unit is None:
        return True
    return dimension(reference.unit) == dimension(answer.unit)


def _is_rate_of(speed: Column, place: Column) -> bool:
    """Whether a speed can be that of a position: a spindle's beside an axis in mm is not."""
    return (dimension(place.unit or ""), dimension(speed.unit or "")) not in (
        ("length", "angular speed"),
        ("angle", "speed"),
    )


def _is_strange(column: Column) -> bool:
    """Whether the file gives a unit that is none of those known."""
    return bool(column.unit) and dimension(str(column.unit)) is None


def _unknown(column: Column, quantity: str) -> str:
    return (
        f"its unit {column.unit!r} is unknown ({known_units(str(column.unit), DIMENSIONS[quantity])}); give the right "
        "one in a map, with scale = ... where a number of the column is not one of it"
    )


def _fitting(columns: Sequence[Column], quantity: str) -> list[Column]:
    """The columns whose unit admits the quantity, and of those the ones that have its name, if any do."""
    dimensions = DIMENSIONS[quantity]
    fits = [c for c in columns if dimension(c.unit or "") in dimensions]
    if quantity == "command":  # a voltage where there is one, else the torque or force of a drive, else its current
        fits = [c for c in fits if not drives_nothing(c.name)]
        asked = [c for c in fits if is_commanded(c.name) and any(dimension(c.unit or "") in d for d in _ACTING)]
        fits = next((of for d in _ACTING if (of := [c for c in fits if dimension(c.unit or "") in d])), [])
        if asked and not any(c in asked or is_at_the_motor(c.name) for c in fits):
            fits = [*asked, *fits]  # a voltage beside a commanded torque may be that of the supply
    if quantity == "current":
        fits = [c for c in fits if not drives_nothing(c.name)]
    if quantity in ("position", "velocity"):
        fits = [c for c in fits if not is_no_place(c.name)]
    if quantity == "reference":
        return [c for c in fits if role(c.name) in ("reference", "command")]  # a command position is one
    if quantity != "command":
        others = ("reference", "command") if quantity in ("position", "velocity") else ("reference",)
        fits = [c for c in fits if role(c.name) not in others]
    if quantity == "position":  # a speed is a spindle's position only where it is called so, or nothing else is there
        places = [c for c in fits if dimension(c.unit or "") != "angular speed"]
        fits = places or fits
    named = [c for c in fits if role(c.name) == quantity]
    fits = named or fits
    # what acts, where the controller's unlimited answer is there too
    if quantity == "command" and len(fits) > 1 and all(dimension(c.unit or "") == "voltage" for c in fits):
        acting = [c for c in fits if "voltage" in words_of(c.name)]
        fits = acting if len(acting) == 1 else fits
    return fits


def _likely(columns: Sequence[Column], quantity: str) -> Column | None:
    """The first column that may be the quantity, by unit or else by name."""
    measured = [c for c in columns if not is_never_measured(c.name)]
    fits = _fitting(measured, quantity)
    named = [
        c
        for c in measured
        if role(c.name) == quantity
        and (c.unit is None or _is_strange(c) or (quantity == "command" and dimension(c.unit) == "ratio"))
        and not (quantity in ("command", "current") and drives_nothing(c.name))
    ]
    chosen = [*fits, *named] if any(role(c.name) == quantity for c in fits) else [*named, *fits]
    return next(iter(chosen), None)
