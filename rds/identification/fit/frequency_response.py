"""The frequency response of an axis or spindle from a log, with coherence and confidence.

The output is the mean velocity over each sample (a spindle's speed at it), so that nothing drifts, and the command is
held over that same sample.

A command that repeats is averaged over its periods, whole ones, the first left out: then nothing leaks from one
frequency into another, what is not repeated is noise, and its size is seen. The encoder's rounding may repeat, too:
what the noise that is seen lacks of its variance q²/12 is added, and not averaged. Any other command (a chirp) goes by
Welch's method: H₁ = S_uy / S_uu over Hann windows that overlap by half. The coherence γ² = |S_uy|²/(S_uu S_yy) is the
share of the output's power that follows the command linearly; from n averages H has the variance
|H|² (1 - γ²) / (γ² n). What the windows themselves distort is not in it (`window_distortion`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.identification.logs.log import Log, check_regular, only_log

_REPEATS = 1e-6  # of the command's range: how exactly a period comes back
_EXCITED = 0.01  # of the largest amplitude: which lines count as excited
_HIGHEST = 0.8  # of half the sampling frequency
_COHERENT = 0.5  # by Welch's method: lines with less say nothing
_SEGMENTS = 8  # windows side by side (with overlap nearly twice as many)
_NEIGHBOURS = 4  # lines to each side over which the noise is taken to be the same


@dataclass(frozen=True)
class FrequencyResponse:
    """Arrays over the lines (n,): output over command, (mm/s)/V or (rev/min)/V, complex, and how far to trust it."""

    frequency: np.ndarray  # Hz
    response: np.ndarray
    coherence: np.ndarray  # 0 to 1
    std_error: np.ndarray  # of the real and of the imaginary part each
    sample_period: float  # s
    averages: float  # periods, or windows (overlapping ones count as fewer)
    period: float | None  # s; None: by Welch's method

    def __repr__(self) -> str:
        how = f"averaged over {self.averages:.3g} periods" if self.period is not None else "by Welch's method"
        span = f"{self.frequency[0]:.3g} to {self.frequency[-1]:.3g} Hz" if len(self.frequency) else "none"
        return f"<FrequencyResponse: {len(self.frequency)} lines, {span}, {how}>"

    @property
    def magnitude_band(self) -> tuple[np.ndarray, np.ndarray]:
        """95 % band of the magnitude, to first order."""
        reach = 1.96 * self.std_error
        size = np.abs(self.response)
        return np.maximum(size - reach, 0.0), size + reach

    @property
    def phase(self) -> np.ndarray:
        """Degrees, unwrapped over the lines."""
        return np.rad2deg(np.unwrap(np.angle(self.response)))

    @property
    def phase_error(self) -> np.ndarray:
        """Half the 95 % band of the phase, degrees."""
        return np.minimum(np.rad2deg(1.96 * self.std_error / np.maximum(np.abs(self.response), 1e-300)), 180.0)


def output_rate(log: Log, is_rate: bool) -> tuple[np.ndarray, np.ndarray]:
    """The command (V) and the output it is compared with, (samples,): mean velocity over each sample, or the speed."""
    if is_rate:
        return log.command, log.position
    return log.command[:-1], np.diff(log.position) / log.sample_period


def frequency_response(log: Log, is_rate: bool | None = None, period: float | None = None) -> FrequencyResponse:
    """The response of the log's output to its command; `period` (s) if it is known that the command repeats.

    `is_rate` says whether the output is a speed; None: as the log says.

    InputError for a command that excites no frequency, or irregular times.
    """
    log = only_log(log)
    T = log.sample_period
    check_regular(log, "a frequency response")
    u, y = output_rate(log, log.is_rate if is_rate is None else is_rate)
    if not np.ptp(u) > 0.0:
        raise InputError(f"the command is {u[0]:g} throughout: it excites no frequency", log.name)
    if not np.ptp(y) > 0.0:
        raise InputError("the output never changes: there is no response; log a motion of the axis", log.name)
    length = _given_period(log, period, len(u)) if period is not None else find_period(u)
    if length is not None:
        return _averaged(u, y, length, T, log.resolution or 0.0, len(y) == len(log))
    return _welch(u, y, T)


def find_period(u: np.ndarray) -> int | None:
    """Samples after which `u` repeats; None if it does not, at least twice."""
    n = len(u)
    x = u - u.mean()
    size = 1 << (2 * n - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[:n]
    squares = np.concatenate([[0.0], np.cumsum(x**2)])
    lags = np.arange(2, n // 2 + 1)
    distance = squares[n - lags] + (squares[n] - squares[lags]) - 2.0 * products[lags]
    scale = float(np.ptp(u))
    near = lags[distance < (_REPEATS * scale) ** 2 * n + 1e-11 * squares[n]]
    for lag in near[:200]:
        if np.abs(u[lag:] - u[:-lag]).max() <= _REPEATS * scale:
            return int(lag)
    return None


def model_response(frequency: np.ndarray, T: float, values: Mapping[str, float], is_rate: bool) -> np.ndarray:
    """The model's response at `frequency` (Hz), sampled every `T` s as a `FrequencyResponse` is."""
    tau, K, delay = values["tau"], values["K"], values.get("delay", 0.0)
    whole = np.floor(delay / T)
    part = delay / T - whole
    h = (1.0 - part) * T
    z = np.exp(2j * np.pi * frequency * T)
    a, a_h = np.exp(-T / tau), np.exp(-h / tau)
    speed = K * z**-whole * ((1.0 - a_h) + (a_h - a) / z) / (z - a)
    if is_rate:
        return np.asarray(speed)
    way = K * z**-whole * (h + part * T / z) - tau * (z - 1.0) * speed
    return np.asarray(way / T)


