"""One axis of a table as logs: its quantities on one time, in stretches without gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.clocks import hold, resample
from rds.identification.logs.columns import column_time, quantity
from rds.identification.logs.csv_table import missing_samples
from rds.identification.logs.excitation import is_steady
from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import QUANTITIES, RATES, Clock, Finding, Gravity, Log
from rds.identification.logs.map import LogMap
from rds.identification.logs.map_axis import GAINS, AxisMap, ColumnMap
from rds.identification.logs.second_file import SecondFile
from rds.identification.logs.table import Table
from rds.identification.logs.time_base import TimeBase, time_base
from rds.machines.machine import Axis

_ORDER = ("position", *(quantity for quantity in ("reference", *QUANTITIES) if quantity != "position"))
_HELD = ("command",)  # between its samples a command stays what it was
_IN_TURN = (
    'where each row is a message with columns of its own, as PlotJuggler writes them, blanks = "hold" in the map '
    "holds the last values beside each position"
)


@dataclass(frozen=True)
class _Part:
    """A quantity with the times at which it was stamped; the times are None where they are those of the rows."""

    values: np.ndarray
    unit: str
    time: np.ndarray | None
    second: bool


def axis_logs(table: Table, mapping: LogMap, about: AxisMap, second: SecondFile | None) -> list[Log]:
    """The logs of the axis: one, or one for each stretch between gaps. InputError as `read_log`."""
    machine_axis = mapping.machine.axis(about.machine_axis) if mapping.machine and about.machine_axis else None
    resolution = about.resolution
    if resolution is None and machine_axis is not None:
        resolution = machine_axis.resolution
    findings = [*table.findings, *(second.findings if second else ())]
    findings += [Finding("map", f"guessed: {sentence}") for sentence in mapping.said]
    parts = _parts(table, about, second, machine_axis, resolution, findings)
    if parts["position"].unit in RATES and "position" not in about.columns:
        resolution = None  # of a position, which was not logged
    time, arrays = _on_one_time(table, mapping, parts, second, findings)
    arrays, time = _without_blanks(arrays, time, mapping, table, findings)
    if mapping.samples is not None and mapping.samples > len(time):
        findings.append(missing_samples(mapping.samples, len(time), "the map announces"))
    base = time_base(time, mapping.jitter_limit, mapping.duplicates, mapping.gaps, str(table.path))
    findings += base.findings
    if len(base.keep) < len(time):
        time, arrays = time[base.keep], {name: values[base.keep] for name, values in arrays.items()}
    gain, reach = _gain(table, about), about.voltage_range
    units = {"time": "s"} | {name: part.unit for name, part in parts.items()}
    if gain is not None and units.setdefault("force", about.force_unit) != about.force_unit:
        raise InputError(f"{_gain_key(about)} is in {about.force_unit}, and force in {units['force']}", about.place)
    if reach is None and mapping.machine is not None and units["command"] == "V":
        reach = (-mapping.machine.converter.range, mapping.machine.converter.range)
    name = table.path.stem if len(mapping.axes) == 1 else f"{table.path.stem}:{about.name}"
    logs = []
    for number, (first, end) in enumerate(base.stretches, 1):
        log = Log(
            name=name if len(base.stretches) == 1 else f"{name} part {number}",
            time=time[first:end],
            command=arrays["command"][first:end],
            position=arrays["position"][first:end],
            extra={q: v[first:end] for q, v in arrays.items() if q not in ("command", "position")},
            units=units,
            resolution=resolution,
            voltage_range=reach,
            closed_loop=about.closed_loop if about.closed_loop is not None else _held(about),
            force_gain=gain,
            source=str(table.path),
            sha256=table.sha256,
            findings=tuple(findings),
            clocks=_clocks(table, mapping, parts, second, base),
            first=first,
        )
        logs.append(with_findings(log, machine_axis))
    return _without_resting(logs)


def _without_resting(logs: list[Log]) -> list[Log]:
    """The stretches of one recording without those that tell nothing beside the others, which say what was left out."""
    untold = {log.name: told for log in logs if (told := _tells_nothing(log))}
    if not untold or len(untold) == len(logs):
        return logs
    left_out = tuple(
        Finding(
            "excitation",
            f"{log.name} ({log.time[0]:.6g} to {log.time[-1]:.6g} s) was left out: {untold[log.name]}",
            Gravity.WARNING,
        )
        for log in logs
        if log.name in untold
    )
    return [replace(log, findings=log.findings + left_out) for log in logs if log.name not in untold]


def _tells_nothing(log: Log) -> str:
    """Why a stretch tells nothing of the axis, or "". A steady speed does, beside others."""
    if is_steady(log):
        return ""
    return next((f.what for f in log.findings if f.kind == "excitation" and f.gravity is Gravity.FAULT), "")


def _parts(
    table: Table,
    about: AxisMap,
    second: SecondFile | None,
    machine_axis: Axis | None,
    resolution: float | None,
    findings: list[Finding],
) -> dict[str, _Part]:
    target = machine_axis.unit if machine_axis else None
    parts: dict[str, _Part] = {}
    for name, column_map in sorted(about.columns.items(), key=lambda item: _ORDER.index(item[0])):
        source = second.table if column_map.second and second is not None else table
        column = source.column(column_map.column, column_map.place)
        values, unit, found = quantity(column, column_map, name, resolution, target)
        findings += found
        if name == "position" or (name == "reference" and "position" not in parts):
            target = unit
        elif name in ("reference", "following_error") and unit != target:
            other = "position" if "position" in parts else "reference"
            raise InputError(f"{name} is in {unit}, and {other} in {target}; one of the units is wrong", about.place)
        parts[name] = _Part(values, unit, _own_time(column.time, column_map, second), column_map.second)
    return _completed(parts, about, findings)


def _completed(parts: dict[str, _Part], about: AxisMap, findings: list[Finding]) -> dict[str, _Part]:
    """With the position that reference and following error tell, or the reference; a log of a speed has it as position.

    A drive's following error (CiA 402, object 60F4h) is the position demanded less the actual one.
    """
    error = parts.pop("following_error", None)
    if error is not None:
        has, other, sign = ("position", "reference", 1.0) if "position" in parts else ("reference", "position", -1.0)
        if other in parts:
            findings.append(Finding("map", "following_error is not used: position and reference are both there"))
        else:
            known = parts[has]
            if (known.second, known.time is None) != (error.second, error.time is None) or (
                known.time is not None and error.time is not None and not np.array_equal(known.time, error.time)
            ):
                raise InputError(f"following_error has other times than {has}; map the {other} itself", about.place)
            parts[other] = replace(known, values=known.values + sign * error.values)
            made = "position and following error" if other == "reference" else "reference less following error"
            findings.append(Finding("map", f"the {other} is {made}"))
    if "position" not in parts:
        unit = parts["velocity"].unit
        parts["position"] = parts.pop("velocity")
        what = f"no position was logged: the axis is known by its speed ({unit}) alone"
        findings.append(Finding("map", f"{what}; what depends on where it is (play, travel) cannot be told"))
        if "reference" in parts and (of := parts["reference"].unit) != unit:
            del parts["reference"]
            findings.append(Finding("map", f"the reference is not used: it is in {of}, and the speed in {unit}"))
    return parts


def _own_time(time: np.ndarray | None, about: ColumnMap, second: SecondFile | None) -> np.ndarray | None:
    if not about.second or second is None:
        return time
    return second.time if time is None else second.alignment.to_first(time)


def _on_one_time(
    table: Table, mapping: LogMap, parts: dict[str, _Part], second: SecondFile | None, findings: list[Finding]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """All quantities at the times of the first file's rows; of a bus log, at those of the position."""
    grid = column_time(table, mapping.time)
    if not len(grid):
        main = parts["position"] if not parts["position"].second else parts["command"]
        if main.time is None:
            raise InputError("it is not known when anything was measured; give [time]", mapping.time.place)
        grid = main.time
    own = {name: part.time for name, part in parts.items() if part.time is not None and part.time is not grid}
    for name, time in own.items():
        _check_order(name, time, parts[name].second, table, second)
    others = list(own.values())
    if not others:  # the times themselves are judged by time_base
        return grid, {name: part.values for name, part in parts.items()}
    first, last = max([grid[0], *(t[0] for t in others)]), grid[-1]
    if second is not None and any(part.second for part in parts.values()):
        last = min([last, *(p.time[-1] for p in parts.values() if p.second and p.time is not None)])
    inside = (grid >= first) & (grid <= last)
    if inside.sum() < 2:
        raise InputError("its columns have hardly a time in common; check the files and their clocks", str(table.path))
    if not inside.all():
        what = f"{int((~inside).sum())} samples outside the time that all columns share were left out"
        findings.append(Finding("clock", what))
        grid_in = grid[inside]
    else:
        grid_in = grid
    arrays = {}
    for name, part in parts.items():
        if part.time is None:
            arrays[name] = part.values if grid_in is grid else part.values[inside]
        elif part.time is grid:
            arrays[name] = part.values[inside]
        elif name in _HELD or not part.second:
            arrays[name] = hold(part.time, part.values, grid_in)
            if not part.second:
                findings.append(_age(name, part.time, grid_in))
        else:
            arrays[name], error = resample(part.time, part.values, grid_in)
            what = f"{name} was interpolated to the first file's times on straight lines, to {error:.3g} {part.unit}"
            findings.append(Finding("resampling", what))
    return grid_in, arrays


