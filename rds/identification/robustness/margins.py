"""Margins and poles of the sampled loop, linearized about rest, for many axes at once.

The axis without friction and play is τ ẍ + ẋ = K u, held over each sample and delayed by n samples and a rest f:

    x_{k+1} = A x_k + Γ₁ u_{k-n-1} + Γ₀ u_{k-n}        (exact)

A library law is linear between its limits; its matrices come from the law itself, by steps of its arguments about
rest. A law that does not answer in proportion has no linear loop, and gets no margins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Controller, Model, Reference
from rds.models.machine_model import MachineAxisMotion, linear_part, split_delay

GRID = 800  # frequencies, logarithmic up to Nyquist's
_DECADES = 5.0
_STEP = 1e-4  # of position (mm) and state, for the law's matrices: far inside any limit
_LARGEST_DELAY = 200  # samples: beyond, no poles are computed


@dataclass(frozen=True)
class LinearLaw:
    """u = C s + D y, s⁺ = A s + B y: a law about rest, without the states that never reach the voltage."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float


def linear_law(controller: Controller | None) -> LinearLaw | None:
    """The law about rest (reference, position and velocity zero); None if it is not linear there."""
    if controller is None or controller.coupled:
        return None
    try:
        rest = _flat(controller.initial_state)
        for _ in range(2):  # until it has begun: the first sample of some laws is special
            _, rest = _answer(controller, 0.0, rest)
        base_u, base_s = _answer(controller, 0.0, rest)
        columns = [_slope(controller, rest, base_u, base_s, j) for j in range(-1, len(rest))]
    except Exception:  # a student's law on a state that it never meets: then there are no margins
        return None
    if any(column is None for column in columns):
        return None
    both = np.array(columns).T  # rows: u, then the states; columns: y, then the states
    A, B, C, D = both[1:, 1:], both[1:, 0], both[0, 1:], float(both[0, 0])
    seen = C != 0.0
    for _ in range(len(seen)):
        seen = seen | (A[seen] != 0.0).any(axis=0)
    return LinearLaw(A[np.ix_(seen, seen)], B[seen], C[seen], D)


def _flat(state: Any) -> np.ndarray:
    values = np.asarray(state, dtype=float)
    if values.ndim != 1:
        raise ValueError("not a list of numbers")
    return values


def _answer(controller: Controller, y: float, state: np.ndarray) -> tuple[float, np.ndarray]:
    rest = Reference(0.0, 0.0, 0.0)
    u, following, *_ = controller.control(0.0, rest, y, tuple(state.tolist()), dict(controller.params))
    return float(u), _flat(following)


def _slope(controller: Controller, rest: np.ndarray, u: float, s: np.ndarray, j: int) -> np.ndarray | None:
    """The change of voltage and states for a unit of y (j = -1) or of state j; None if it is not in proportion."""
    found = []
    for step in (_STEP, -2.0 * _STEP):
        moved = rest.copy()
        if j >= 0:
            moved[j] += step
        new_u, new_s = _answer(controller, step if j < 0 else 0.0, moved)
        found.append(np.concatenate([[new_u - u], new_s - s]) / step)
    first, second = found
    return first if np.allclose(first, second, rtol=1e-4, atol=1e-6 * max(1.0, np.abs(first).max())) else None


def loop_margins(law: LinearLaw, models: Sequence[Model], T: float) -> np.ndarray:
    """`figures.MARGINS` of each loop: (models, 4). Margins of an unstable loop, or of no linear axis, are NaN."""
    rows = np.full((len(models), 4), np.nan)
    parts = [_axis(model, T) for model in models]
    known = [k for k, part in enumerate(parts) if part is not None]
    if not known:
        return rows
    axes = np.array([parts[k] for k in known])  # tau, K, whole, rest
    rows[known, 3] = _pole_radius(law, axes, T)
    w = np.pi / T * np.logspace(-_DECADES, 0.0, GRID)
    for begin in range(0, len(known), 500):
        some = slice(begin, begin + 500)
        stable = rows[known[some], 3] < 1.0
        found = margins_of(w, _loop(law, axes[some], w, T))
        rows[known[some], :3] = np.where(stable[:, None], found, np.nan)
    return rows


