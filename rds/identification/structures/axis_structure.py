"""The linear axis with friction of its own in each direction, as a structure to fit.

    τ v' + (1 + b) v = K w - F(v)      see `axis_motion` for the whole equation and each option's part in it

`viscous` (b) scales every other parameter of the equation: τ, K and F± come only as their ratios to 1 + b. So it is
held at 0 unless one of them is held at a value (`fixed`). `offset` is a voltage added to the command; friction that is
free per direction would take it up, so with it friction is one number, the same both ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.identification.logs.log import RATES, Log
from rds.identification.structures.signals import POSITIONS, follow, followed
from rds.identification.structures.structure import PLAY, Blocks, HiddenParameter, Start, Structure

OUTPUTS = ("mm", "deg", "mm/s", "rev/min")
OPTIONS = ("viscous", "stribeck", "offset", "dead-zone", "delay", "backlash")

PLAIN = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(mm/s)/V"),
    "friction_plus": Quantity("Coulomb friction while moving forward", "mm/s", low=0.0),
    "friction_minus": Quantity("Coulomb friction while moving backward, not positive", "mm/s"),
}
SYMMETRIC = {
    "tau": PLAIN["tau"],
    "K": PLAIN["K"],
    "friction": Quantity("Coulomb friction, the same both ways", "mm/s", low=0.0),
    "offset": Quantity("voltage that acts beside the command", "V"),
}
ADDED = {
    "viscous": {"viscous": Quantity("speed lost to viscous friction", "mm/s per mm/s", low=0.0)},
    "stribeck": {
        "stribeck": Quantity("friction added at standstill, as a fraction of Coulomb friction", low=0.0),
        "stribeck_velocity": Quantity("speed at which the Stribeck part has fallen to 1/e", "mm/s", above=0.0),
    },
    "offset": {},
    "dead-zone": {"dead_zone": Quantity("voltage to either side of 0 without effect", "V", low=0.0)},
    "delay": {"delay": Quantity("time from a command to its effect", "s", low=0.0)},
    "backlash": {"backlash": Quantity("whole width of the play before the encoder", "mm", low=0.0)},
}
NEUTRAL = {"stribeck": 0.0, "stribeck_velocity": 1.0, "dead_zone": 0.0, "delay": 0.0, "backlash": 0.0}
UNITS = {
    "tau": "s",
    "K": "(mm/s)/V",
    "friction_plus": "mm/s",
    "friction_minus": "mm/s",
    "friction": "mm/s",
    "offset": "V",
    "viscous": "",
    "stribeck": "",
    "stribeck_velocity": "mm/s",
    "dead_zone": "V",
    "delay": "s",
    "backlash": "mm",
}
NO_EFFECT = {
    "friction_plus": "the axis never moves forward",
    "friction_minus": "the axis never moves backward",
    "K": "the command never moves the axis",
    "dead_zone": "the axis never moves while the command is beyond it",
}
# Where each parameter stands in the array of `axis_motion`, and with which sign; `friction` stands twice.
_PLACES: dict[str, tuple[tuple[int, float], ...]] = {
    "tau": ((0, 1.0),),
    "K": ((1, 1.0),),
    "friction_plus": ((2, 1.0),),
    "friction_minus": ((3, 1.0),),
    "friction": ((2, 1.0), (3, -1.0)),
    "viscous": ((4, 1.0),),
    "stribeck": ((5, 1.0),),
    "stribeck_velocity": ((6, 1.0),),
    "offset": ((7, 1.0),),
    "dead_zone": ((8, 1.0),),
    "delay": ((9, 1.0),),
    "backlash": ((10, 1.0),),
}
_FIRST_STATE = 11
HARDLY = 30.0  # times the noise: friction of a direction in which the axis moves less may not be told


def make(options: Sequence[str] = (), output: str = "mm", command: str = "V") -> Structure:
    """The structure with the given options of `OPTIONS`, for an output and a command in these units.

    Where the output is a speed, its initial value is the only state. InputError for play there: it moves the position.
    """
    rate = output in RATES
    if rate and "backlash" in options:
        raise InputError("play shows in a position, and the log has a speed only; leave --option backlash out")
    table = dict(SYMMETRIC if "offset" in options else PLAIN)
    for option in options:
        table |= ADDED[option]
    names = tuple(table)
    table = followed(table, output, command)
    states = 1 if rate else 3 if "backlash" in options else 2
    first = _FIRST_STATE + 1 if rate else _FIRST_STATE
    places = [place for name in names for place, _ in _PLACES[name]]
    where = np.array([*places, *range(first, first + states)], dtype=np.int64)

    def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        return _moved(t, u, x0, values, where[:0], rate)[0]

    def sensitivities(
        t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        y, by = _moved(t, u, x0, values, where, rate)
        if "friction" not in table:
            return y, by
        both = names.index("friction")
        by[:, both] -= by[:, both + 1]
        return y, np.delete(by, both + 1, axis=1)

    def lands(t: np.ndarray, u: np.ndarray, blocks: Blocks, values: Mapping[str, float]) -> np.ndarray:
        from rds.identification.structures.axis_motion import extra_voltages

        starts, found = np.zeros((len(blocks.firsts), 3)), np.empty(len(blocks.firsts))
        begin = 1 if rate else 0
        starts[:, begin : begin + states] = blocks.states
        search = (blocks.trial, blocks.rounds, blocks.far)
        extra_voltages(t, u, blocks.firsts, blocks.length, starts, blocks.ends, place(values), rate, *search, found)
        return found

    def start(logs: Sequence[Log]) -> Iterator[Start]:
        from rds.identification.fit.starting_values import axis_starts, rate_starts

        return rate_starts(logs, names) if rate else axis_starts(logs, names, states)

    return Structure(
        name="axis",
        parameters=table,
        units={name: follow(UNITS[name], output, command) for name in names},
        states=states,
        respond=respond,
        options=tuple(options),
        sensitivities=sensitivities,
        lands=lands,
        as_model=partial(_as_model, POSITIONS[output][1]) if set(options) <= {"viscous", "offset"} else None,
        at_most={"friction_minus": 0.0} if "friction_minus" in table else {},
        state_names=("velocity",) if rate else ("position", "velocity", PLAY)[:states],
        state_bounds=((-np.inf, np.inf), (-np.inf, np.inf), (-1.0, 1.0))[:states],
        output_unit=output,
        command_unit=command,
        start=start,
        neutral={name: value for name, value in NEUTRAL.items() if name in table},
        idle=_idle if "friction_minus" in table else None,
        held=_held if "viscous" in options else None,
        no_effect={name: why for name, why in NO_EFFECT.items() if name in table},
    )


def place(values: Mapping[str, float]) -> np.ndarray:
    """The parameters as the array that `axis_motion` takes; those that are not given have no effect."""
    p = np.zeros(_FIRST_STATE)
    p[6] = 1.0
    for name, value in values.items():
        for index, sign in _PLACES[name]:
            p[index] = sign * value
    return p


def _moved(
    t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float], where: np.ndarray, rate: bool
) -> tuple[np.ndarray, np.ndarray]:
    from rds.identification.structures.axis_motion import move

    start = np.zeros(3)
    first = 1 if rate else 0
    start[first : first + len(x0)] = x0
    y, by = np.empty(len(t)), np.empty((len(t), len(where)))
    move(t, u, start, place(values), where, y, by, rate)
    return y, by


def _idle(logs: Sequence[Log], begun: Mapping[str, float]) -> dict[str, HiddenParameter]:
    """Friction of a direction in which no log moves by more than noise and the encoder's steps may do."""
    from rds.identification.fit.smoothing import motion_of
    from rds.identification.logs.motion import travel

    fastest = max(float(np.abs(motion_of(log).velocity).max()) for log in logs)
    found = {}
    for name, other, way in (("friction_plus", "friction_minus", 1.0), ("friction_minus", "friction_plus", -1.0)):
        if any(travel(log.position, way) > HARDLY * motion_of(log).noise for log in logs):
            continue
        # by sign of K, the largest voltage that drives that way
        sign = way if begun["K"] >= 0.0 else -way
        peak = max(0.0, *(float((sign * log.command).max()) for log in logs))

        def likely(
            values: Mapping[str, float], other: str = other, way: float = way, peak: float = peak
        ) -> tuple[float, float]:
            return -values[other], way * max(1.05 * abs(values["K"]) * peak, abs(values[other]))

        holding = 1e3 * max(fastest, abs(begun["K"]) * peak)
        found[name] = HiddenParameter(way * holding, likely)
    return found


def _held(fixed: frozenset[str]) -> dict[str, tuple[float, str]]:
    """Viscous friction cannot be told from position and voltage alone."""
    if fixed & {"viscous", "tau", "K", "friction_plus", "friction_minus", "friction"}:
        return {}
    why = (
        "viscous scales tau, K and friction alike, and the data tell only their ratios to 1 + viscous: it is held at "
        "0; hold one of the others at a known value (--fix K=1.764) to estimate it"
    )
    return {"viscous": (0.0, why)}


def _as_model(times: float, values: Mapping[str, float]) -> dict[str, Any]:
    """The library's linear axis that moves in the same way; `times` makes the speed's unit that of a position per s."""
    scale = (1.0 + values.get("viscous", 0.0)) / times
    shift = values["K"] * values.get("offset", 0.0)
    plus = values["friction"] if "friction" in values else values["friction_plus"]
    minus = -values["friction"] if "friction" in values else values["friction_minus"]
    return {
        "name": "linear-axis",
        "tau": values["tau"] / scale / times,
        "K": values["K"] / scale,
        "friction_plus": (plus - shift) / scale,
        "friction_minus": (minus - shift) / scale,
    }
