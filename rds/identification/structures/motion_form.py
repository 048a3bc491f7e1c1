"""Structures whose equation is linear in its coefficients, once velocity and acceleration are known.

    axis                  u = (τ/K) v' + (1/K) v + (F₊/K) [v > 0] + (F₋/K) [v < 0]
    axis, offset          u = (τ/K) v' + (1/K) v + (F/K) sign v - u₀
    axis-mass             g u = M v' + F_v v + F_c sign v + offset                        (v in m/s)
    axis-mass, by direction   g u = M v' + F_v± v ± F_c±
    spindle               u = (τ/K) v' + (1/K) v [- u₀]                                   (v in rev/min)

The columns belong to the structure's parameters in their order, without those that are given.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rds.core.errors import InputError
from rds.identification.structures.structure import Structure

Columns = Callable[[np.ndarray, np.ndarray], np.ndarray]  # velocity, acceleration -> (samples, coefficients)
Values = Callable[[np.ndarray], np.ndarray]  # coefficients -> parameters; both may be complex


@dataclass(frozen=True)
class MotionForm:
    """The equation of motion of one structure. `friction` are the columns whose coefficient must have one sign."""

    names: tuple[str, ...]
    is_rate: bool  # the log's position is a speed already
    columns: Columns
    values: Values
    friction: Mapping[int, float]  # column -> sign of its coefficient times that of 1/K
    target: str = "voltage"  # what the equation explains

    def covariance(self, theta: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """The parameters' covariance from that of the coefficients, to first order (derivatives by complex steps)."""
        n, step = len(theta), 1e-30
        jacobian = np.array([self.values(theta + 1j * step * np.eye(n)[i]).imag / step for i in range(n)]).T
        hidden = np.isinf(np.diag(spread))
        finite = np.where(np.isfinite(spread), spread, 0.0)
        covariance = jacobian @ finite @ jacobian.T
        untold = (jacobian[:, hidden] != 0.0).any(axis=1)
        covariance[untold, :] = covariance[:, untold] = 0.0
        covariance[untold, untold] = np.inf
        return np.asarray(covariance, dtype=float)


def motion_form(structure: Structure) -> MotionForm:
    """The form of `structure`; InputError for one whose equation is not linear in coefficients."""
    key = (structure.name, tuple(sorted(structure.options)))
    if key not in _FORMS:
        with_options = f"{structure.name} with {', '.join(structure.options)}" if structure.options else structure.name
        raise InputError(
            f"inverse dynamics needs an equation that is linear in its coefficients, which {with_options} has not; "
            f"take --method simulation, or one of: {'; '.join(_name(known) for known in _FORMS)}"
        )
    return _FORMS[key]


def _name(key: tuple[str, tuple[str, ...]]) -> str:
    return key[0] + (f" with {', '.join(key[1])}" if key[1] else "")


def _axis(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v, v > 0.0, v < 0.0]).astype(float)


def _axis_values(theta: np.ndarray) -> np.ndarray:
    return np.array([theta[0], 1.0, *theta[2:]]) / theta[1]


def _axis_offset(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v, np.sign(v), -np.ones_like(v)])


def _axis_offset_values(theta: np.ndarray) -> np.ndarray:
    return np.array([theta[0] / theta[1], 1.0 / theta[1], theta[2] / theta[1], theta[3]])


def _mass(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a / 1e3, v / 1e3, np.sign(v), np.ones_like(v)])


def _mass_per_direction(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    forward, backward = v > 0.0, v < 0.0
    return np.column_stack([a / 1e3, v / 1e3 * forward, v / 1e3 * backward, 1.0 * forward, -1.0 * backward])


def _same(theta: np.ndarray) -> np.ndarray:
    return theta


def _spindle(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v])


def _spindle_offset(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v, -np.ones_like(v)])


def _spindle_offset_values(theta: np.ndarray) -> np.ndarray:
    return np.array([theta[0] / theta[1], 1.0 / theta[1], theta[2]])


_FORMS: Mapping[tuple[str, tuple[str, ...]], MotionForm] = {
    ("axis", ()): MotionForm(
        ("tau", "K", "friction_plus", "friction_minus"), False, _axis, _axis_values, {2: 1.0, 3: -1.0}
    ),
    ("axis", ("offset",)): MotionForm(
        ("tau", "K", "friction", "offset"), False, _axis_offset, _axis_offset_values, {2: 1.0}
    ),
    ("axis-mass", ()): MotionForm(("M", "F_v", "F_c", "offset"), False, _mass, _same, {1: 1.0, 2: 1.0}, "force"),
    ("axis-mass", ("per-direction",)): MotionForm(
        ("M", "F_v_plus", "F_v_minus", "F_c_plus", "F_c_minus"),
        False,
        _mass_per_direction,
        _same,
        {1: 1.0, 2: 1.0, 3: 1.0, 4: 1.0},
        "force",
    ),
    ("spindle", ()): MotionForm(("tau", "K"), True, _spindle, _axis_values, {}),
    ("spindle", ("offset",)): MotionForm(("tau", "K", "offset"), True, _spindle_offset, _spindle_offset_values, {}),
}