def _given_period(log: Log, period: float, samples: int) -> int:
    length = period / log.sample_period
    if not isfinite(length) or abs(length - round(length)) > 1e-3 or not 2 <= round(length) <= samples // 2:
        raise InputError(
            f"frequency: period = {period:g} s is {length:.6g} samples; it must be a whole number of them, 2 or more, "
            f"and fit twice into the log's {samples}",
            log.name,
        )
    return round(length)


def _averaged(
    u: np.ndarray, y: np.ndarray, length: int, T: float, resolution: float, is_rate: bool
) -> FrequencyResponse:
    periods = len(u) // length
    skip = 1 if periods >= 3 else 0
    shape = (periods - skip, length)
    chosen = slice(skip * length, periods * length)
    U = np.fft.rfft(u[chosen].reshape(shape), axis=1)
    Y = np.fft.rfft(y[chosen].reshape(shape), axis=1)
    frequency = np.fft.rfftfreq(length, T)
    size = np.abs(U.mean(axis=0))
    band = (frequency > 0.0) & (frequency <= _HIGHEST * 0.5 / T)
    excited = band & (size > _EXCITED * size[1:].max())
    if not excited.any():
        raise InputError(
            f"the command excites no frequency up to {_HIGHEST * 0.5 / T:.4g} Hz ({_HIGHEST:.0%} of half the sampling "
            "frequency); log a slower one, such as a multisine"
        )
    count = periods - skip
    H = Y[:, excited].mean(axis=0) / U[:, excited].mean(axis=0)
    noise = Y[:, excited] - H * U[:, excited]
    power = _smooth((np.abs(noise) ** 2).sum(axis=0) / max(count - 1, 1))
    slope = 1.0 if is_rate else 2.0 * np.sin(np.pi * frequency[excited] * T) / T  # of a position, to its difference
    rounded = length * resolution**2 / 12.0 * slope**2
    variance = (power / count + np.maximum(rounded - power, 0.0)) / size[excited] ** 2
    total = (np.abs(Y[:, excited]) ** 2).mean(axis=0)
    coherence = np.abs((Y[:, excited] * U[:, excited].conj()).mean(axis=0)) ** 2 / (
        total * (np.abs(U[:, excited]) ** 2).mean(axis=0)
    )
    return FrequencyResponse(frequency[excited], H, coherence, np.sqrt(0.5 * variance), T, float(count), length * T)


