"""Friction over speed, from the stretches of logs in which the axis keeps its speed (Stribeck's curve).

At constant speed nothing accelerates, so the command is all friction:

    g u = ± (F_c + (F_s - F_c) e^(-(v/v_s)²)) + F_v v

Each steady stretch is a point; the points of each direction are fitted by themselves. A standard error is the larger
of two: that by the scatter of the points about the curve, and that by what each point's own samples leave open, which
alone holds where there are no more points than numbers. What the points cannot tell is said: inertia and time constant
at all, static friction below the slowest speed, viscous friction from one speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.identification.fit.made_estimate import t_quantile
from rds.identification.fit.smoothing import motion_of
from rds.identification.logs.log import Log
from rds.identification.structures.signals import PER_SI, POSITIONS, ROTARY, SPEEDS

_WINDOW = 0.05  # s, at least: over which the speed is looked at
_LEAST = 10  # samples of a window
_STEADY = 0.03  # by which the speed may change over a window, of the speed
_ALIKE = 0.05  # by which the windows of a stretch may differ in speed
_WINDOWS = 3  # of a stretch, at least: two windows at the turn of a sine look steady, too
_SAME_SPEED = 1.15  # ratio of speeds that count as one
_GRID = 25  # speeds v_s that are tried
_BETTER = 1.5  # half intervals (of many points three standard errors) by which Stribeck's part must differ from none
_STEPS = 5.0  # of an encoder, that a window must move


@dataclass(frozen=True)
class SteadyPoint:
    """One stretch at constant speed: mean speed and force (or command), and the standard error of the latter."""

    log: str
    begin: float  # s
    seconds: float
    speed: float
    force: float
    error: float


@dataclass(frozen=True)
class EstimatedValue:
    """A number of the curve with its standard error, and the 95 % interval (Student's t where points are few)."""

    value: float
    std_error: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class FrictionCurve:
    """Points, the numbers of each direction ("forward", "backward") by name, and what the points cannot tell."""

    points: tuple[SteadyPoint, ...]
    directions: Mapping[str, Mapping[str, EstimatedValue]]
    unidentifiable: tuple[str, ...]
    speed_unit: str
    force_unit: str
    per_si: float = 1.0  # of the speed's unit in that of F_v

    def at(self, speed: np.ndarray, direction: str) -> np.ndarray:
        """The curve's force (or command) at these speeds of one direction."""
        values = {name: told.value for name, told in self.directions[direction].items()}
        way = 1.0 if direction == "forward" else -1.0
        rise = values.get("F_s", values["F_c"]) - values["F_c"]
        extra = rise * np.exp(-((speed / values["v_s"]) ** 2)) if "v_s" in values else 0.0
        return np.asarray(way * (values["F_c"] + extra) + values.get("F_v", 0.0) / self.per_si * speed)

    def to_json(self) -> dict[str, Any]:
        """As JSON's own types."""
        return {
            "points": [asdict(point) for point in self.points],
            "directions": {
                way: {name: asdict(told) for name, told in numbers.items()} for way, numbers in self.directions.items()
            },
            "unidentifiable": list(self.unidentifiable),
            "speed_unit": self.speed_unit,
            "force_unit": self.force_unit,
        }


def friction_curve(logs: Sequence[Log]) -> FrictionCurve:
    """The friction curve of the axis that the logs are of. InputError where no stretch keeps its speed."""
    if not logs:
        raise InputError("there is no log; name at least one")
    units = {(log.units.get("position", "mm"), log.units.get("command", "V"), log.force_gain) for log in logs}
    if len(units) > 1:
        raise InputError("the logs are in different units, or state different gains; take those of one drive together")
    output, command, gain = units.pop()
    speed_unit = SPEEDS.get(output, f"{output}/s")
    force_unit = command if gain is None else logs[0].units.get("force", "N")
    points = tuple(point for log in logs for point in _steady(log, 1.0 if gain is None else gain))
    if not points:
        raise InputError(
            "no stretch keeps its speed; log runs at constant speed, each for a while, at several speeds both ways",
            ", ".join(log.name for log in logs),
        )
    unidentifiable = ["inertia, time constant and delay: at constant speed nothing accelerates"]
    if unused := [log.name for log in logs if log.name not in {point.log for point in points}]:
        unidentifiable.append(
            f"{', '.join(unused)}: no stretch of these logs keeps its speed within {100 * _STEADY:g} %, so nothing of "
            "them is in the curve"
        )
    directions: dict[str, Mapping[str, EstimatedValue]] = {}
    for way, name in ((1.0, "forward"), (-1.0, "backward")):
        of_way = [point for point in points if way * point.speed > 0.0]
        if not of_way:
            unidentifiable.append(f"friction {name}: no run goes that way")
            continue
        directions[name], said = _fitted(of_way, way, speed_unit, force_unit, output)
        unidentifiable += [f"{name}: {sentence}" for sentence in said]
    if force_unit == command and command not in ("N", "Nm"):
        key = "torque_gain" if output in ROTARY else "force_gain"
        unidentifiable.append(f"forces: all is in {command}; state {key} in the map for N or Nm")
    if len(directions) == 2:
        unidentifiable.append("whether what differs by direction is friction, or gravity or an offset of the drive")
    return FrictionCurve(
        points, directions, tuple(unidentifiable), speed_unit, force_unit, _viscous(output, force_unit)[0]
    )


def _steady(log: Log, gain: float) -> list[SteadyPoint]:
    width = max(_LEAST, round(_WINDOW / log.sample_period))
    count = len(log) // width
    if count < _WINDOWS:
        return []
    t, y = (values[: count * width].reshape(count, width) for values in (log.time, log.position))
    middle = t - t.mean(axis=1, keepdims=True)
    motion = motion_of(log)
    if log.is_rate:
        speed, change = y.mean(axis=1), (middle * y).sum(axis=1) / (middle**2).sum(axis=1) * (t[:, -1] - t[:, 0])
        least = max(3.0 * motion.noise / np.sqrt(width), (log.resolution or 0.0))
    else:
        speed = (middle * y).sum(axis=1) / (middle**2).sum(axis=1)
        half = width // 2
        early = _slope(t[:, :half], y[:, :half])
        change = 2.0 * (_slope(t[:, half:], y[:, half:]) - early)
        least = _STEPS * max(motion.noise, log.resolution or 0.0) / (width * log.sample_period)
    doubt = 3.0 * motion.noise / (np.sqrt(width) * (1.0 if log.is_rate else 0.1 * width * log.sample_period))
    steady = (np.abs(speed) > least) & (np.abs(change) <= np.maximum(_STEADY * np.abs(speed), min(doubt, least)))
    found, first = [], 0
    while first < count:
        end = first
        while end < count and steady[end] and abs(speed[end] - speed[first]) <= _ALIKE * abs(speed[first]):
            end += 1
        if end - first >= _WINDOWS:
            found.append(_point(log, first * width, end * width, float(speed[first:end].mean()), gain))
        first = max(end, first + 1)
    return found


def _slope(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    middle = t - t.mean(axis=1, keepdims=True)
    return np.asarray((middle * y).sum(axis=1) / (middle**2).sum(axis=1))


def _point(log: Log, first: int, end: int, speed: float, gain: float) -> SteadyPoint:
    from rds.identification.fit.residuals import effective_samples

    force = gain * log.command[first:end]
    spread = force - force.mean()
    alone = max(effective_samples(spread), 1.0) if spread.any() else float(len(force))
    return SteadyPoint(
        log=log.name,
        begin=float(log.time[first]),
        seconds=float(log.time[end - 1] - log.time[first]),
        speed=speed,
        force=float(force.mean()),
        error=float(force.std() / np.sqrt(alone)),
    )


def _fitted(
    points: Sequence[SteadyPoint], way: float, speed_unit: str, force_unit: str, output: str
) -> tuple[dict[str, EstimatedValue], list[str]]:
    """The numbers of one direction, and what its points cannot tell."""
    v = np.array([way * point.speed for point in points])
    f = np.array([way * point.force for point in points])
    own = np.array([point.error for point in points])
    slowest, fastest = float(v.min()), float(v.max())
    speeds = int(np.count_nonzero(np.diff(np.sort(v)) > (_SAME_SPEED - 1.0) * np.sort(v)[:-1])) + 1
    said = [f"static friction, and anything below {slowest:.3g} {speed_unit}, the slowest of these points"]
    if speeds < 2:
        said.append(f"viscous friction: all runs are at {v.mean():.3g} {speed_unit}, and F_c is all friction there")
        mean = _Solved(np.ones((len(f), 1)), np.array([f.mean()]), f - f.mean(), own)
        return {"F_c": mean.told(np.ones(1), force_unit)}, said
    per_si, unit = _viscous(output, force_unit)
    plain = _linear(v, f, own, None)
    coulomb, slope = np.eye(2)
    numbers = {"F_c": plain.told(coulomb, force_unit), "F_v": plain.told(per_si * slope, unit)}
    if speeds < 5:
        said.append(f"Stribeck's part: {speeds} speeds are too few, 5 or more are needed")
        return numbers, said
    grid = np.geomspace(0.3 * slowest, 0.5 * fastest, _GRID)
    solved = {float(vs): _linear(v, f, own, float(vs)) for vs in grid}
    best = min(solved, key=lambda vs: solved[vs].left)
    rise = solved[best].told(np.array([0.0, 0.0, 1.0]), force_unit)
    if not rise.value > _BETTER * (rise.high - rise.value) or solved[best].left > 0.5 * plain.left or best <= grid[0]:
        said.append(
            f"Stribeck's part: from {slowest:.3g} to {fastest:.3g} {speed_unit} the points are on a line as well; go "
            "slower"
        )
        return numbers, said
    return _stribeck(v, f, own, solved[best].values, best, speed_unit, force_unit, output), said


@dataclass(frozen=True)
class _Solved:
    """Least squares over points: slopes (points, n), values (n,), what is left, and each point's own standard error."""

    slopes: np.ndarray
    values: np.ndarray
    residual: np.ndarray
    own: np.ndarray

    @property
    def left(self) -> float:
        return float(np.sum(self.residual**2))

    def told(self, row: np.ndarray, unit: str) -> EstimatedValue:
        """The number `row @ values`."""
        weights = self.slopes @ np.linalg.pinv(self.slopes.T @ self.slopes) @ row  # of each point in it
        freedom = len(self.residual) - len(self.values)
        scatter = float(np.linalg.norm(weights)) * np.sqrt(self.left / freedom) if freedom > 0 else 0.0
        within = float(np.linalg.norm(weights * self.own))
        reach = max(t_quantile(freedom) * scatter, t_quantile(np.inf) * within)
        value = float(row @ self.values)
        return EstimatedValue(value, max(scatter, within), unit, value - reach, value + reach)


def _stribeck(
    v: np.ndarray, f: np.ndarray, own: np.ndarray, theta: np.ndarray, vs: float, speed_unit: str, force_unit: str,
    output: str,
) -> dict[str, EstimatedValue]:  # fmt: skip
    """All four numbers, refined together from the best of the grid."""
    with needed_for("a friction curve"):
        from scipy.optimize import least_squares

    def miss(p: np.ndarray) -> np.ndarray:
        return p[0] + p[1] * v + p[2] * np.exp(-((v / (p[3] * vs)) ** 2)) - f

    found = least_squares(miss, np.append(theta, 1.0), x_scale="jac")
    solved = _Solved(np.asarray(found.jac), found.x, found.fun, own)
    per_si, viscous_unit = _viscous(output, force_unit)
    coulomb, slope, rise, width = np.eye(4)
    return {
        "F_c": solved.told(coulomb, force_unit),
        "F_v": solved.told(per_si * slope, viscous_unit),
        "F_s": solved.told(coulomb + rise, force_unit),
        "v_s": solved.told(vs * np.sign(found.x[3]) * width, speed_unit),
    }


def _linear(v: np.ndarray, f: np.ndarray, own: np.ndarray, vs: float | None) -> _Solved:
    """Coefficients of 1, v and (with `vs`) Stribeck's exponential."""
    A = np.column_stack([np.ones_like(v), v, *([] if vs is None else [np.exp(-((v / vs) ** 2))])])
    theta = np.linalg.lstsq(A, f, rcond=None)[0]
    return _Solved(A, theta, f - A @ theta, own)


def _viscous(output: str, force_unit: str) -> tuple[float, str]:
    """What a slope over the log's speed is multiplied by, and its unit."""
    if force_unit == "N" and output not in ROTARY:
        return PER_SI[output], "N·s/m"
    if force_unit == "Nm" and output in ROTARY:
        return PER_SI[output], "Nm·s/rad"
    return 1.0, f"{force_unit} per {SPEEDS.get(output, POSITIONS.get(output, (output, 1.0))[0])}"
