"""Circular test of two linear axes (ISO 230-4): deviations of each direction, and what they say of their causes.

G is the range of radii about the centre of least squares, one of the two ways that the standard allows (the other, of
the minimum zone, is never larger); G(b) that of both directions about their common centre. F is the radial deviation
from the programmed circle, positive outward. The causes are terms of the radial deviation over the angle a, where s is
1 counter-clockwise and -1 clockwise:

    dr = mean and offset of each direction + S cos 2a + Q sin 2a + s M sin 2a + reversals of both axes

The axes' diameters differ by 4 S, squareness is 2 Q/R, the axes' lags differ by 2 M/v. After a reversal an axis stands
until its play B (or twice what friction holds it back by) is taken up, and is B/2 behind from there. The terms are
fitted by least absolute deviations, which short spikes do not bend; what is left after a reversal is its spike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.circles import Arc, find_arcs, fit_circle
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import names_of
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "axes": Setting("the two axes, as in 'X,Y'; else those that go a circle", text=True),
    "radius": Setting("programmed radius, of a table without references", "mm", more_than=0),
    "spike": Setting("how long after a reversal its spike is looked for", "deg", 45.0, more_than=0, at_most=80),
}
_SENSES = {1: "counter-clockwise", -1: "clockwise"}
_CELLS = 720  # of a turn
_NOISE = 3.0  # standard deviations of the readings: what is smaller is no cause
_SHARE, _LEAST = 0.01, 0.05  # of G, which the terms, of first order, do not tell; µm
_SPIRAL = 0.2  # of G in a turn: what is less is no spiral
_LEFT = 0.5  # of G: where the terms leave more than this, the form is another
_HEADS = (
    "run",
    "direction",
    "steady [deg]",
    "radius [mm]",
    "feed [mm/min]",
    "mean radius error [µm]",
    "centre, 1st axis [µm]",
    "centre, 2nd axis [µm]",
    "G [µm]",
    "F max [µm]",
    "F min [µm]",
)


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """The circular test of each file, or of two that go one way each. InputError for what is no circle."""
    found = {name: find_arcs(file, settings["axes"]) for name, file in zip(names_of(files), files, strict=True)}
    ways = [arc for arcs in found.values() for arc in arcs]
    if len(found) == len(ways) == 2 and ways[0].sense != ways[1].sense and ways[0].axes == ways[1].axes:
        found = {" and ".join(found): sorted(ways, key=lambda arc: -arc.sense)}
    tests = [CircularTest(name, arcs, settings) for name, arcs in found.items()]
    note = (
        "G: range of radii about the centre of least squares, for both directions G(b). F: from the programmed circle; "
        "without references about the centre of least squares. Steady: run-in and run-out are left out."
    )
    digits = {"steady [deg]": 0, "radius [mm]": 3, "feed [mm/min]": 0} | dict.fromkeys(_HEADS[5:], 1)
    heads = ("run", "direction", "axis", "quadrant [deg]", "spike [µm]", "peak after [deg]")
    tables = [
        Table("Circular test", _HEADS, [[test.name, *row] for test in tests for row in test.rows], note, digits),
        Table(
            "Causes",
            ("run", "cause", "axis", "value", "unit", "recognized by"),
            [[test.name, *cause] for test in tests for cause in test.causes],
            "Below this it is a step or noise of the readings, what the causes leave, or 1 % of G: "
            + ", ".join(f"{test.name} {test.level:.2g} µm" for test in tests),
        ),
        Table(
            "Spikes after reversals",
            heads,
            [[test.name, *row] for test in tests for row in test.spikes],
            digits={"quadrant [deg]": 0, "spike [µm]": 1, "peak after [deg]": 1},
        ),
    ]
    return Report(
        "circular",
        "Circular test (ISO 230-4)",
        [file.name for file in files],
        settings,
        [table for table in tables if table.rows],
        {f"circle {test.name}": test.picture for test in tests},
        [f"{test.name}: {sentence}" for test in tests for sentence in test.findings()],
    )


class CircularTest:
    """One circle in one direction or both: `rows`, `causes` and `spikes` of the tables; `level`, µm: noise."""

    def __init__(self, name: str, arcs: Sequence[Arc], settings: Mapping[str, Any]):
        self.name, self.arcs, self.axes = name, arcs, arcs[0].axes
        self.centre, mean = fit_circle(np.concatenate([arc.points for arc in arcs]))  # of both directions
        lags, radius = [arc.lag for arc in arcs if arc.lag is not None], settings["radius"]
        if lags and radius:
            raise InputError(f"{name} has references, which tell the radius; leave the option radius away")
        self.lag = float(np.mean(lags)) if lags else None  # rad
        self.known = bool(lags or radius)  # of the programmed radius
        self.radius = radius or (arcs[0].radius if lags else mean)
        if max(abs(r - self.radius) for r in (mean, *(arc.radius for arc in arcs))) > 0.05 * self.radius:
            raise InputError(f"{name}: circles of {mean:g} mm, not all of {self.radius:g} mm; measure one, mend radius")
        rates = [arc.rate for arc in arcs if arc.rate is not None]
        self.feed = float(self.radius * np.mean(rates)) if rates else None  # mm/s
        rough = max(float(np.std(np.diff(_polar(arc, self.centre)[1], 2))) / 6**0.5 for arc in arcs)
        self.rows = [self._row([arc]) for arc in arcs] + ([self._row(arcs)] if len(arcs) > 1 else [])
        self.level = max(1e3 * arcs[0].resolution, 1e3 * _NOISE * rough, _SHARE * self.rows[-1][7], _LEAST)
        spiral = [_spiral(arc, self.centre) for arc in arcs]
        least = max(self.level, _SPIRAL * self.rows[-1][7])
        self.spiral = [change if abs(change) > least else 0.0 for change in spiral]  # µm in a turn, of each direction
        self._diagnose(settings["spike"])

    def _row(self, arcs: Sequence[Arc]) -> list[Any]:
        centre, radius = fit_circle(np.concatenate([arc.points for arc in arcs]))
        G = np.ptp(np.concatenate([_polar(arc, centre)[1] for arc in arcs]))
        about = self.centre if self.lag is None else arcs[0].centre
        radii = np.concatenate([_polar(arc, about)[1] for arc in arcs])
        off = [1e3 * float(r - self.radius) if self.known else None for r in (radius, radii.max(), radii.min())]
        offset = [None, None] if self.lag is None else (1e3 * (centre - about)).tolist()
        way = _SENSES[arcs[0].sense] if len(arcs) < 2 else "both directions"
        feed = None if self.feed is None else 60 * self.feed
        return [way, min(arc.steady for arc in arcs), self.radius, feed, off[0], *offset, 1e3 * float(G), *off[1:]]

    def _fit(self) -> tuple[np.ndarray, list[float], np.ndarray]:
        """The terms, each axis's play in µm, and what they leave in each cell of each arc; `level` and `left`."""
        angle = (np.arange(_CELLS) + 0.5) * 2 * pi / _CELLS
        places = [_polar(arc, self.centre) for arc in self.arcs]
        turns = [_turns(at) for at, _ in places]  # a spiral is left out: half of it would be an ellipse
        places = [
            (at, r - 1e-3 * change * (turn - turn.mean()))
            for (at, r), turn, change in zip(places, turns, self.spiral, strict=True)
        ]
        off = np.concatenate([_in_cells(at, r, self.radius) for at, r in places])
        s, a = np.repeat([arc.sense for arc in self.arcs], _CELLS), np.tile(angle, len(self.arcs))
        terms = [np.where(s == arc.sense, f, 0.0) for arc in self.arcs for f in (np.ones(len(a)), np.cos(a), np.sin(a))]
        terms += [np.cos(2 * a), np.sin(2 * a), s * np.sin(2 * a)][: 3 if len(self.arcs) > 1 else 2]
        travel = s * a, s * a - s * pi / 2  # since a reversal of either axis, at its largest position
        there = np.isfinite(off)
        play, weight = [0.0, 0.0], np.ones(int(there.sum()))
        for k in range(60):  # least absolute deviations by weights, at last without spikes; the play bends its own term
            reversals = [_reversal(t, b, self.radius) for t, b in zip(travel, play, strict=True)]
            shape = np.column_stack([*terms, *reversals])[there]
            found = np.linalg.lstsq(shape * weight[:, None], off[there] * weight, rcond=None)[0]
            left = off[there] - shape @ found
            play, usual = found[-2:].tolist(), _NOISE * 1.4826 * float(np.median(np.abs(left)))
            weight = 1 / np.sqrt(np.maximum(np.abs(left), 1e-3 + 0.02 * self.level))
            weight[(np.abs(left) > max(usual, 0.2 * self.level)) & (k > 30)] = 0.0
        rest = np.full(len(off), np.nan)
        rest[there] = left
        self.level = max(self.level, usual)
        self.left = 2 * float(np.quantile(np.abs(left), 0.9))  # µm, beside G: but for spikes
        return found, play, rest.reshape(-1, _CELLS)

    def _diagnose(self, reach: float) -> None:
        found, play, rest = self._fit()
        self.spikes = self._spikes(rest, int(reach * _CELLS / 360), play)
        both = len(self.arcs) > 1
        S, Q, M = (float(value) for value in found[3 * len(self.arcs) :][:3])
        (one, other), R, v = self.axes, self.radius, self.feed
        at_45 = "an ellipse at 45°, the same in both directions; positive: less than 90° between the axes"
        step = "a step at the axis's quadrants: backlash, or friction that the controller does not make up for"
        turns = "an ellipse at 45° that changes with the direction"
        every: list[tuple[float, list[Any]]] = [
            (S, ["scale mismatch", f"{one} - {other}", 4 * S, "µm of diameter", "an ellipse along the axes"])
        ]
        if both:
            lag = [2 * M / v, "ms of lag"] if v else [M, "µm at 45°"]
            every += [(Q, ["squareness", f"{one}, {other}", 2e3 * Q / R, "µm/m", at_45])]
            every += [(M, ["gain mismatch", f"{one} - {other}", *lag, turns])]
        else:
            every += [(Q, ["squareness or gain mismatch", f"{one}, {other}", Q, "µm at 45°", "an ellipse at 45°"])]
        every += [(b, ["reversal step", name, b, "µm", step]) for name, b in zip(self.axes, play, strict=True)]
        for name in self.axes:
            of = [row[3:] for row in self.spikes if row[1] == name]
            if len(of) > len(self.arcs):  # at most of its reversals: a reading that is off, or a drift, is at one
                height, after = np.median(of, axis=0).tolist()
                said = f"peaks {after:.1f}° after the quadrant, median of {len(of)}: friction at the reversal"
                every.append((np.inf, ["reversal spike", name, height, "µm", said]))
        if self.known:
            mean = float(found[: 3 * len(self.arcs) : 3].mean())  # without steps and spikes
            every.append((mean, ["radius error", f"{one}, {other}", mean, "µm", self._lag_said()]))
        self.causes = [row for amount, row in every if abs(amount) > self.level]
        if max(map(abs, play)) > 1.2 * self.rows[-1][7]:  # which no step can be: the terms bend to another form
            self.causes, self.left = [], self.rows[-1][7]

    def _lag_said(self) -> str:
        if self.lag is None or self.feed is None:
            return "the mean of all radii"
        shrinks = 1e3 * self.radius * (np.cos(self.lag) - 1)
        return (
            f"two equal first-order lags of {1e3 * np.tan(self.lag) * self.radius / self.feed:.3g} ms, as measured, "
            f"would make it {shrinks:.2f} µm: R/sqrt(1 + (ωT)²) - R, about -(vT)²/2R"
        )

    def _spikes(self, rest: np.ndarray, cells: int, play: Sequence[float]) -> list[list[Any]]:
        """The largest of what is left once play is taken up; inward it may be the soft end of a step, which is none."""
        rows = []
        for arc, left in zip(self.arcs, rest, strict=True):
            for quadrant in range(4):
                first = quadrant * _CELLS // 4
                after = left[(first + np.arange(cells) if arc.sense > 0 else first - 1 - np.arange(cells)) % _CELLS]
                ends = np.arccos(max(1 - 1e-3 * abs(play[quadrant % 2]) / self.radius, 0.0)) * _CELLS / (2 * pi)
                after[: int(np.ceil(ends))] = 0.0
                after = np.where((after > self.level) | (after < -self.level - abs(play[quadrant % 2]) / 2), after, 0.0)
                peak = int(np.argmax(np.abs(after)))
                if after[peak]:
                    place = (peak + 0.5) * 360 / _CELLS
                    name = self.axes[quadrant % 2]
                    rows.append([_SENSES[arc.sense], name, 90 * quadrant, float(after[peak]), place])
        return rows

    def findings(self) -> list[str]:
        """The test in sentences."""
        names = ["G"] * len(self.arcs) + ["G(b)"]
        said = [
            f"{row[0]}: circular deviation {G} = {row[7]:.1f} µm." for row, G in zip(self.rows, names, strict=False)
        ]
        said += [
            f"{_SENSES[arc.sense]}: only {arc.steady:.0f}° are at a steady feed, run-in and run-out left out; "
            "ISO 230-4 asks for 360°: program two turns."
            for arc in self.arcs
            if arc.steady < 360
        ]
        said += [
            f"{_SENSES[arc.sense]}: the radius changes by {change:+.3g} µm in a turn: the path is a spiral, by a "
            "drift or by the program. G contains it; the causes are computed without it."
            for arc, change in zip(self.arcs, self.spiral, strict=True)
            if change
        ]
        if len(self.arcs) < 2:
            said.append(f"there is no G(b), for lack of a circle {_SENSES[-self.arcs[0].sense]}; measure it, too.")
        said += [f"{what} {axis}: {value:+.3g} {unit} ({how})." for what, axis, value, unit, how in self.causes]
        if self.left > max(_LEFT * self.rows[-1][7], _LEAST):
            return [
                *said,
                f"the causes that this test knows leave {self.left:.3g} µm of the form: it is noise, or has another "
                "cause, and values beside it are rough; look at the picture.",
            ]
        return (
            said if self.causes else [*said, f"no cause is above {self.level:.2g} µm, a step or noise of the readings."]
        )

    def picture(self) -> Picture:
        """Radial deviation over the angle, magnified, about the centre of least squares."""
        from rds.core.figure import BLUE, GREY, VERMILLION, Picture

        drawn = Picture(7.6, 7.6)
        axes: Any = drawn.subplots(subplot_kw={"projection": "polar"})
        largest = 1e-3
        for arc in self.arcs:
            angle, radii = _polar(arc, self.centre)
            order = np.argsort(angle)
            off = 1e3 * (radii - self.radius)[order]
            largest = max(largest, float(np.abs(off).max()))
            colour, line = (BLUE, "-") if arc.sense > 0 else (VERMILLION, (0, (5, 2)))
            axes.plot(angle[order], off, color=colour, linestyle=line, linewidth=1.1, label=_SENSES[arc.sense])
        turn = np.linspace(0, 2 * pi, 361)
        axes.plot(turn, 0 * turn, color=GREY, linewidth=2, zorder=1, label=f"reference circle, {self.radius:.4g} mm")
        power = 10.0 ** np.floor(np.log10(largest))
        step = next(power * each for each in (0.5, 1.0, 2.0, 5.0) if 2.5 * power * each >= largest)
        axes.set_rlim(-7.5 * step, 3 * step)  # the reference circle is 7.5 steps in radius
        ticks = step * np.arange(-3, 4)
        axes.set_rgrids(ticks, [f"{tick:+g} µm" if tick else "0" for tick in ticks], angle=67.5, fontsize="x-small")
        axes.set_axisbelow(False)  # the labels of the rings are above the curve
        for label in axes.get_yticklabels():
            label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6})
        names = {0: f"+{self.axes[0]}", 90: f"+{self.axes[1]}", 180: f"-{self.axes[0]}", 270: f"-{self.axes[1]}"}
        axes.set_thetagrids(range(0, 360, 45), [names.get(at, f"{at}°") for at in range(0, 360, 45)])
        axes.set_xlabel(f"{self.name}: radial deviation [µm], magnified {1e3 * self.radius / (7.5 * step):.3g} times")
        axes.legend(loc="center", frameon=False, fontsize="small")
        return drawn


