"""The result of a run: a table with units, and a description of the run that made it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.types import Ending
from rds.results.files import read_saved, save_all, save_result
from rds.results.plain import plain
from rds.results.units import default_unit

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from rds.results.compare import Comparison


class Result:
    """What a run leaves.

    `columns` maps names to one-dimensional arrays of one length, kept as float64 or int64 and read-only:
    `time` in s, and per axis `X_reference`, `X_reference_velocity`, `X_reference_acceleration`, `X_measured`,
    `X_command` (the controller's answer before the limits, V), `X_voltage` (acting from this sample on, V; `X_target`
    where a drive closes a loop of its own: a position or a velocity), `X_modelled` (the model on the same voltages),
    `X_simulated` (its own closed loop), one such as `X_velocity` for each signal of the controller,
    `X_plant_velocity` (the simulated plant's); in the real-time modes
    `lateness`, `io`, `compute`, `model` in µs. Any other column is kept as well.

    `units` maps names to units; a column without an entry gets the usual unit of its name, or "".

    `meta` describes the run in JSON's own types. `axes` (their names) and `sample_period` (s) are needed;
    `mode`, `machine`, `duration` (s), `period` ({axis: s or None}, of a periodic reference), `verdict`,
    `verdict_reason`, `ending`, `ending_reason`, `notes` (sentences), `timing` (per stage), `environment`,
    `controller` ({axis: {name, sha256, params}}), `model`, `versions`, `started` and `voltage_range` (V, of the
    converter) are used where they are there.

    `validation` is what a run in the mode model-validation proved of its models, per axis (an
    `rds.identification.validate.validate.Validation`); it is not saved, but its numbers are, in `meta["validation"]`.

    Raises InputError for columns of different lengths, other than real numbers, or not finite, for a time that
    does not increase, and for a meta that lacks its needed keys. Only a `..._command` column may hold NaN or
    infinity: it is the evidence of a controller that broke its contract.
    """

    def __init__(
        self,
        columns: Mapping[str, Any],
        units: Mapping[str, str] | None = None,
        meta: Mapping[str, Any] | None = None,
    ):
        self.columns: dict[str, np.ndarray] = {name: _column(name, values) for name, values in columns.items()}
        self.meta: dict[str, Any] = plain(meta or {}, "meta")
        _check_columns(self.columns)
        _check_meta(self.meta)
        self.units: dict[str, str] = _units(self.columns, units or {})
        self.validation: Mapping[str, Any] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        """The column called `name`; KeyError names the columns there are."""
        if name not in self.columns:
            raise KeyError(f"no column {name!r}; the columns are {', '.join(self.columns)}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.columns["time"])

    def __repr__(self) -> str:
        ending = self.meta.get("ending", Ending.DONE)
        said = f", ended: {ending}" if ending != Ending.DONE else ""
        verdict = f", verdict {self.verdict}" if self.verdict else ""
        return f"<Result: {self.mode or 'run'} of {', '.join(self.axes)}, {len(self)} samples{said}{verdict}>"

    @property
    def axes(self) -> list[str]:
        """Names of the axes, in order."""
        return self.meta["axes"]

    @property
    def mode(self) -> str | None:
        """The mode of the run, where it is known."""
        return self.meta.get("mode")

    @property
    def verdict(self) -> str | None:
        """`met`, `missed`, `void`, or None where time was virtual."""
        return self.meta.get("verdict")

    @property
    def sample_period(self) -> float:
        """Seconds."""
        return self.meta["sample_period"]

    @property
    def length(self) -> float:
        """Seconds from the first sample to the end of the last, with the periods that were discarded between."""
        time = self.columns["time"]
        return float(time[-1] - time[0]) + self.sample_period if len(time) else 0.0

    @property
    def metrics(self) -> dict[str, dict[str, float | None]]:
        """Metrics per axis; see `axis_metrics` for what each is."""
        from rds.results.metrics import axis_metrics

        return axis_metrics(self)

    @property
    def notes(self) -> list[str]:
        """Sentences that the reader of the metrics needs to know; those of the run itself are in `meta["notes"]`."""
        from rds.results.metrics import metric_notes

        return metric_notes(self)

    @cached_property
    def table(self) -> pd.DataFrame:
        """The columns as a pandas DataFrame; its `attrs["units"]` holds the units. InputError without pandas."""
        with needed_for("a DataFrame", "take the columns as arrays, as in result['time']"):
            import pandas as pd

        table = pd.DataFrame(dict(self.columns))
        table.attrs["units"] = dict(self.units)
        return table

    def plot(self, axis: str | None = None) -> Figure:
        """Response, tracking error and voltage over time, of one axis or of all."""
        from rds.results.plots import overview

        return overview(self, axis)

    def plot_signals(self, axis: str | None = None) -> Figure:
        """What the controllers knew, over time: see `plots_signals.signals`. InputError where they told nothing."""
        from rds.results.plots_signals import signals

        return signals(self, axis)

    def compare(self, other: Result) -> Comparison:
        """This result against `other`, sample by sample."""
        from rds.results.compare import compare

        return compare(self, other)

    def save(self, path: str | Path) -> Path:
        """Save to a .csv, .mat or .parquet file, or in all three kinds in a directory; InputError if it cannot.

        A directory's name has no suffix, or one that begins with a digit, as in `kp-1.5`.
        """
        path = Path(path)
        if path.suffix and not path.suffix[1:2].isdigit():
            return save_result(self, path)
        save_all(self, path)
        return path

    @staticmethod
    def open(path: str | Path) -> Result:
        """Open a saved result without running again; see `open_result`."""
        return open_result(path)

    def _repr_html_(self) -> str:
        from rds.results.html import result_fragment

        return result_fragment(self)


def open_result(path: str | Path) -> Result:
    """The result saved at `path`: a file of any format, or a directory that holds one result.

    A directory with only the raw record of a run (one that was killed before it could save) is opened from that.
    A table from elsewhere with `time` and measured columns opens with what it has. Raises InputError, naming the
    file, the fault and the remedy, for anything else.
    """
    return read_saved(path, Result)


def _column(name: str, values: Any) -> np.ndarray:
    if not isinstance(name, str) or not name or name != name.strip() or not name.isprintable():
        raise InputError(f"column name {name!r} must be printable text without blanks around it")
    array = np.asarray(values)
    if array.ndim != 1:
        raise InputError(f"column {name!r} has shape {array.shape}; it must be one-dimensional, one value per sample")
    if array.dtype.kind not in "fiub" or (array.dtype.kind == "u" and array.dtype.itemsize == 8):
        raise InputError(f"column {name!r} holds {array.dtype}; it must hold real numbers (float64 or int64)")
    array = array.astype(np.float64 if array.dtype.kind == "f" else np.int64, copy=False).view()
    array.flags.writeable = False
    return array


def _check_columns(columns: Mapping[str, np.ndarray]) -> None:
    if "time" not in columns:
        raise InputError(f"there is no column 'time' (s); the columns are {', '.join(columns) or 'none'}")
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        odd = ", ".join(f"{name} {length}" for name, length in lengths.items() if length != lengths["time"])
        raise InputError(f"columns have different lengths: time has {lengths['time']} samples, but {odd}")
    for name, values in columns.items():
        if not name.endswith("_command") and not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(
                f"column {name!r} holds {values[row]} at sample {row}; every value must be finite: "
                "remove the sample or repair its source"
            )
    steps = np.diff(columns["time"])
    if not (steps > 0).all():
        row = int(np.flatnonzero(~(steps > 0))[0]) + 1
        raise InputError(
            f"time does not increase at sample {row}: {columns['time'][row - 1]} s, then {columns['time'][row]} s"
        )


def _check_meta(meta: Mapping[str, Any]) -> None:
    axes = meta.get("axes")
    if not isinstance(axes, list) or not axes or not all(isinstance(name, str) and name for name in axes):
        raise InputError(f"meta['axes'] is {axes!r}; it must list the names of the axes, as in ['X', 'Y']")
    period = meta.get("sample_period")
    if isinstance(period, bool) or not isinstance(period, int | float) or not period > 0:
        raise InputError(f"meta['sample_period'] is {period!r}; it must be the sample period in s, more than 0")


def _units(columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> dict[str, str]:
    for name, unit in units.items():
        if name not in columns:
            raise InputError(f"units name a column {name!r} that is not there; the columns are {', '.join(columns)}")
        if not isinstance(unit, str) or not (unit.isprintable()):
            raise InputError(f"the unit of column {name!r} is {unit!r}; it must be text such as 'mm'")
    return {name: units.get(name, default_unit(name)) for name in columns}
