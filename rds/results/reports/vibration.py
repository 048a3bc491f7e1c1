"""Vibration from readings of a three-axis analogue accelerometer, in g.

    a = (reading · V_ref / 2^bits − V_supply / 2) / sensitivity

The sensor (ADXL335: ratiometric, 330 mV/g at 3.3 V) gives half its supply at 0 g. Source of the readings: section 9.6,
figures 91 to 93 and tables P36 to P38 of the thesis on the open architecture control system; its equation 9.1 is not
used, and docs/thesis-reports.md says why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import Column, columns_in, names_of, read_columns, without_readings_of
from rds.results.reports.settings import Setting
from rds.results.reports.statistics import summary
from rds.results.reports.windows import EXAMPLE, parse_windows

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "bits": Setting("bits of the converter", "bit", 10, whole=True, at_least=1, at_most=32),
    "reference": Setting("reference voltage of the converter: what a full reading stands for", "V", 3.3, more_than=0),
    "supply": Setting("supply voltage of the sensor; it gives half of it at 0 g", "V", 3.3, more_than=0),
    "sensitivity": Setting("sensitivity of the sensor", "mV/g", 330.0, more_than=0),
    "rest": Setting("readings at the start with the machine at rest", "", 5, whole=True, at_least=1),
    "windows": Setting(f"parts of the record to report by themselves, as in {EXAMPLE!r}", text=True),
}

NEAR_ONE_G = (0.8, 1.2)  # g: the bounds of a believable reading at rest; the sensor's offset may be 0.1 g and more


@dataclass(frozen=True)
class Vibration:
    """A record: accelerations by axis, and the readings they came from where they did."""

    name: str
    where: str
    g: Mapping[str, np.ndarray]  # accelerations in g, by axis
    readings: Mapping[str, np.ndarray]  # counts of the converter; empty for data in g

    def __len__(self) -> int:
        return len(next(iter(self.g.values())))

    def at_rest(self, rest: int) -> float:
        """Length of the mean acceleration over the first `rest` readings, g: 1 if sensor and options are right."""
        return float(np.sqrt(sum(float(values[:rest].mean()) ** 2 for values in self.g.values())))


def to_g(readings: np.ndarray, settings: Mapping[str, Any]) -> np.ndarray:
    """Accelerations in g from readings of the converter."""
    volts = readings * settings["reference"] / 2 ** settings["bits"]
    return (volts - settings["supply"] / 2) / (settings["sensitivity"] / 1e3)


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Statistics and pictures of all files. InputError for data or options that will not do."""
    records = [_read(path, name, settings) for path, name in zip(files, names_of(files), strict=True)]
    parts = [(record, name, part) for record in records for name, part in _parts(record, settings)]
    tables = [_statistics(parts, settings["rest"])]
    if any(record.readings for record in records):
        tables.append(_counts([record for record in records if record.readings], settings["rest"]))
    return Report(
        "vibration",
        "Vibration",
        [path.name for path in files],
        settings,
        tables,
        {f"Acceleration of {record.name}": partial(picture, record, settings) for record in records},
        _findings(records, settings),
    )


def _read(path: Path, name: str, settings: Mapping[str, Any]) -> Vibration:
    columns = [column for column in read_columns(path) if column.name.lower() not in ("time", "t")]
    columns = without_readings_of(columns, "current")  # what a module recorded beside, for the report on currents
    columns = columns_in(path, columns, ("adc", "g"), "readings of an accelerometer", "x_adc")
    if len({column.unit for column in columns}) > 1:
        raise InputError("it has columns in adc and in g; give one or the other", str(path))
    # the axes of one reading belong together: no blanks
    least = max(settings["rest"], 2)
    values = {column.name: np.asarray(column.numbers(least)) for column in columns}
    if columns[0].unit == "g":
        return Vibration(name, str(path), values, {})
    for column in columns:
        _within(column, settings["bits"])
    return Vibration(name, str(path), {axis: to_g(v, settings) for axis, v in values.items()}, values)