def _polar(arc: Arc, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle (rad, 0 to 2 pi) and radius (mm) of each point."""
    x, y = (arc.points - centre).T
    return np.arctan2(y, x) % (2 * pi), np.hypot(x, y)


def _turns(angle: np.ndarray) -> np.ndarray:
    """Turns gone at each point."""
    return np.abs(np.unwrap(angle) - angle[0]) / (2 * pi)


def _spiral(arc: Arc, centre: np.ndarray) -> float:
    """By how much the radius changes in a turn, µm: steadily, and not back again as after a reversal."""
    angle, radii = _polar(arc, centre)
    turns = _turns(angle)
    shape = [np.ones(len(angle)), turns, *(f(k * angle) for k in (1, 2) for f in (np.cos, np.sin))]
    shape += [turns * np.cos(angle), turns * np.sin(angle)]  # a centre that drifts
    steady = 1e3 * float(np.linalg.lstsq(np.column_stack(shape), radii - radii.mean(), rcond=None)[0][1])
    ends = max(len(radii) // 72, 1)
    apart = 1e3 * float(radii[-ends:].mean() - radii[:ends].mean()) if arc.steady >= 360 else 0.0
    return steady if 0.5 < apart / (steady or 1.0) < 2.0 else 0.0


def _reversal(travel: np.ndarray, play: float, radius: float) -> np.ndarray:
    """Radial deviation for each µm of play: half of it ahead at a reversal, half behind once it is taken up."""
    gone = 1e3 * radius * (1 - np.cos(travel % pi)) / max(abs(play), 1e-9)
    return np.asarray((np.minimum(gone, 1.0) - 0.5) * np.where(travel % (2 * pi) < pi, 1, -1) * np.cos(travel))


def _in_cells(angle: np.ndarray, radii: np.ndarray, radius: float) -> np.ndarray:
    """Mean deviation (µm) in each cell of the turn; between readings along a line, NaN where none is within 5°."""
    cell = np.minimum((angle * _CELLS / (2 * pi)).astype(int), _CELLS - 1)
    count, every = np.bincount(cell, minlength=_CELLS), np.arange(_CELLS)
    full = np.flatnonzero(count)
    mean = 1e3 * np.bincount(cell, radii - radius, minlength=_CELLS)[full] / count[full]
    away = np.abs((every[:, None] - full + _CELLS // 2) % _CELLS - _CELLS // 2).min(axis=1)
    return np.where(away <= 10, np.interp(every, full, mean, period=_CELLS), np.nan)
