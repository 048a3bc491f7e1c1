"""Margins and poles of the sampled loop, linearized about rest, for many axes at once.

The axis without friction and play is τ ẍ + ẋ = K u, held over each sample and delayed by n samples and a rest f:

    x_{k+1} = A x_k + Γ₁ u_{k-n-1} + Γ₀ u_{k-n}        (exact)

A library law is linear between its limits; its matrices come from the law itself, by steps of its arguments about
rest. A law that does not answer in proportion has no linear loop, and gets no margins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.linear_law import Law, linear_law
from rds.core.types import Controller, Model
from rds.models.machine_model import MachineAxisMotion, linear_part, split_delay

_GRID = 1440  # frequencies, logarithmic up to Nyquist's
_DECADES = 9.0  # of them: an axis of seconds that is sampled every 50 µs crosses 1 at a millionth of Nyquist's
_PER_WAIT = 40  # frequencies, evenly spaced, for each sample of delay, which turns the loop by half a lap
_STEP = 16  # samples: loops whose delays are that near share their frequencies
_AT_ONCE = 720_000  # points of loops
_REAL = 1e-6  # imaginary part of a loop at Nyquist's frequency, where rounding alone leaves one
_LARGEST_DELAY = 200  # samples: beyond, no poles are computed


def law_about_rest(controller: Controller | None) -> Law | None:
    """`linear_law` of a controller; None if it is not linear about rest, and has no margins."""
    if controller is None:
        return None
    try:
        return linear_law(controller)
    except Exception:  # a student's law on a state that it never meets
        return None


def loop_margins(law: Law, models: Sequence[Model], T: float) -> np.ndarray:
    """`figures.MARGINS` of each loop: (models, 4). Margins of an unstable loop, or of no linear axis, are NaN."""
    rows = np.full((len(models), 4), np.nan)
    parts = [_axis(model, T) for model in models]
    known = [k for k, part in enumerate(parts) if part is not None]
    if not known:
        return rows
    axes = np.array([parts[k] for k in known])  # tau, K, whole, rest
    rows[known, 3] = _pole_radius(law, axes, T)
    waits = _STEP * np.ceil((axes[:, 2] + len(law.G)) / _STEP)  # each loop by itself, whatever the others' delays
    for wait in np.unique(waits):
        w = grid(T, int(wait))
        alike = np.flatnonzero(waits == wait)
        loops = max(_AT_ONCE // len(w), 1)
        for begin in range(0, len(alike), loops):
            some = alike[begin : begin + loops]
            at = np.array(known)[some]
            found = margins_of(w, _loop(law, axes[some], w, T))
            rows[at, :3] = np.where(rows[at, 3:] < 1.0, found, np.nan)
    return rows


def grid(T: float, waits: int) -> np.ndarray:
    """Frequencies (rad/s) at which margins are looked for, in a loop in which values wait for `waits` samples."""
    even = np.linspace(0.0, 1.0, _PER_WAIT * min(waits, 2 * _LARGEST_DELAY) + 1)[1:]
    found: np.ndarray = np.pi / T * np.union1d(np.logspace(-_DECADES, 0.0, _GRID), even)
    return found


def open_loop(law: Law, model: Model, T: float, w: np.ndarray) -> np.ndarray:
    """-C(z) P(z) of one loop at the frequencies `w` (rad/s), complex: what Bode and Nyquist draw.

    Raises InputError for a model that has no linear axis in it.
    """
    return _loop(law, np.array([_known(model, T)]), w, T)[0]


def closed_poles(law: Law, models: Sequence[Model], T: float) -> np.ndarray:
    """The poles z of each sampled loop: (models, poles), as many as the loop with the longest delay has, else NaN.

    Raises InputError for a model that has no linear axis in it, or a delay of more than `_LARGEST_DELAY` samples.
    """
    axes = np.array([_known(model, T) for model in models])
    if axes[:, 2].max() > _LARGEST_DELAY:
        raise InputError(f"the delay is more than {_LARGEST_DELAY} samples of {T:g} s; choose a longer sample period")
    found = np.full((len(axes), 3 + int(axes[:, 2].max()) + len(law.G)), np.nan, dtype=complex)
    for whole in np.unique(axes[:, 2]):
        chosen = axes[:, 2] == whole
        poles = np.linalg.eigvals(_closed(law, axes[chosen], int(whole), T))
        found[chosen, : poles.shape[1]] = poles
    return found


def _known(model: Model, T: float) -> tuple[float, float, int, float]:
    part = _axis(model, T)
    if part is None:
        raise InputError(f"the model {model.source.name!r} has no linear axis whose loop could be shown")
    return part


def _axis(model: Model, T: float) -> tuple[float, float, int, float] | None:
    params: Mapping[str, Any] = model.params
    if model.motion is MachineAxisMotion:
        part = linear_part(params)
        return part["tau"], part["K"], *split_delay(params["delay"], T)
    if model.source.name == "linear-axis":
        return params["tau"], params["K"], 0, 0.0
    return None


def _held(axes: np.ndarray, T: float) -> tuple[np.ndarray, ...]:
    """a₁₂, a₂₂ of A = [[1, a₁₂], [0, a₂₂]], and Γ₀ and Γ₁, for each axis."""
    tau, K, _, rest = axes.T
    gone, late = -np.expm1(-T / tau), -np.expm1(-(T - rest) / tau)
    now = np.array([K * (T - rest - tau * late), K * late])
    early = -np.expm1(-rest / tau)
    first = np.array([K * (rest - tau * early), K * early])  # over the rest, then moved on by T - rest
    before = np.array([first[0] + tau * late * first[1], (1.0 - late) * first[1]])
    return tau * gone, 1.0 - gone, now, before


def _loop(law: Law, axes: np.ndarray, w: np.ndarray, T: float) -> np.ndarray:
    """-C(z) P(z) on the unit circle: (axes, frequencies)."""
    z = np.exp(1j * w * T)
    a12, a22, now, before = (part[..., None] for part in _held(axes, T))
    inputs = now + before / z  # (2, axes, frequencies)
    speed = inputs[1] / (z - a22)
    plant = (inputs[0] + a12 * speed) / (z - 1.0) * z ** -axes[:, 2:3]
    return -law_response(law, z) * plant


def law_response(law: Law, z: np.ndarray) -> np.ndarray:
    """u/y of a law at points of the z-plane, complex: H (z - F)⁻¹ G + D, by F's triangular form."""
    if not len(law.G):
        return np.full(len(z), law.D, dtype=complex)
    with needed_for("margins"):
        from scipy.linalg import schur

    triangle, turned = schur(law.F, output="complex")
    right = turned.conj().T @ law.G[:, 0]
    solved = np.zeros((len(right), len(z)), dtype=complex)
    for row in reversed(range(len(right))):
        solved[row] = (right[row] + triangle[row, row + 1 :] @ solved[row + 1 :]) / (z - triangle[row, row])
    found: np.ndarray = law.H[0] @ turned @ solved + law.D
    return found