def _within(column: Column, bits: int) -> None:
    for line, cell in column.cells.items():
        value = float(cell.replace(",", "."))
        if not (0 <= value < 2**bits and value.is_integer()):
            raise column.fault(
                line, f"{cell!r} is no reading of {bits} bits, 0 to {2**bits - 1}; give the option bits, or head it _g"
            )


def _parts(record: Vibration, settings: Mapping[str, Any]) -> list[tuple[str, slice]]:
    windows = parse_windows(settings["windows"], len(record), record.where)
    return [("all", slice(None)), *((f"{w.name} ({w.first} to {w.last})", w.part) for w in windows)]


def _statistics(parts: Sequence[tuple[Vibration, str, slice]], rest: int) -> Table:
    columns = ["record", "part", "axis", "readings", "at rest [g]", "mean [g]", "RMS about mean [g]"]
    columns += ["min [g]", "max [g]", "peak to peak [g]"]
    rows = []
    for record, name, part in parts:
        for axis, values in record.g.items():
            s = summary(values[part])
            start, rms = float(values[:rest].mean()), float(values[part].std())
            rows.append([record.name, name, axis, s.n, start, s.mean, rms, s.low, s.high, s.high - s.low])
    note = f"At rest: the mean of the first {rest} readings. RMS about mean: over n."
    return Table("Acceleration", columns, rows, note, dict.fromkeys(columns[4:], 3))


def _counts(records: Sequence[Vibration], rest: int) -> Table:
    columns = ["record", "axis", "at rest [reading]", "max [reading]", "min [reading]", "mean [reading]"]
    rows = [
        [record.name, axis, float(values[:rest].mean()), values.max(), values.min(), float(values.mean())]
        for record in records
        for axis, values in record.readings.items()
    ]
    digits = dict.fromkeys(columns[2:], 1) | {"max [reading]": 0, "min [reading]": 0}
    return Table("Readings of the converter", columns, rows, digits=digits)


def _findings(records: Sequence[Vibration], settings: Mapping[str, Any]) -> list[str]:
    said = []
    for record in records:
        rms = {axis: float(values.std()) for axis, values in record.g.items()}
        most = max(rms, key=rms.__getitem__)
        said.append(
            f"{record.name}: RMS about the mean "
            + ", ".join(f"{axis} {value:.3f} g" for axis, value in rms.items())
            + f"; most in {most}."
        )
        if len(record.g) == 3:
            length = record.at_rest(settings["rest"])
            believable = NEAR_ONE_G[0] <= length <= NEAR_ONE_G[1]
            said.append(
                f"{record.name}: at rest the sensor shows {length:.2f} g in all"
                + ("." if believable else ", where gravity alone is 1 g: check reference, supply and sensitivity.")
            )
    return said


def picture(record: Vibration, settings: Mapping[str, Any]) -> Picture:
    """Acceleration of each axis about its value at rest, all to the same scale; windows shaded."""
    from rds.core.figure import CYCLE, GREY, Picture, dress, legend

    drawn = Picture(1.9 * len(record.g) + 0.4)
    grid = drawn.subplots(len(record.g), 1, squeeze=False, sharex=True, sharey=True)[:, 0]
    windows = parse_windows(settings["windows"], len(record), record.where)
    count = np.arange(1, len(record) + 1)
    for axes, colour, (axis, values) in zip(grid, CYCLE * 2, record.g.items(), strict=False):
        at_rest = float(values[: settings["rest"]].mean())
        label = f"{axis}, at rest {at_rest:+.3f} g, RMS about mean {values.std():.3f} g"
        axes.plot(count, values - at_rest, color=colour, linewidth=0.9, label=label)
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        for at, window in enumerate(windows):
            shade = 0.10 + 0.12 * (at % 2)
            axes.axvspan(window.first, window.last, color=GREY, alpha=shade, linewidth=0)
            if axes is grid[0]:
                place = ((window.first + window.last) / 2, 0.97)
                across = axes.get_xaxis_transform()
                axes.text(*place, window.name, transform=across, ha="center", va="top", fontsize="small")
        dress(axes, f"{axis} − rest [g]", "reading [number]" if axes is grid[-1] else None)
        legend(axes)
    drawn.align_ylabels()
    return drawn
