"""Named distributions of a delay: each is its quantile function, so that a uniform number draws it (inversion).

A quantile function takes probabilities (array, 0 to 1) and the parameters of its table, and returns delays in s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.quantities import Quantity

MOST = 1000.0  # s
_MEAN = Quantity("mean of the delay, above `low`", "s", 0.0, MOST, above=0.0)
_DEVIATION = Quantity("standard deviation of the delay", "s", 0.0, MOST, above=0.0)
_LOW = Quantity("least delay", "s", 0.0, MOST, default=0.0)

Params = Mapping[str, float]


class Distribution(NamedTuple):
    """What a distribution takes, and its quantiles (s)."""

    meaning: str
    parameters: Mapping[str, Quantity]
    needed: tuple[str, ...]
    quantiles: Callable[[np.ndarray, Params], np.ndarray]
    fault: Callable[[Params], str | None] = lambda p: None


def _uniform(q: np.ndarray, p: Params) -> np.ndarray:
    return p["low"] + (p["high"] - p["low"]) * q


def _exponential(q: np.ndarray, p: Params) -> np.ndarray:
    return p["low"] - (p["mean"] - p["low"]) * np.log1p(-q)


def _gamma(q: np.ndarray, p: Params) -> np.ndarray:
    with needed_for("a gamma distribution"):
        from scipy.special import gammaincinv
    over = p["mean"] - p["low"]
    return p["low"] + p["deviation"] ** 2 / over * gammaincinv((over / p["deviation"]) ** 2, q)


def _normal(q: np.ndarray, p: Params) -> np.ndarray:
    with needed_for("a normal distribution"):
        from scipy.special import ndtr, ndtri
    cut = ndtr((p["low"] - p["mean"]) / p["deviation"])
    return np.maximum(p["low"], p["mean"] + p["deviation"] * ndtri(cut + (1.0 - cut) * q))


def _mean_above_low(p: Params) -> str | None:
    return None if p["mean"] > p["low"] else f"mean = {p['mean']:g} s must be more than low = {p['low']:g} s"


DISTRIBUTIONS: Mapping[str, Distribution] = {
    "constant": Distribution(
        "the same delay every time",
        {"delay": Quantity("the delay", "s", 0.0, MOST)},
        ("delay",),
        lambda q, p: np.full(len(q), p["delay"]),
    ),
    "uniform": Distribution(
        "any delay between two bounds is as likely as any other",
        {"low": _LOW, "high": Quantity("greatest delay", "s", 0.0, MOST)},
        ("high",),
        _uniform,
        lambda p: None if p["high"] >= p["low"] else f"high = {p['high']:g} s must be at least low = {p['low']:g} s",
    ),
    "exponential": Distribution(
        "a least delay and an exponential tail", {"mean": _MEAN, "low": _LOW}, ("mean",), _exponential, _mean_above_low
    ),
    "gamma": Distribution(
        "a least delay, and the sum of many small waits over it",
        {"mean": _MEAN, "deviation": _DEVIATION, "low": _LOW},
        ("mean", "deviation"),
        _gamma,
        _mean_above_low,
    ),
    "normal": Distribution(
        "a normal distribution, cut off below the least delay",
        {"mean": _MEAN, "deviation": _DEVIATION, "low": _LOW},
        ("mean", "deviation"),
        _normal,
    ),
}


def checked_params(kind: str, given: Mapping[str, float | None]) -> dict[str, float]:
    """The parameters of the distribution `kind` with their defaults; InputError if they do not go together."""
    distribution = DISTRIBUTIONS[kind]
    params = {
        name: float(quantity.default or 0.0) if given.get(name) is None else quantity.check(given[name], name, kind)
        for name, quantity in distribution.parameters.items()
    }
    if fault := distribution.fault(params):
        raise InputError(fault)
    return params