def _smooth(values: np.ndarray) -> np.ndarray:
    """Means over neighbouring lines: from few periods, one line alone says little of its noise."""
    width = min(2 * _NEIGHBOURS + 1, len(values))
    kernel = np.ones(width)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")


def window_distortion(log: Log, response: FrequencyResponse, values: Mapping[str, float], is_rate: bool) -> np.ndarray:
    """What the windows of Welch's method make of the model's response, over it; 1 where periods are averaged.

    Where the command changes within a window, as a chirp does, the answer comes when the window weighs otherwise. That
    is several per cent at the first and last lines of a chirp, and no coherence shows it; so the model is sent through
    the same windows.
    """
    if response.period is not None:
        return np.ones(len(response.frequency))
    u, y = output_rate(log, is_rate)
    frequency, s_uu, _, s_uy = _spectra(u, model_rate(u, y, log.sample_period, values, is_rate), log.sample_period)
    at = np.searchsorted(frequency, response.frequency - 0.5 * frequency[1])
    seen = s_uy[at] / s_uu[at]
    return np.asarray(seen / model_response(response.frequency, log.sample_period, values, is_rate))


def model_rate(u: np.ndarray, y: np.ndarray, T: float, values: Mapping[str, float], is_rate: bool) -> np.ndarray:
    """The model's output rate (`model_response` over time), from the speed that the log begins with."""
    with needed_for("a frequency response"):
        from scipy.signal import lfilter

    tau, K, delay = values["tau"], values["K"], values.get("delay", 0.0)
    whole = min(int(delay // T), len(u) - 1)
    part = delay / T - whole
    h = (1.0 - part) * T
    a, a_h = np.exp(-T / tau), np.exp(-h / tau)
    late = np.concatenate([np.full(whole + 1, u[0]), u])[: len(u) + 1]
    newer, older = late[1:], late[:-1]  # of the two commands that act within a sample
    begin = float(np.mean(y[:5])) + K * float(np.mean(u)) - float(np.mean(y))  # friction is in the mean
    speed = lfilter([1.0], [1.0, -a], np.concatenate([[begin], K * ((1.0 - a_h) * newer + (a_h - a) * older)]))
    if is_rate:
        return np.asarray(speed[:-1])
    return np.asarray(K * (h * newer + part * T * older) - tau * np.diff(speed)) / T


def _spectra(u: np.ndarray, y: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies (Hz), and the spectra of `u`, of `y` and across, by Welch's method."""
    with needed_for("a frequency response"):
        from scipy.signal import csd, welch

    length = len(u) // _SEGMENTS
    settings: dict[str, Any] = {"fs": 1.0 / T, "window": "hann", "nperseg": length, "detrend": "linear"}
    frequency, s_uu = welch(u, **settings)
    return frequency, s_uu, welch(y, **settings)[1], csd(u, y, **settings)[1]


def _welch(u: np.ndarray, y: np.ndarray, T: float) -> FrequencyResponse:
    length = len(u) // _SEGMENTS
    if length < 32:
        raise InputError(f"{len(u)} samples are too few for a frequency response; it takes {32 * _SEGMENTS} or more")
    frequency, s_uu, s_yy, s_uy = _spectra(u, y, T)
    windows = (len(u) - length) // (length - length // 2) + 1
    averages = windows * 0.95 if windows < 3 else 9.0 * windows / 11.0  # Hann, half overlap (Welch 1967)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(s_uy) ** 2 / (s_uu * s_yy))
    band = (frequency >= 2.0 / (length * T)) & (frequency <= _HIGHEST * 0.5 / T)
    if not band.any():
        raise InputError("the log is too short for a frequency response")
    kept = band & (s_uu > _EXCITED**2 * s_uu[band].max()) & (coherence > _COHERENT)
    H = s_uy[kept] / s_uu[kept]
    share = np.clip(coherence[kept], 1e-6, 1.0 - 1e-12)
    variance = np.abs(H) ** 2 * (1.0 - share) / (share * averages)
    return FrequencyResponse(frequency[kept], H, coherence[kept], np.sqrt(0.5 * variance), T, averages, None)
