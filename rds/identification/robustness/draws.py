"""Parameters drawn for one axis: from the confidence region of a fit, or from given ranges. Each from its own seed.

From a fit: the normal distribution of the estimate, N(θ̂, Σ), kept within its confidence region (θ - θ̂)ᵀ Σ⁻¹ (θ - θ̂)
<= χ²_p(level), p being the number of parameters that have a variance, and within what is physically possible; what
falls outside is drawn again. Σ is the fit's covariance, widened to its intervals (`uncertain`). From ranges: uniform
and independent. Draw k of a seed is always the same, however many are drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

LEVEL = 0.95  # of the confidence region
_TRIES = 1000  # to fall within what is possible


@dataclass(frozen=True)
class Spread:
    """What an axis's parameters may be. `covariance` and the bounds are in the order of `names`; units in `units`."""

    names: tuple[str, ...]
    values: np.ndarray  # nominal
    units: Mapping[str, str]
    covariance: np.ndarray | None = None
    low: np.ndarray = field(default_factory=lambda: np.empty(0))  # of what is possible, or of the ranges
    high: np.ndarray = field(default_factory=lambda: np.empty(0))
    level: float = LEVEL
    where: str = ""  # the file that says so

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameters that are not the same in every draw."""
        wide = self.high > self.low if self.covariance is None else np.diag(self.covariance) > 0.0
        return tuple(name for name, is_varied in zip(self.names, wide, strict=True) if is_varied)


def draws(spread: Spread, seed: int, first: int, end: int) -> np.ndarray:
    """Draws number `first` to before `end` of `seed`: (draws, parameters)."""
    if spread.covariance is None:
        width = spread.high - spread.low
        return np.array(
            [spread.low + width * _generator(seed, k).random(len(width)) for k in range(first, end)]
        ).reshape(end - first, len(width))
    factor, squares = _factor(spread)
    return np.array([_normal(spread, factor, squares, _generator(seed, k)) for k in range(first, end)]).reshape(
        end - first, len(spread.names)
    )


def _generator(seed: int, k: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, k])))


def _factor(spread: Spread) -> tuple[np.ndarray, float]:
    """F with Σ = F Fᵀ, one column for each direction that has a variance, and the region's square radius."""
    with needed_for("drawing from a model's region"):
        from scipy.special import gammaincinv

    covariance = spread.covariance
    assert covariance is not None
    scale = np.sqrt(np.diag(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    size, directions = np.linalg.eigh(covariance / np.outer(safe, safe))
    if size.min() < -1e-6 * max(size.max(), 1e-300):
        raise InputError("the covariance has a negative eigenvalue; fit the model again with `rds fit`", spread.where)
    used = size > 1e-12 * max(size.max(), 1e-300)
    factor = safe[:, None] * directions[:, used] * np.sqrt(size[used])
    return factor, float(2.0 * gammaincinv(0.5 * used.sum(), spread.level))


def _normal(spread: Spread, factor: np.ndarray, squares: float, generator: np.random.Generator) -> np.ndarray:
    for _ in range(_TRIES):
        z = generator.standard_normal(factor.shape[1])
        if float(np.dot(z, z)) <= squares:
            drawn = np.asarray(spread.values + factor @ z)
            if (drawn >= spread.low).all() and (drawn <= spread.high).all():
                return drawn
    raise InputError(
        f"of {_TRIES} draws none is physically possible: the standard errors are too large for a study; fit with more "
        "excitation, or give ranges",
        spread.where,
    )


def check_covariance(spread: Spread, file: Any) -> None:
    """InputError for a fit that gives no spread, or parameters that its data could not tell."""
    assert spread.covariance is not None
    if not (np.diag(spread.covariance) > 0.0).any():
        raise InputError("the model file has no covariance; fit it, or give ranges (--ranges)", file.path)
    for name, variance in zip(spread.names, np.diag(spread.covariance), strict=True):
        if not np.isfinite(variance):
            raise InputError(f"{name} could not be told from its data; give ranges (--ranges), or fit again", file.path)
