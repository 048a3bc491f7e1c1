"""What a model leaves unexplained: is it noise, or does it still follow from the command or from itself?

Residuals are tested at the rate of the motion, not of the sampling: at 1 kHz an axis that is slow, or at rest for a
while, keeps its encoder's rounding error over many samples, and fails by that alone. So residuals and commands are
averaged over blocks (a quarter of the period of the frequency below which 99 % of the motion's power lies), and the
statistics are compared with those of surrogates: the model's own output with parameters drawn from the fit's
covariance, white noise of the residual's size, and the encoder's rounding. A model that is exact fails at 1 % in one of
a hundred logs, however coarse the encoder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

LAGS = 25
BAND = 2.58  # standard deviations: 99 %
_SURROGATES = 299
_LEAST_BLOCKS = 100
LONGEST = 200_000  # samples that are tested


@dataclass(frozen=True)
class Correlation:
    """Normalized correlations at `lags` (s), the 99 % band ±`band`, and the share of them outside it."""

    lags: np.ndarray
    values: np.ndarray
    band: float

    @property
    def outside(self) -> float:
        """The share of lags (without lag 0 of an autocorrelation) beyond the band; 1 % is expected of noise."""
        return float(np.mean(np.abs(self.values) > self.band)) if len(self.values) else 0.0

    @property
    def largest(self) -> tuple[float, float]:
        """The correlation of largest size, and its lag in s."""
        at = int(np.argmax(np.abs(self.values)))
        return float(self.values[at]), float(self.lags[at])


@dataclass(frozen=True)
class ResidualTest:
    """Whiteness of the residual and its independence of the command.

    `p_white` and `p_command` are the shares of surrogates whose statistic is at least as large as the measured one
    (Ljung and Box's over `LAGS` lags; the largest correlation with the command).
    """

    block: int  # samples that were averaged
    blocks: int
    bandwidth: float  # Hz, below which 99 % of the motion's power lies
    auto: Correlation
    cross: Correlation  # positive lag: the residual after the command
    p_white: float
    p_command: float
    surrogates: int
    samples: int  # that were tested


def bandwidth(rate: np.ndarray, T: float, share: float = 0.99) -> float:
    """The frequency in Hz below which `share` of the power of `rate` lies; 0 for a signal that is constant.

    Of a long one, the power is summed over parts: a transform of all of it takes 20 times its memory.
    """
    length, mean = min(len(rate), LONGEST), rate.mean()
    power = np.zeros(length // 2 + 1)
    for first in range(0, len(rate) - length + 1, length):
        power += np.abs(np.fft.rfft(rate[first : first + length] - mean)) ** 2
    total = float(power.sum())
    if not total > 0.0:
        return 0.0
    return float(np.fft.rfftfreq(length, T)[int(np.searchsorted(np.cumsum(power), share * total))])


def block_length(frequency: float, T: float, samples: int) -> int:
    """Samples to average for motion up to `frequency` Hz; of a short log fewer, so that 100 blocks are left."""
    wanted = round(1.0 / (4.0 * frequency * T)) if frequency > 0.0 else samples
    return int(max(1, min(wanted, samples // _LEAST_BLOCKS)))


def block_means(values: np.ndarray, block: int) -> np.ndarray:
    """Means over blocks along the last axis; a rest that fills no block is left out."""
    count = values.shape[-1] // block
    return values[..., : count * block].reshape(*values.shape[:-1], count, block).mean(axis=-1)


def residual_tests(
    residual: np.ndarray,
    command: np.ndarray,
    modelled: np.ndarray,
    T: float,
    *,
    frequency: float,
    resolution: float | None = None,
    sensitivities: np.ndarray | None = None,
    covariance: np.ndarray | None = None,
    seed: int = 0,
) -> ResidualTest:
    """Test `residual` = measured - `modelled` (samples,) against `command`, sampled every `T` s.

    `frequency` is the motion's bandwidth in Hz, `resolution` the encoder's step in the residual's unit (None: fine);
    `sensitivities` (samples, parameters) with `covariance` say how uncertain the modelled output is.
    """
    use = slice(0, min(len(residual), LONGEST))
    residual, command, modelled = residual[use], command[use], modelled[use]
    block = block_length(frequency, T, len(residual))
    spread = _parameter_spread(sensitivities, covariance, use)
    e, u = block_means(residual - residual.mean(), block), block_means(command, block)
    lags, driven = min(LAGS, len(e) // 4), _transformed(u - u.mean() if len(u) else u)
    r, c = _correlations(e, driven, lags)
    q, largest = _portmanteau(r, len(e)), float(np.abs(c).max(initial=0.0))
    more_q = more_c = 0
    draw = np.random.default_rng(seed)
    noise = _noise(residual, resolution, spread)
    for _ in range(_SURROGATES):
        surrogate = _surrogate(modelled, noise, resolution, spread, draw)
        s = block_means(surrogate - surrogate.mean(), block)
        of_itself, of_command = _correlations(s, driven, lags)
        more_q += _portmanteau(of_itself, len(s)) >= q
        more_c += float(np.abs(of_command).max(initial=0.0)) >= largest
    step = block * T
    band = BAND / np.sqrt(max(len(e), 1))
    return ResidualTest(
        block=block,
        blocks=len(e),
        bandwidth=frequency,
        auto=Correlation(np.arange(1, lags + 1) * step, r, band),
        cross=Correlation(np.arange(-lags, lags + 1) * step, c, band),
        p_white=(1 + more_q) / (1 + _SURROGATES),
        p_command=(1 + more_c) / (1 + _SURROGATES),
        surrogates=_SURROGATES,
        samples=len(residual),
    )


def effective_samples(residual: np.ndarray) -> float:
    """How many independent samples a correlated residual is worth: N / (1 + 2 Σ ρ), summed while ρ is positive."""
    e = residual - residual.mean()
    n = len(e)
    power = np.abs(np.fft.rfft(e, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n]
    if not correlation[0] > 0.0:
        return float(n)
    rho = correlation[1:] / correlation[0]
    ends = np.flatnonzero(rho <= 0.0)
    return float(max(n / (1.0 + 2.0 * rho[: ends[0] if len(ends) else len(rho)].sum()), 1.0))


def _parameter_spread(sensitivities: np.ndarray | None, covariance: np.ndarray | None, use: slice) -> np.ndarray | None:
    """Sensitivities times a root of the covariance: what a standard normal draw makes of the output, mm."""
    if sensitivities is None or covariance is None or not np.isfinite(covariance).all():
        return None
    size, vectors = np.linalg.eigh(covariance)
    spread = sensitivities[use] @ (vectors * np.sqrt(np.maximum(size, 0.0)))
    return spread if np.isfinite(spread).all() else None


def _noise(residual: np.ndarray, resolution: float | None, spread: np.ndarray | None) -> float:
    """The standard deviation of white noise that, with rounding and parameters, makes up the residual's size."""
    explained = (resolution or 0.0) ** 2 / 12.0
    if spread is not None:
        explained += float(np.sum(spread.var(axis=0)))
    return float(np.sqrt(max(float(residual.var()) - explained, 0.0)))


def _surrogate(
    modelled: np.ndarray,
    noise: float,
    resolution: float | None,
    spread: np.ndarray | None,
    draw: np.random.Generator,
) -> np.ndarray:
    true = modelled + noise * draw.standard_normal(len(modelled)) if noise > 0.0 else modelled.copy()
    if spread is not None:
        true += spread @ draw.standard_normal(spread.shape[1])
    if resolution:
        zero = draw.random() * resolution  # where on the encoder's grid the log began is chance
        true = np.rint((true + zero) / resolution) * resolution - zero
    return true - modelled


def _correlations(e: np.ndarray, u: _Transformed, lags: int) -> tuple[np.ndarray, np.ndarray]:
    """Autocorrelation at lags 1 to `lags`, and the correlation with the command `lag` blocks before, from -lags to
    lags; zeros for a residual or a command that is constant.
    """
    auto, cross = np.zeros(lags), np.zeros(2 * lags + 1)
    own = _transformed(e)
    if own.power > 0.0:
        auto = own.products(own)[1 : lags + 1] / own.power
    size = float(np.sqrt(own.power * u.power))
    if size > 0.0:
        products = own.products(u)
        cross = np.concatenate([products[len(products) - lags :], products[: lags + 1]]) / size
    return auto, cross


class _Transformed(NamedTuple):
    """Values as their Fourier transform, padded by zeros to `size`, and the sum of their squares."""

    transform: np.ndarray
    conjugate: np.ndarray
    size: int
    power: float

    def products(self, other: _Transformed) -> np.ndarray:
        """The sums over k of a[k + lag] b[k], at index `lag`; negative lags count from the end."""
        return np.fft.irfft(self.transform * other.conjugate, self.size)


def _transformed(values: np.ndarray) -> _Transformed:
    size = 2 ** int(2 * len(values) - 1).bit_length()
    transform = np.fft.rfft(values, size)
    return _Transformed(transform, np.conj(transform), size, float(np.sum(values**2)))


def _portmanteau(r: np.ndarray, n: int) -> float:
    """Ljung and Box's Q: n (n + 2) Σ r_k² / (n - k)."""
    k = np.arange(1, len(r) + 1)
    return float(n * (n + 2) * np.sum(r**2 / (n - k))) if len(r) else 0.0