def _check_order(name: str, time: np.ndarray, of_second: bool, table: Table, second: SecondFile | None) -> None:
    """InputError for times (s) that are not the rows' own, and cannot be looked up in: none, blank, or going back."""
    where = str(second.table.path if of_second and second is not None else table.path)
    if len(time) == 0:
        raise InputError(f"the column of {name} holds no values", where)
    blank = np.flatnonzero(~np.isfinite(time))
    if len(blank):
        raise InputError(f"the time of {name} has no number in sample {blank[0]}; repair it", where)
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        k = int(back[0]) + 1
        raise InputError(
            f"the time of {name} goes back at sample {k}, from {time[k - 1]:.9g} to {time[k]:.9g} s ({len(back)} such "
            "steps); put the samples in order, and take one recording",
            where,
        )


def _age(name: str, time: np.ndarray, grid: np.ndarray) -> Finding:
    """How old the last received value is where it is used."""
    at = np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)
    age = grid - time[at]
    what = (
        f"of {name} the last received value is held: it is {np.median(age):.3g} s old at the median, {age.max():.3g} s"
    )
    return Finding("resampling", f"{what} at most")


def _without_blanks(
    arrays: dict[str, np.ndarray], time: np.ndarray, mapping: LogMap, table: Table, findings: list[Finding]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    if mapping.blanks == "hold":
        return _with_last_values(arrays, time, table, findings)
    in_turn = _are_in_turn(arrays)
    good = np.isfinite(time)
    for name, values in arrays.items():
        finite = np.isfinite(values)
        if not finite.all() and mapping.blanks == "refuse":
            row = int(np.flatnonzero(~finite)[0])
            advice = 'repair it, or leave such samples out with blanks = "drop" in the map'
            raise InputError(
                f"{name} has no number in {int((~finite).sum())} of {len(values)} samples, first in sample {row}; "
                f"{_IN_TURN if in_turn else advice}",
                str(table.path),
            )
        good &= finite
    if good.all():
        return arrays, time
    if not np.isfinite(time).all() and mapping.blanks == "refuse":
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise InputError(
            f'time has no number in sample {row}; repair it, or blanks = "drop" in the map', str(table.path)
        )
    bad = int((~good).sum())
    if good.sum() < 2:
        what = "hardly a sample has a number in every column of the map"
        raise InputError(f"{what}; {_IN_TURN}" if in_turn else what, str(table.path))
    row = int(np.flatnonzero(~good)[0])
    what = f"{bad} samples without a number in every column were left out, the first is sample {row}"
    findings.append(Finding("blanks", what, Gravity.WARNING, row))
    return {name: values[good] for name, values in arrays.items()}, time[good]


def _are_in_turn(arrays: dict[str, np.ndarray]) -> bool:
    """Whether most rows with a position lack another quantity that has numbers: rows of one message each."""
    there = np.isfinite(arrays["position"])
    others = [np.isfinite(values) for name, values in arrays.items() if name != "position"]
    return any(finite.any() and 2 * int((there & finite).sum()) < int(there.sum()) for finite in others)


def _with_last_values(
    arrays: dict[str, np.ndarray], time: np.ndarray, table: Table, findings: list[Finding]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The rows with time and position, and beside them the last value of each other quantity, of that row or above."""
    rows = np.arange(len(time))
    good = np.isfinite(time) & np.isfinite(arrays["position"])
    last = {name: np.maximum.accumulate(np.where(np.isfinite(v), rows, -1)) for name, v in arrays.items()}
    for name, at in last.items():
        if not (early := good & (at < 0)).any():
            continue
        what = f"{int(early.sum())} samples before the first {name} were left out"
        findings.append(Finding("blanks", what, Gravity.WARNING, int(np.flatnonzero(early)[0])))
        good &= at >= 0
    if good.sum() < 2:
        raise InputError("hardly a sample has a position with every other column before it", str(table.path))
    for name, at in last.items():
        if oldest := int((rows - at)[good].max()):
            what = f"of {name} the last value is held: it stands {int(np.median((rows - at)[good]))} rows above the "
            findings.append(Finding("resampling", f"{what}position at the median, {oldest} at most"))
    return {name: values[last[name][good]] for name, values in arrays.items()}, time[good]


def _held(about: AxisMap) -> bool | None:
    """True where a following error was logged, which only a controller has."""
    return True if "following_error" in about.columns else None


def _gain_key(about: AxisMap) -> str:
    return next(key for key, unit in GAINS.items() if unit == about.force_unit)


def _gain(table: Table, about: AxisMap) -> float | None:
    if not isinstance(about.force_gain, str):
        return about.force_gain
    if about.force_gain not in table.constants:
        known = ", ".join(table.constants) or "none"
        raise InputError(
            f"{_gain_key(about)} = {about.force_gain!r} is no single number of {table.path.name} (it has {known}); "
            f"give it in {about.force_unit} per unit of the command, as in {_gain_key(about)} = 35.15",
            about.place,
        )
    return table.constants[about.force_gain]


def _clocks(
    table: Table, mapping: LogMap, parts: dict[str, _Part], second: SecondFile | None, base: TimeBase
) -> tuple[Clock, ...]:
    """Where each quantity's times come from, and how sure they are where nobody says: a step of the stamps' digits."""
    where = mapping.time.source or (
        "times of receipt by the recorder of the bus"
        if table.format == "can"
        else f"{mapping.time.column or ('times of the rasters' if table.own_times else 'rate')}"
    )
    jitter = next((f.what for f in base.findings if f.kind == "jitter"), "")
    stated = mapping.time.uncertainty
    source = f"{where} of {table.path.name}" + (f" ({jitter})" if jitter else "")
    own = tuple(name for name, part in parts.items() if not part.second)
    clocks = [Clock(own, source, np.nan if stated is None else stated)] if own else []
    if second is not None:
        about = second.alignment
        clocks.append(
            Clock(
                tuple(name for name, part in parts.items() if part.second),
                f"{second.table.path.name}, aligned",
                about.uncertainty(float(second.time[-1])) if len(second.time) else about.offset_error,
                about.offset,
                about.drift,
                about.offset_error,
                about.drift_error,
                about.centre,
            )
        )
    return tuple(clocks)
