"""Two saved results compared without running again."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.metrics import axis_metrics, fit_percent, metric_notes, moving
from rds.results.signals import signals_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rds.results.result import Result

# what a run is made of, sample by sample: two runs are identical where all of these are that both have
_ENDINGS = ("_reference", "_measured", "_command", "_voltage", "_target")
_ON_TIME = 0.01  # of a sample period: how far a time may be from k·T and still be sample k


@dataclass(frozen=True)
class SignalComparison:
    """A signal that the controllers of both results told, on the common samples: b - a, in `unit`."""

    unit: str
    max_difference: float
    rms_difference: float


@dataclass(frozen=True)
class AxisComparison:
    """One axis of two results, a and b, on their common samples. Lengths are in `unit`, times in s.

    `metrics_a` and `metrics_b` are those of each whole result; `max_difference` and `rms_difference` are of the
    measured responses, b - a; `fit_percent` is that of b's measured response to a's (None where a's never moves).
    `identical` says that reference, measured, command and voltage, so far as both have them, are equal bit for bit, and
    the signals that both have; `first_difference` is the time of the first sample that is not, in one of
    `differing_columns`; `signals` says how far the signals are apart.
    `same_controller` compares the hashes of the controllers' files (the names of library laws, which have none),
    `same_params` their parameters and `same_reference` the references; None where either result does not say.
    """

    axis: str
    unit: str
    samples: int
    metrics_a: dict[str, float | None]
    metrics_b: dict[str, float | None]
    max_difference: float
    rms_difference: float
    fit_percent: float | None
    identical: bool
    first_difference: float | None
    differing_columns: tuple[str, ...]
    same_reference: bool | None
    same_controller: bool | None
    same_params: bool | None
    signals: dict[str, SignalComparison]


@dataclass(frozen=True, repr=False)
class Comparison:
    """Two results side by side; see `compare`."""

    a: Result
    b: Result
    axes: dict[str, AxisComparison]
    notes: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """Whether all common axes are identical on all samples, and neither result has samples that the other lacks."""
        return len(self.a) == len(self.b) and all(
            axis.identical and axis.samples == len(self.a) for axis in self.axes.values()
        )

    @property
    def contour(self) -> dict[str, tuple[float, float]]:
        """Of runs along a path: largest and RMS contour error, and path error of what was commanded: a, b.

        In mm, over the samples in which each moves; only what both results have.
        """
        found = {}
        for column, name in (("contour_error", "contour error"), ("path_error", "path error (commanded)")):
            if column not in self.a or column not in self.b:
                continue
            errors = [np.asarray(of[column])[moving(of)] for of in (self.a, self.b)]
            if all(len(each) for each in errors):
                found[f"largest {name}"] = (float(errors[0].max()), float(errors[1].max()))
                found[f"RMS {name}"] = (_rms(errors[0]), _rms(errors[1]))
        return found

    def difference(self, axis: str) -> tuple[np.ndarray, np.ndarray]:
        """Time in s and the difference of the measured responses of `axis`, b - a, at the common samples."""
        at_a, at_b = common_samples(self.a, self.b)
        measured = f"{axis}_measured"
        return self.a["time"][at_a], self.b[measured][at_b] - self.a[measured][at_a]

    def to_json(self) -> dict[str, Any]:
        """As a dict that JSON can hold."""
        return {
            "a": _what(self.a),
            "b": _what(self.b),
            "identical": self.identical,
            "axes": {
                name: {key: value for key, value in asdict(axis).items() if key != "axis"}
                for name, axis in self.axes.items()
            },
            **({"contour": {name: list(both) for name, both in self.contour.items()}} if self.contour else {}),
            "notes": list(self.notes),
        }

    def plot(self) -> Figure:
        """Both measured responses over each other and their difference, per axis."""
        from rds.results.plots_overlay import comparison

        return comparison(self)

    def __repr__(self) -> str:
        same = ", identical" if self.identical else ""
        return f"<Comparison of {self.a!r} with {self.b!r}: {', '.join(self.axes)}{same}>"

    def __str__(self) -> str:
        from rds.results.comparison_text import text

        return text(self)

    def _repr_html_(self) -> str:
        from rds.results.comparison_text import fragment

        return fragment(self)


def _rms(errors: np.ndarray) -> float:
    return math.sqrt(float(np.mean(errors**2)))


def compare(a: Result, b: Result) -> Comparison:
    """Compare two results, matched by the name of the axis and by the sample number k = time / T.

    Nothing is interpolated: results of different sample periods, or whose times are not multiples of it, have no
    common samples, and are refused. Raises InputError for these, and for results without a common axis or sample.
    """
    if others := [each for each in (a, b) if not hasattr(each, "metrics")]:
        said = f"{others[0]}" if isinstance(others[0], str | Path) else f"{others[0]!r:.60}"
        raise InputError(f"{said} is no result; rds.open_result opens the one that is there")
    T = a.sample_period
    if not math.isclose(T, b.sample_period, rel_tol=1e-9):
        raise InputError(
            f"the sample periods differ ({T:g} s and {b.sample_period:g} s); results are compared sample by sample "
            "and not interpolated: run one again with the sample period of the other"
        )
    axes = [axis for axis in a.axes if axis in b.axes and f"{axis}_measured" in a and f"{axis}_measured" in b]
    if not axes:
        raise InputError(
            f"no common axis with a measured response: one has {', '.join(a.axes)}, the other {', '.join(b.axes)}"
        )
    at_a, at_b = common_samples(a, b)
    if not len(at_a):
        raise InputError("no common samples: " + " and ".join(_span(result) for result in (a, b)))
    every = axis_metrics(a), axis_metrics(b)
    compared = {axis: _one_axis(a, b, axis, at_a, at_b, (every[0][axis], every[1][axis])) for axis in axes}
    return Comparison(a, b, compared, tuple(_notes(a, b, compared, len(at_a))))


def common_samples(a: Result, b: Result) -> tuple[np.ndarray, np.ndarray]:
    """The rows of `a` and the rows of `b` that belong to the same sample numbers, in order."""
    k_a, k_b = _numbers(a, "first"), _numbers(b, "second")
    _, at_a, at_b = np.intersect1d(k_a, k_b, assume_unique=True, return_indices=True)
    return at_a, at_b


def _numbers(result: Result, which: str) -> np.ndarray:
    """Sample numbers k with time = k·T."""
    at = result["time"] / result.sample_period
    k = np.rint(at)
    off = np.abs(at - k) > _ON_TIME
    off[1:] |= np.diff(k) < 1  # two samples of one number
    if off.any():
        row = int(np.argmax(off))
        raise InputError(
            f"the {which} result has a sample at {result['time'][row]} s, which is no multiple of its sample period "
            f"of {result.sample_period:g} s; results are compared sample by sample and not interpolated"
        )
    return k.astype(np.int64)


def _one_axis(
    a: Result,
    b: Result,
    axis: str,
    at_a: np.ndarray,
    at_b: np.ndarray,
    metrics: tuple[dict[str, float | None], dict[str, float | None]],
) -> AxisComparison:
    measured, reference = f"{axis}_measured", f"{axis}_reference"
    unit = a.units[measured]
    if unit != b.units[measured]:
        raise InputError(f"axis {axis} is in {unit} in the first result and in {b.units[measured]} in the second")
    y_a, y_b = a[measured][at_a], b[measured][at_b]
    difference = np.asarray(y_b - y_a, dtype=float)
    columns = [axis + ending for ending in _ENDINGS if axis + ending in a and axis + ending in b]
    told = [
        name
        for name in signals_of(a, axis)
        if name in signals_of(b, axis) and a.units[f"{axis}_{name}"] == b.units[f"{axis}_{name}"]
    ]
    columns += [f"{axis}_{name}" for name in told]
    differing = {name: _differs(a[name][at_a], b[name][at_b]) for name in columns}
    differing = {name: where for name, where in differing.items() if where.any()}
    firsts = [int(np.argmax(where)) for where in differing.values()]
    return AxisComparison(
        axis=axis,
        unit=unit,
        samples=len(at_a),
        metrics_a=metrics[0],
        metrics_b=metrics[1],
        max_difference=float(np.abs(difference).max()),
        rms_difference=_rms(difference),
        fit_percent=fit_percent(y_a, y_b),
        identical=not differing,
        first_difference=float(a["time"][at_a][min(firsts)]) if firsts else None,
        differing_columns=tuple(differing),
        same_reference=bool(np.array_equal(a[reference][at_a], b[reference][at_b])) if reference in columns else None,
        same_controller=_same_controller(_controller(a, axis), _controller(b, axis)),
        same_params=_same(_controller(a, axis), _controller(b, axis), "params"),
        signals={name: _signal(a, b, f"{axis}_{name}", at_a, at_b) for name in told},
    )


def _signal(a: Result, b: Result, column: str, at_a: np.ndarray, at_b: np.ndarray) -> SignalComparison:
    difference = np.asarray(b[column][at_b] - a[column][at_a], dtype=float)
    rms = math.sqrt(float(np.mean(difference**2)))
    return SignalComparison(a.units[column], float(np.abs(difference).max()), rms)


def _differs(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Where two columns differ; not a number is the same as not a number."""
    return (left != right) & ~(np.isnan(left) & np.isnan(right))


def _controller(result: Result, axis: str) -> dict[str, Any]:
    return (result.meta.get("controller") or {}).get(axis) or {}


def _same_controller(left: dict[str, Any], right: dict[str, Any]) -> bool | None:
    """By the hash of the file; a law of the library has none and goes by its name."""
    if left.get("sha256") is None and right.get("sha256") is None:
        return _same(left, right, "name")
    return _same(left, right, "sha256")


def _same(left: dict[str, Any], right: dict[str, Any], key: str) -> bool | None:
    if left.get(key) is None or right.get(key) is None:
        return None
    return left[key] == right[key]


def _notes(a: Result, b: Result, compared: dict[str, AxisComparison], common: int) -> list[str]:
    notes = [
        f"only in the {which} result: axis {axis}"
        for which, result in (("first", a), ("second", b))
        for axis in result.axes
        if axis not in compared
    ]
    if common < max(len(a), len(b)):
        notes.append(f"{common} samples are common; the first result has {len(a)}, the second {len(b)}")
    for axis in compared:
        for name in signals_of(a, axis):
            left, right = a.units[f"{axis}_{name}"], b.units.get(f"{axis}_{name}")
            if right is not None and left != right:
                notes.append(
                    f"{axis}_{name} is in {left!r} in the first result and in {right!r} in the second: left out"
                )
    differing = [name for name, axis in compared.items() if axis.same_reference is False]
    if differing:
        notes.append(f"{', '.join(differing)}: the references differ, so the tracking errors answer different tasks")
    return notes + list(dict.fromkeys(metric_notes(a) + metric_notes(b)))


def _span(result: Result) -> str:
    return f"{result['time'][0]:g} to {result['time'][-1]:g} s" if len(result) else "an empty result"


def _what(result: Result) -> dict[str, Any]:
    keys = ("mode", "machine", "verdict", "ending", "started")
    about = {key: result.meta.get(key) for key in keys}
    return {**about, "samples": len(result), "sample_period": result.sample_period, "controller": _controllers(result)}


def _controllers(result: Result) -> dict[str, Any]:
    return {axis: {key: _controller(result, axis).get(key) for key in ("name", "sha256")} for axis in result.axes}
