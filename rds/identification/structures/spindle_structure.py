"""The spindle as a first-order speed loop, as a structure to fit.

    τ v' + v = K (u(t - L) + u₀)        v in rev/min, u in V

`offset` frees u₀: a voltage that acts beside the command; friction of a spindle that turns one way only is part of it.
`delay` frees the dead time L. The log's position is the speed, and the only state too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.identification.logs.log import Log
from rds.identification.structures import spindle_kernel
from rds.identification.structures.signals import follow, followed
from rds.identification.structures.structure import Structure

OUTPUTS = ("rev/min",)
OPTIONS = ("offset", "delay")

PARAMETERS = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(rev/min)/V"),
    "offset": Quantity("voltage that acts beside the command", "V"),
    "delay": Quantity("dead time from a command to its effect", "s", low=0.0),
}
UNITS = {"tau": "s", "K": "(rev/min)/V", "offset": "V", "delay": "s"}


def make(options: Sequence[str] = (), output: str = "rev/min", command: str = "V") -> Structure:
    """The structure `spindle`, with what `options` free, for a command in this unit."""
    names = [name for name in PARAMETERS if name in ("tau", "K") or name in options]
    return Structure(
        name="spindle",
        parameters=followed({name: PARAMETERS[name] for name in names}, output, command),
        units={name: follow(UNITS[name], output, command) for name in names},
        states=1,
        respond=respond,
        options=tuple(options),
        sensitivities=sensitivities,
        as_model=as_model,
        state_names=("speed",),
        start=_Start(tuple(options)),
        output_unit=output,
        command_unit=command,
    )


def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
    """Speeds in rev/min at the times `t`, from the speed `x0`."""
    return _answer(t, u, x0, values)[0]


def sensitivities(
    t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Speeds (samples,) and their derivatives (samples, parameters + 1), and by the initial speed."""
    y, slopes = _answer(t, u, x0, values)
    names = list(PARAMETERS)
    return y, slopes[:, [names.index(name) for name in names if name in values] + [4]]


def _answer(
    t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    t, u = np.ascontiguousarray(t, dtype=float), np.ascontiguousarray(u, dtype=float)
    offset, delay = float(values.get("offset", 0.0)), float(values.get("delay", 0.0))
    return spindle_kernel.sensitivities(t, u, float(x0[0]), float(values["tau"]), float(values["K"]), offset, delay)


def as_model(values: Mapping[str, float]) -> dict[str, Any]:
    """The library's spindle with these parameters."""
    return {"name": "spindle", **values}


class _Start:
    """Values to begin a fit with: a regression of each speed on the one before and the voltage, over a grid of steps.

    Over a step of h s, v(t + h) = a v(t) + (1 - a) K (ū + u₀), a = e^(-h/τ). Short steps drown in the rounding of the
    speed, long ones tell no τ: each h gives a candidate, and the fit begins with the one whose free run is nearest.
    """

    def __init__(self, options: tuple[str, ...]):
        self.options = options

    def __call__(self, logs: Sequence[Log]) -> list[tuple[dict[str, float], list[tuple[float, ...]]]]:
        # a log may begin with its step: the speed then changes under a command that is the same throughout
        if not any(np.ptp(log.position) > 0.0 and np.any(log.command) for log in logs):
            what = "speed never changes" if any(np.any(log.command) for log in logs) else "command is 0 throughout"
            names = ", ".join(log.name for log in logs)
            raise InputError(f"the {what}, so there is nothing to tell a time constant or gain from", names)
        states: list[tuple[float, ...]] = [(float(log.position[0]),) for log in logs]
        candidates = []
        for step in np.unique(np.geomspace(1, max(min(len(log) for log in logs) // 8, 1), 12).astype(int)):
            values = self._regress(logs, int(step))
            if values is not None:
                candidates.append((self._misfit(logs, values), values))
        if not candidates:
            span = min(float(log.time[-1] - log.time[0]) for log in logs)
            candidates = [(0.0, self._with_options(span / 10.0, 1.0, 0.0))]
        candidates.sort(key=lambda pair: pair[0])
        return [(values, states) for _, values in candidates[:2]]

    def _with_options(self, tau: float, K: float, offset: float) -> dict[str, float]:
        values = {"tau": tau, "K": K, "offset": offset, "delay": 0.0}
        return {name: value for name, value in values.items() if name in ("tau", "K") or name in self.options}

    def _regress(self, logs: Sequence[Log], step: int) -> dict[str, float] | None:
        rows, targets, steps = [], [], []
        for log in logs:
            sums = np.concatenate([[0.0], np.cumsum(log.command[:-1] * np.diff(log.time))])
            h = log.time[step:] - log.time[:-step]
            mean = (sums[step:] - sums[:-step]) / h
            rows.append(np.column_stack([log.position[:-step], mean, np.ones(len(mean))]))
            targets.append(log.position[step:])
            steps.append(float(h.mean()))
        X, y = np.vstack(rows), np.concatenate(targets)
        X = X if "offset" in self.options else X[:, :2]
        a, gain, *shift = np.linalg.lstsq(X, y, rcond=None)[0]
        if not (0.0 < a < 1.0 and np.isfinite(gain) and gain != 0.0):
            return None
        K = gain / (1.0 - a)
        return self._with_options(-float(np.mean(steps)) / float(np.log(a)), float(K), float(sum(shift) / gain))

    def _misfit(self, logs: Sequence[Log], values: Mapping[str, float]) -> float:
        errors = [respond(log.time, log.command, log.position[:1].tolist(), values) - log.position for log in logs]
        return float(sum(error @ error for error in errors))