def open_loop(law: LinearLaw, model: Model, T: float, w: np.ndarray) -> np.ndarray:
    """-C(z) P(z) of one loop at the frequencies `w` (rad/s), complex: what Bode and Nyquist draw.

    Raises InputError for a model that has no linear axis in it.
    """
    return _loop(law, np.array([_known(model, T)]), w, T)[0]


def closed_poles(law: LinearLaw, models: Sequence[Model], T: float) -> np.ndarray:
    """The poles z of each sampled loop: (models, poles), as many as the loop with the longest delay has, else NaN.

    Raises InputError for a model that has no linear axis in it, or a delay of more than `_LARGEST_DELAY` samples.
    """
    axes = np.array([_known(model, T) for model in models])
    if axes[:, 2].max() > _LARGEST_DELAY:
        raise InputError(f"a delay of more than {_LARGEST_DELAY} samples of {T:g} s is too long for its poles")
    found = np.full((len(axes), 3 + int(axes[:, 2].max()) + len(law.B)), np.nan, dtype=complex)
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


def _loop(law: LinearLaw, axes: np.ndarray, w: np.ndarray, T: float) -> np.ndarray:
    """-C(z) P(z) on the unit circle: (axes, frequencies)."""
    z = np.exp(1j * w * T)
    a12, a22, now, before = (part[..., None] for part in _held(axes, T))
    inputs = now + before / z  # (2, axes, frequencies)
    speed = inputs[1] / (z - a22)
    plant = (inputs[0] + a12 * speed) / (z - 1.0) * z ** -axes[:, 2:3]
    n = len(law.B)
    solved = np.linalg.solve(z[:, None, None] * np.eye(n) - law.A, np.tile(law.B[:, None], (len(z), 1, 1)))[..., 0]
    return -(solved @ law.C + law.D) * plant


def margins_of(w: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Gain margin (dB), phase margin (°) and modulus margin of loops given on a grid, by interpolation.

    The gain margin is the least factor, up or down, at which a stable loop comes to its limit, as in python-control's
    `stability_margins`: an integrating law on an axis is often unstable with less gain, too.
    A loop that is below 1 at the first frequency, and integrates, has the phase margin of its phase there.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        size, phase = np.log(np.abs(loop)), np.unwrap(np.angle(loop), axis=1)
        turned = phase + np.pi  # zero, or a multiple of 2π, where the loop crosses the negative real axis
        lap = np.floor(turned / (2.0 * np.pi))
        crossing = lap[:, 1:] != lap[:, :-1]
        level = np.maximum(lap[:, 1:], lap[:, :-1]) * 2.0 * np.pi
        share = (level - turned[:, :-1]) / (turned[:, 1:] - turned[:, :-1])
        there = size[:, :-1] + share * (size[:, 1:] - size[:, :-1])
        gain = np.where(crossing, np.abs(there), np.inf).min(axis=1) * 20.0 / np.log(10.0)
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


def _pole_radius(law: LinearLaw, axes: np.ndarray, T: float) -> np.ndarray:
    """The largest |pole| of each closed loop, NaN beyond a delay of `_LARGEST_DELAY` samples."""
    radius = np.full(len(axes), np.nan)
    for whole in np.unique(axes[:, 2]):
        if whole <= _LARGEST_DELAY:
            chosen = axes[:, 2] == whole
            radius[chosen] = np.abs(np.linalg.eigvals(_closed(law, axes[chosen], int(whole), T))).max(axis=1)
    return radius


def _closed(law: LinearLaw, axes: np.ndarray, whole: int, T: float) -> np.ndarray:
    """The closed loops' matrices; states x, v, the voltages that wait (latest first), the law's."""
    a12, a22, now, before = _held(axes, T)
    n, wait = len(law.B), whole + 1
    M = np.zeros((len(axes), 2 + wait + n, 2 + wait + n))
    M[:, 0, 0], M[:, 0, 1], M[:, 1, 1] = 1.0, a12, a22
    u = np.zeros(2 + wait + n)  # the new voltage as a row
    u[0], u[2 + wait :] = law.D, law.C
    for row in (0, 1):
        M[:, row, 1 + wait] += before[row]
        if whole:
            M[:, row, wait] += now[row]
        else:
            M[:, row] += now[row][:, None] * u
    M[:, 2] = u
    for j in range(1, wait):
        M[:, 2 + j, 1 + j] = 1.0
    M[:, 2 + wait :, 0] = law.B
    M[:, 2 + wait :, 2 + wait :] = law.A
    return M
