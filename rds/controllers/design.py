"""Design functions: gains, observer parameters and controller systems, from poles.

They reproduce Table 2 of mini-cnc-rds to its last printed digit, but for the sign of Z's g₂: the table says 22.0
where equations 6 and 7 give g₂ = 64 - 1/τ = -22.0 (X and Y carry the sign), so that is a misprint.
Up to two poles are placed by the closed form, which a test holds against python-control; the rest is python-control's.
It is imported inside the functions, because that takes seconds: who has gains doesn't need it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rds.controllers import observer
from rds.core.errors import InputError
from rds.core.extras import python_control
from rds.core.quantities import Quantity

_OFF = 0.01  # of the fastest pole: how far placed poles may lie from those asked for; the rounding of near-deadbeat
_OFF_OF_OWN = 1e-4  # ones is in proportion to the system's own


def read_poles(poles: Any, count: int | None = None, owner: str = "design") -> list[complex]:
    """Poles as complex numbers, 1/s, from complex or real numbers or [real, imaginary] pairs.

    Raises InputError unless there are `count` of them, finite, in conjugate pairs and left of the imaginary axis.
    """
    is_number = isinstance(poles, np.ndarray) and not poles.ndim
    if is_number or isinstance(poles, str) or not hasattr(poles, "__iter__"):
        raise InputError(f"{owner}: poles = {poles!r} must be a list, such as [[-32, 24], [-32, -24]] (1/s)")
    read = [_pole(pole, owner) for pole in poles]
    if count is not None and len(read) != count:
        raise InputError(f"{owner}: poles = {poles!r} must be {count} pole{'s' if count != 1 else ''}, 1/s")
    for pole in read:
        if not pole.real < 0.0:
            raise InputError(f"{owner}: the pole {pole:g} 1/s is not stable; its real part must be less than 0")
    if sorted(read, key=_order) != sorted((pole.conjugate() for pole in read), key=_order):
        raise InputError(f"{owner}: poles = {poles!r} must be real or in conjugate pairs, such as -32 ± 24i")
    return read


def _order(pole: complex) -> tuple[float, float]:
    return pole.real, pole.imag


def _pole(pole: Any, owner: str) -> complex:
    part = Quantity("part of a pole", "1/s")
    if isinstance(pole, list | tuple) or (isinstance(pole, np.ndarray) and pole.ndim):
        if len(pole) != 2:
            raise InputError(f"{owner}: the pole {pole!r} must be [real, imaginary], 1/s")
        return complex(part.check(pole[0], "real part", owner), part.check(pole[1], "imaginary part", owner))
    if isinstance(pole, complex | np.complexfloating):
        return complex(part.check(pole.real, "real part", owner), part.check(pole.imag, "imaginary part", owner))
    return complex(part.check(pole, "pole", owner))


def _place(A: np.ndarray, B: np.ndarray, poles: Sequence[complex]) -> np.ndarray:
    """K with the eigenvalues of A - B K at `poles`; InputError where they cannot be placed."""
    # place() takes no poles that coincide with one input. For up to two poles the closed form is exact, and every run
    # of the tracking controller would otherwise wait seconds for python-control to be imported.
    if B.shape[1] == 1 and (len(poles) <= 2 or len(set(poles)) < len(poles)):
        return _ackermann(A, B, poles)
    control = python_control("this design")
    try:
        gains = np.asarray(control.place(A, B, poles), dtype=float).reshape(B.shape[1], A.shape[0])
    except (ValueError, np.linalg.LinAlgError, control.ControlDimension) as error:
        raise _unplaced(poles, str(error)) from error
    # gains of a system that is nearly not reachable are so large that rounding puts the poles anywhere
    apart = np.abs(np.linalg.eigvals(A - B @ gains)[:, None] - np.asarray(poles))
    most = max(_OFF * np.abs(poles).max(), _OFF_OF_OWN * np.abs(np.linalg.eigvals(A)).max())
    if not max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= most:
        raise _unplaced(poles, "the system is nearly not reachable (of an observer: not observable)")
    return gains


def _ackermann(A: np.ndarray, B: np.ndarray, poles: Sequence[complex]) -> np.ndarray:
    """K = [0 ... 0 1] [B, AB, A²B, ...]⁻¹ φ(A), φ the polynomial with the roots `poles` (Ackermann 1972)."""
    n = A.shape[0]
    powers = [np.linalg.matrix_power(A, i) for i in range(n + 1)]
    reach = np.hstack([power @ B for power in powers[:n]])
    if np.linalg.matrix_rank(reach) != n:
        raise _unplaced(poles, "the system is not reachable")
    phi = sum(c * power for c, power in zip(np.real(np.poly(poles))[::-1], powers, strict=True))
    gains: np.ndarray = np.linalg.solve(reach, phi)[-1:]
    return gains


def _unplaced(poles: Sequence[complex], why: str) -> InputError:
    shown = ", ".join(f"{pole:g}" for pole in poles)
    return InputError(f"design: the poles {shown} cannot be placed: {why}; choose other poles")


def tracking_gains(tau: float, poles: Any) -> tuple[float, float]:
    """g₁ (1/s²) and g₂ (1/s) that place the error dynamics of equation 6 at two `poles` (1/s), with μ as in equation 7.

    Raises InputError for poles that are not two, stable and conjugate, or for a `tau` that is not positive.
    """
    Quantity("time constant of the axis", "s", above=0.0).check(tau, "tau", "tracking_gains")
    wanted = read_poles(poles, 2, "tracking_gains")
    gains = _place(np.array([[0.0, 1.0], [0.0, -1.0 / tau]]), np.array([[0.0], [1.0]]), wanted)
    return float(gains[0, 0]), float(gains[0, 1])


def observer_parameters(tau: float, K: float, pole: float) -> tuple[float, float, float, float]:
    """L (1/s), F (1/s), Ḡ (1/s²) and H ((mm/s²)/V) of the continuous reduced-order observer, equation 9.

    L is placed so that v - v̂ decays with `pole` (1/s): L = -1/τ - pole, F = pole, Ḡ = F L, H = K/τ. Table 2 prints
    these. For a sampled loop use `sampled_observer`.
    """
    Quantity("time constant of the axis", "s", above=0.0).check(tau, "tau", "observer_parameters")
    observer.check_pole(pole, "observer_parameters")
    L = float(_place(np.array([[-1.0 / tau]]), np.array([[1.0]]), [complex(pole)])[0, 0])
    F = -1.0 / tau - L
    return L, F, F * L, K / tau


def sampled_observer(tau: float, K: float, pole: float, T: float) -> tuple[float, float, float, float]:
    """L, F, G and H of the reduced-order observer of the axis sampled every `T` s: see `rds.controllers.observer`."""
    return observer.coefficients(tau, K, pole, T)


def tracking_controller_system(tau: float, K: float, poles: Any, observer_pole: float, T: float | None = None) -> Any:
    """The general tracking controller with its observer, equations 8 and 9, as one `control.StateSpace`.

    Inputs `r_position`, `r_velocity`, `r_acceleration` (mm, mm/s, mm/s²) and `y` (mm); output `u` (V), without
    saturation; state `z` (mm/s). Continuous without `T`, else the realization for a loop sampled every `T` s, with
    dt = T.
    """
    control = python_control("this design")
    g1, g2 = tracking_gains(tau, poles)
    if T is None:
        L, F, G, H = observer_parameters(tau, K, observer_pole)
    else:
        L, F, G, H = sampled_observer(tau, K, observer_pole, T)
    from_z = np.array([[-g2 * tau / K]])
    from_inputs = np.array([[g1, 1.0 / tau + g2, 1.0, -g1 - g2 * L]]) * tau / K
    return control.ss(
        np.array([[F]]) + H * from_z,
        H * from_inputs + np.array([[0.0, 0.0, 0.0, G]]),
        from_z,
        from_inputs,
        dt=0 if T is None else T,
        inputs=["r_position", "r_velocity", "r_acceleration", "y"],
        outputs=["u"],
        states=["z"],
        name="tracking",
    )


def reduced_order_observer(sys: Any, poles: Any) -> Any:
    """The reduced-order (Luenberger) observer of `sys`, a `control.StateSpace` with any number of outputs.

    With p independent outputs, n - p states are estimated and `poles` says how fast (1/s; for a discrete `sys` in the
    z-plane, inside the unit circle). Returns a `control.StateSpace` with the inputs of `sys` then its outputs as
    inputs, and the estimates of all n states, under their names followed by `_hat`, as outputs.
    Raises InputError if outputs are dependent, the number of poles is wrong or they cannot be placed.

    With R completing C to a basis, w = R x is what is not measured: ŵ = z + L y, where
    ż = (A₂₂ - L A₁₂) ŵ + (A₂₁ - L A₁₁) y + (B₂ - L B₁) u.
    """
    control = python_control("this design")
    A, B, C, D = (np.asarray(part, dtype=float) for part in (sys.A, sys.B, sys.C, sys.D))
    n, p = A.shape[0], C.shape[0]
    if np.linalg.matrix_rank(C) < p:
        raise InputError(f"reduced_order_observer: the {p} outputs are not independent; leave out the redundant ones")
    discrete = control.isdtime(sys, strict=True)
    wanted = _discrete_poles(poles, n - p) if discrete else read_poles(poles, n - p, "reduced_order_observer")
    R = np.linalg.svd(C)[2][p:]
    back = np.linalg.inv(np.vstack([C, R]))
    a, b = np.vstack([C, R]) @ A @ back, np.vstack([C, R]) @ B
    A11, A12, A21, A22 = a[:p, :p], a[:p, p:], a[p:, :p], a[p:, p:]
    L = _place(A22.T, A12.T, wanted).T if n > p else np.zeros((0, p))
    F = A22 - L @ A12
    from_y = F @ L + A21 - L @ A11
    from_u = b[p:] - L @ b[:p] - from_y @ D  # what C x is, is y - D u
    y_to_x = back @ np.vstack([np.eye(p), L])
    return control.ss(
        F,
        np.hstack([from_u, from_y]),
        back[:, p:],
        np.hstack([-y_to_x @ D, y_to_x]),
        dt=sys.dt,
        inputs=[*sys.input_labels, *sys.output_labels],
        outputs=[f"{label}_hat" for label in sys.state_labels],
    )


def _discrete_poles(poles: Any, count: int) -> list[complex]:
    # A pole inside the unit circle is one left of the axis after this shift of its modulus; conjugates stay conjugates.
    read = [_pole(pole, "reduced_order_observer") for pole in poles]
    for pole in read:
        if not abs(pole) < 1.0:
            raise InputError(f"reduced_order_observer: the pole {pole:g} lies outside the unit circle; choose |z| < 1")
    read_poles([pole - 1.0 for pole in read], count, "reduced_order_observer")
    return read
