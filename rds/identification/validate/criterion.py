"""Several models on one data set: which does the data prefer, after what each paid in parameters?

With Gaussian errors of unknown variance, N samples, sum of squares S and k estimated numbers:

    AICc = N ln(S/N) + 2k + 2k (k + 1) / (N - k - 1)        (Hurvich and Tsai, 1989)
    BIC  = N ln(S/N) + k ln N                               (Schwarz, 1978)

Both assume independent errors. A position sampled at 1 kHz has far fewer, and N taken as it is would make every weight
0 or 1. So N is the number of independent samples that the residuals are worth, of the model with the smallest sum of
squares. The price for parameters is owed where they were fitted to these data; on others nothing was adjusted, and k is
counted as 0, but for the variance and the initial state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf, isfinite, log

import numpy as np

from rds.core.errors import InputError
from rds.identification.fit.residuals import effective_samples


@dataclass(frozen=True)
class Rival:
    """A model's residuals over the common samples, (samples,), and what was estimated from these very data."""

    name: str
    residual: np.ndarray
    parameters: int  # estimated, wherever
    states: int  # initial states, estimated from these data
    fitted_here: bool


@dataclass(frozen=True)
class Rank:
    """A row of the table; `aicc_difference` and `bic_difference` are from the smallest, weights sum to 1."""

    name: str
    counted: int  # k
    fitted_here: bool
    rmse: float
    aicc: float
    aicc_difference: float
    aicc_weight: float
    bic: float
    bic_difference: float
    bic_weight: float


@dataclass(frozen=True)
class Ranking:
    """The models in order of AICc, on `samples` samples that are worth `independent`."""

    ranks: tuple[Rank, ...]
    samples: int
    independent: float
    warnings: tuple[str, ...]


def rank(rivals: Sequence[Rival]) -> Ranking:
    """Rank the models by their residuals on the same samples. InputError for fewer than two, or different samples."""
    if len(rivals) < 2:
        raise InputError("a comparison needs two models or more")
    samples = len(rivals[0].residual)
    if any(len(rival.residual) != samples for rival in rivals):
        raise InputError("models are compared on the same samples only")
    sums = [_sum(rival.residual) for rival in rivals]
    if not np.isfinite(min(sums)):
        raise InputError("none of the models has a finite response to these commands; there is nothing to compare")
    best = rivals[int(np.argmin(sums))]
    N = effective_samples(best.residual)
    counted = [1 + rival.states + (rival.parameters if rival.fitted_here else 0) for rival in rivals]
    aicc = [_aicc(s / samples, k, N) for s, k in zip(sums, counted, strict=True)]
    bic = [_loss(s / samples, N) + k * log(N) if s < inf else inf for s, k in zip(sums, counted, strict=True)]
    weights = _weights(aicc), _weights(bic)
    rows = [
        Rank(
            name=rival.name,
            counted=counted[i],
            fitted_here=rival.fitted_here,
            rmse=float(np.sqrt(sums[i] / samples)),
            aicc=aicc[i],
            aicc_difference=_difference(aicc, i),
            aicc_weight=weights[0][i],
            bic=bic[i],
            bic_difference=_difference(bic, i),
            bic_weight=weights[1][i],
        )
        for i, rival in enumerate(rivals)
    ]
    rows.sort(key=lambda row: (row.aicc, row.rmse))
    return Ranking(tuple(rows), samples, N, _warnings(rivals, counted, N))


def _warnings(rivals: Sequence[Rival], counted: Sequence[int], N: float) -> tuple[str, ...]:
    here = [rival.name for rival in rivals if rival.fitted_here]
    said = []
    if here and len(here) < len(rivals):
        others = [rival.name for rival in rivals if not rival.fitted_here]
        said.append(
            f"{', '.join(here)} {_was(here)} fitted on these data and {', '.join(others)} {_was(others)} not: the "
            "comparison favours the former, whatever the criterion charges for parameters"
        )
    elif here:
        said.append(
            "all models were fitted on these data: the criteria charge for their parameters, but only new data show "
            "what they predict"
        )
    if max(counted) + 2 > N:
        said.append(
            f"the residuals are worth {N:.3g} independent samples only, fewer than AICc needs for "
            f"{max(counted)} estimated numbers: a longer log is needed to choose between the models"
        )
    return tuple(said)


def _was(names: Sequence[str]) -> str:
    return "was" if len(names) == 1 else "were"


def _sum(residual: np.ndarray) -> float:
    with np.errstate(all="ignore"):
        total = float(np.sum(residual**2))
    return total if np.isfinite(total) else inf


def _loss(mean_square: float, N: float) -> float:
    return N * log(max(mean_square, 1e-300))


def _aicc(mean_square: float, k: int, N: float) -> float:
    if not mean_square < inf or k + 1 >= N:
        return inf
    return _loss(mean_square, N) + 2.0 * k + 2.0 * k * (k + 1) / (N - k - 1)


def _difference(values: Sequence[float], at: int) -> float:
    lowest = min(values)
    return values[at] - lowest if lowest < inf else inf


def _weights(values: Sequence[float]) -> list[float]:
    lowest = min(values)
    if not lowest < inf:
        return [float("nan")] * len(values)
    sizes = [exp(-0.5 * (value - lowest)) if value < inf else 0.0 for value in values]
    return [size / sum(sizes) for size in sizes]


def known(value: float) -> float | None:
    """None for a figure that too short a log, or a response that is not finite, leaves undefined."""
    return value if isfinite(value) else None
