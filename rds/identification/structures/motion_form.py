"""Structures whose equation is linear in its coefficients, once velocity and acceleration are known.

    axis                  u = (τ/K) v' + (1/K) v + (F₊/K) [v > 0] + (F₋/K) [v < 0]
    axis, offset          u = (τ/K) v' + (1/K) v + (F/K) sign v - u₀
    axis-mass             g u = M v' + F_v v + F_c sign v + offset                        (v in m/s)
    axis-mass, by direction   g u = M v' + F_v± v ± F_c±
    axis-inertia          the same with J, B, T_c                                         (v in rad/s)
    spindle               u = (τ/K) v' + (1/K) v [- u₀]                                   (v in rev/min)

The columns belong to the structure's parameters in their order, without those that are given. Parameters that are held
at values leave fewer coefficients, on which all of them depend linearly: θ = A φ + b (`held`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rds.core.errors import InputError
from rds.identification.structures.signals import PER_SI
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
    target: str = "command"  # what the equation explains
    ratios: tuple[int, ...] = ()  # columns whose parameter is their coefficient over that of column 1
    gain: int | None = None  # the column whose parameter is one over its coefficient
    per_si: float = 1.0  # the log's units in one of the equation's

    def held(self, fixed: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """A (coefficients, free ones) and b (coefficients,) with these parameters held, and the free coefficients."""
        n = len(self.names)
        A, b = np.eye(n), np.zeros(n)
        at = {self.names.index(name): value for name, value in fixed.items()}
        if self.gain in at and at[self.gain] == 0.0:
            raise InputError(f"{self.names[self.gain]} = 0 cannot be held: the command would not move the axis")
        for column, value in at.items():
            A[column, column] = 0.0
            if column == self.gain:
                b[column] = 1.0 / value
            elif column not in self.ratios:
                b[column] = value
            elif self.gain in at:
                b[column] = value / at[self.gain]
            else:
                A[column, 1] = value
        free = [column for column in range(n) if column not in at]
        return A[:, free], b, free

    def covariance(self, theta: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """The parameters' covariance from that of the coefficients, to first order (derivatives by complex steps)."""
        n, step = len(theta), 1e-30
        jacobian = np.array([self.values(theta + 1j * step * np.eye(n)[i]).imag / step for i in range(n)]).T
        hidden = np.isinf(np.diag(spread))
        finite = np.where(np.isfinite(spread), spread, 0.0)
        covariance = jacobian @ finite @ jacobian.T
        unidentifiable = (jacobian[:, hidden] != 0.0).any(axis=1)
        covariance[unidentifiable, :] = covariance[:, unidentifiable] = 0.0
        covariance[unidentifiable, unidentifiable] = np.inf
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
    form = _FORMS[key]
    per_si = PER_SI[structure.output_unit] if key[0] in _PER_SI else 1.0

    def columns(v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return form.columns(v / per_si, a / per_si)

    return replace(form, is_rate=structure.is_rate, columns=columns, per_si=per_si)


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
    return np.column_stack([a, v, np.sign(v), np.ones_like(v)])


def _mass_per_direction(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    forward, backward = v > 0.0, v < 0.0
    return np.column_stack([a, v * forward, v * backward, 1.0 * forward, -1.0 * backward])


def _same(theta: np.ndarray) -> np.ndarray:
    return theta


def _spindle(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v])


def _spindle_offset(v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.column_stack([a, v, -np.ones_like(v)])


def _spindle_offset_values(theta: np.ndarray) -> np.ndarray:
    return np.array([theta[0] / theta[1], 1.0 / theta[1], theta[2]])


_MOVES = {"": ("M", "F_v", "F_c", "offset"), "per-direction": ("M", "F_v_plus", "F_v_minus", "F_c_plus", "F_c_minus")}
_TURNS = {"": ("J", "B", "T_c", "offset"), "per-direction": ("J", "B_plus", "B_minus", "T_c_plus", "T_c_minus")}
_PER_SI = ("axis-mass", "axis-inertia")


def _of_force(names: tuple[str, ...], target: str) -> MotionForm:
    signs = dict.fromkeys(range(1, 3 if "offset" in names else 5), 1.0)
    return MotionForm(names, False, _mass if "offset" in names else _mass_per_direction, _same, signs, target)


_FORMS: Mapping[tuple[str, tuple[str, ...]], MotionForm] = {
    ("axis", ()): MotionForm(
        ("tau", "K", "friction_plus", "friction_minus"),
        False,
        _axis,
        _axis_values,
        {2: 1.0, 3: -1.0},
        ratios=(0, 2, 3),
        gain=1,
    ),
    ("axis", ("offset",)): MotionForm(
        ("tau", "K", "friction", "offset"),
        False,
        _axis_offset,
        _axis_offset_values,
        {2: 1.0},
        ratios=(0, 2),
        gain=1,
    ),
    ("axis-mass", ()): _of_force(_MOVES[""], "force"),
    ("axis-mass", ("per-direction",)): _of_force(_MOVES["per-direction"], "force"),
    ("axis-inertia", ()): _of_force(_TURNS[""], "torque"),
    ("axis-inertia", ("per-direction",)): _of_force(_TURNS["per-direction"], "torque"),
    ("spindle", ()): MotionForm(("tau", "K"), True, _spindle, _axis_values, {}, ratios=(0,), gain=1),
    ("spindle", ("offset",)): MotionForm(
        ("tau", "K", "offset"), True, _spindle_offset, _spindle_offset_values, {}, ratios=(0,), gain=1
    ),
}
