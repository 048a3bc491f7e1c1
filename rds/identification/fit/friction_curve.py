"""Friction over speed, from the stretches of logs in which the axis keeps its speed (Stribeck's curve).

At constant speed nothing accelerates, so the command is all friction:

    g u = ± (F_c + (F_s - F_c) e^(-(v/v_s)²)) + F_v v

Each steady stretch is a point; the points of each direction are fitted by themselves. What they cannot tell is said:
inertia and time constant at all, static friction below the slowest speed, viscous friction from one speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
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
_BETTER = 3.0  # standard errors by which Stribeck's part must differ from none
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
class Told:
    """A number of the curve with its standard error."""

    value: float
    std_error: float
    unit: str


@dataclass(frozen=True)
class FrictionCurve:
    """Points, the numbers of each direction ("forward", "backward") by name, and what the points cannot tell."""

    points: tuple[SteadyPoint, ...]
    directions: Mapping[str, Mapping[str, Told]]
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
    directions: dict[str, Mapping[str, Told]] = {}
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
) -> tuple[dict[str, Told], list[str]]:
    """The numbers of one direction, and what its points cannot tell."""
    v = np.array([way * point.speed for point in points])
    f = np.array([way * point.force for point in points])
    slowest, fastest = float(v.min()), float(v.max())
    speeds = int(np.count_nonzero(np.diff(np.sort(v)) > (_SAME_SPEED - 1.0) * np.sort(v)[:-1])) + 1
    said = [f"static friction, and anything below {slowest:.3g} {speed_unit}, the slowest of these points"]
    if speeds < 2:
        error = float(f.std(ddof=1) / np.sqrt(len(f))) if len(f) > 1 else float(points[0].error)
        said.append(f"viscous friction: all runs are at {v.mean():.3g} {speed_unit}, and F_c is all friction there")
        return {"F_c": Told(float(f.mean()), error, force_unit)}, said
    per_si, unit = _viscous(output, force_unit)
    plain = _linear(v, f, None)
    numbers = {
        "F_c": Told(float(plain[0][0]), float(plain[1][0]), force_unit),
        "F_v": Told(float(plain[0][1]) * per_si, float(plain[1][1]) * per_si, unit),
    }
    if speeds < 5:
        said.append(f"Stribeck's part: {speeds} speeds are too few, 5 or more are needed")
        return numbers, said
    grid = np.geomspace(0.3 * slowest, 0.5 * fastest, _GRID)
    best = min(grid, key=lambda vs: _linear(v, f, float(vs))[2])
    theta, errors, left = _linear(v, f, float(best))
    rise, sure = float(theta[2]), float(errors[2])
    if not rise > _BETTER * sure or left > 0.5 * plain[2] or best <= grid[0]:
        said.append(
            f"Stribeck's part: from {slowest:.3g} to {fastest:.3g} {speed_unit} the points are on a line as well; go "
            "slower"
        )
        return numbers, said
    return _stribeck(v, f, theta, float(best), speed_unit, force_unit, output), said


def _stribeck(
    v: np.ndarray, f: np.ndarray, theta: np.ndarray, vs: float, speed_unit: str, force_unit: str, output: str
) -> dict[str, Told]:
    """All four numbers, refined together from the best of the grid, with standard errors."""
    with needed_for("a friction curve"):
        from scipy.optimize import least_squares

    def miss(p: np.ndarray) -> np.ndarray:
        return p[0] + p[1] * v + p[2] * np.exp(-((v / (p[3] * vs)) ** 2)) - f

    found = least_squares(miss, np.append(theta, 1.0), x_scale="jac")
    freedom = max(len(v) - 4, 1)
    slopes = np.asarray(found.jac)
    covariance = np.linalg.pinv(slopes.T @ slopes) * 2.0 * found.cost / freedom
    per_si, viscous_unit = _viscous(output, force_unit)
    c, viscous, rise, width = np.eye(4)
    rows = {
        "F_c": (c, 1.0, force_unit),
        "F_v": (viscous, per_si, viscous_unit),
        "F_s": (c + rise, 1.0, force_unit),
        "v_s": (width * np.sign(found.x[3]), vs, speed_unit),
    }
    return {
        name: Told(times * float(row @ found.x), times * float(np.sqrt(max(row @ covariance @ row, 0.0))), unit)
        for name, (row, times, unit) in rows.items()
    }


def _linear(v: np.ndarray, f: np.ndarray, vs: float | None) -> tuple[np.ndarray, np.ndarray, float]:
    """Coefficients of 1, v and (with `vs`) Stribeck's exponential, their standard errors, and the squares left."""
    A = np.column_stack([np.ones_like(v), v, *([] if vs is None else [np.exp(-((v / vs) ** 2))])])
    theta = np.linalg.lstsq(A, f, rcond=None)[0]
    left = float(np.sum((f - A @ theta) ** 2))
    freedom = max(len(v) - A.shape[1], 1)
    covariance = np.linalg.pinv(A.T @ A) * left / freedom
    return theta, np.sqrt(np.maximum(np.diag(covariance), 0.0)), left


def _viscous(output: str, force_unit: str) -> tuple[float, str]:
    """What a slope over the log's speed is multiplied by, and its unit."""
    if force_unit == "N" and output not in ROTARY:
        return PER_SI[output], "N·s/m"
    if force_unit == "Nm" and output in ROTARY:
        return PER_SI[output], "Nm·s/rad"
    return 1.0, f"{force_unit} per {SPEEDS.get(output, POSITIONS.get(output, (output, 1.0))[0])}"