def margins_of(w: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Gain margin (dB), phase margin (°) and modulus margin of loops given on a grid, by interpolation.

    The gain margin is the least factor, up or down, at which a stable loop comes to its limit, as in python-control's
    `stability_margins`: an integrating law on an axis is often unstable with less gain, too.
    A loop that is below 1 at the first frequency, and integrates, has the phase margin of its phase there. At Nyquist's
    frequency, if that is the last one, a loop is real and may end on the negative axis without a crossing.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        size, phase = np.log(np.abs(loop)), np.unwrap(np.angle(loop), axis=1)
        turned = phase + np.pi  # zero, or a multiple of 2π, where the loop crosses the negative real axis
        lap = np.floor(turned / (2.0 * np.pi))
        crossing = lap[:, 1:] != lap[:, :-1]
        level = np.maximum(lap[:, 1:], lap[:, :-1]) * 2.0 * np.pi
        share = (level - turned[:, :-1]) / (turned[:, 1:] - turned[:, :-1])
        there = size[:, :-1] + share * (size[:, 1:] - size[:, :-1])
        last = loop[:, -1]
        ends = np.where((last.real < 0.0) & (np.abs(last.imag) < _REAL * np.abs(last)), np.abs(size[:, -1]), np.inf)
        gain = np.minimum(np.where(crossing, np.abs(there), np.inf).min(axis=1), ends) * 20.0 / np.log(10.0)
        unity = (size[:, 1:] > 0.0) != (size[:, :-1] > 0.0)
        share = -size[:, :-1] / (size[:, 1:] - size[:, :-1])
        angle = turned[:, :-1] + share * (turned[:, 1:] - turned[:, :-1])
        angle = np.abs((angle + np.pi) % (2.0 * np.pi) - np.pi)
        margin = np.degrees(np.where(unity, angle, np.inf).min(axis=1))
        falling = (size[:, 1] - size[:, 0]) / np.log(w[1] / w[0]) < -0.5  # an integrating loop: 1 at a lower frequency
        first = np.degrees(np.abs((turned[:, 0] + np.pi) % (2.0 * np.pi) - np.pi))
        margin = np.where((size[:, 0] < 0.0) & falling, np.minimum(margin, first), margin)
    return np.stack([gain, margin, _nearest(1.0 + loop)], axis=1)


def _nearest(curves: np.ndarray) -> np.ndarray:
    """The least distance from 0 of complex curves given by points: (curves, points) to (curves,). On the chords."""
    begin, chord = curves[:, :-1], np.diff(curves, axis=1)
    length = np.maximum(np.abs(chord) ** 2, np.finfo(float).tiny)
    share = np.clip(-(begin * chord.conj()).real / length, 0.0, 1.0)
    nearest: np.ndarray = np.abs(begin + share * chord).min(axis=1)
    return nearest


def _pole_radius(law: Law, axes: np.ndarray, T: float) -> np.ndarray:
    """The largest |pole| of each closed loop, NaN beyond a delay of `_LARGEST_DELAY` samples."""
    radius = np.full(len(axes), np.nan)
    for whole in np.unique(axes[:, 2]):
        if whole <= _LARGEST_DELAY:
            chosen = axes[:, 2] == whole
            radius[chosen] = np.abs(np.linalg.eigvals(_closed(law, axes[chosen], int(whole), T))).max(axis=1)
    return radius


def _closed(law: Law, axes: np.ndarray, whole: int, T: float) -> np.ndarray:
    """The closed loops' matrices; states x, v, the voltages that wait (latest first), the law's."""
    a12, a22, now, before = _held(axes, T)
    n, wait = len(law.G), whole + 1
    M = np.zeros((len(axes), 2 + wait + n, 2 + wait + n))
    M[:, 0, 0], M[:, 0, 1], M[:, 1, 1] = 1.0, a12, a22
    u = np.zeros(2 + wait + n)  # the new voltage as a row
    u[0], u[2 + wait :] = law.D, law.H[0]
    for row in (0, 1):
        M[:, row, 1 + wait] += before[row]
        if whole:
            M[:, row, wait] += now[row]
        else:
            M[:, row] += now[row][:, None] * u
    M[:, 2] = u
    for j in range(1, wait):
        M[:, 2 + j, 1 + j] = 1.0
    M[:, 2 + wait :, 0] = law.G[:, 0]
    M[:, 2 + wait :, 2 + wait :] = law.F
    return M
