"""The force or torque of a drive over its current: the motor constant, where both were logged.

    F = k i + c,      k in Nm/A (N/A), by least squares; its standard error from stretches of the log left out in turn

A command with a stated or found k makes mass or inertia and friction come in SI units; without, they are known as
ratios to it only.
"""

from __future__ import annotations

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.machines.machine import Axis

FORCES = ("N", "Nm")
UNKNOWN = "motor-constant-unknown"  # the kind of the finding that nothing tells it
_STRETCHES = 20
_TOGETHER = 0.95  # correlation from which one is the other times a constant
_APART = (5.0, 0.03)  # standard errors, and share of the value: a stated constant that is farther off is not this one


def gain(log: Log) -> tuple[float, str] | None:
    """What one unit of the command makes (N or Nm), by the force or torque that was logged; None where not told."""
    unit = log.units.get("force", "")
    if "force" not in log.extra or log.units.get("command", "V") in FORCES:
        return None
    found = _line(log.command, log.extra["force"])
    return (found[0], unit) if found is not None else None


def motor_constant(log: Log, axis: Axis | None) -> list[Finding]:
    """The constant, where current and force or torque are both there; else what its absence leaves open."""
    unit = log.units.get("command", "V")
    if unit in FORCES:
        return _told(log.extra["current"], log.command, f"{unit}/A", None) if "current" in log.extra else []
    if "force" in log.extra:
        return _told(log.command, log.extra["force"], f"{log.units['force']}/{unit}", log.force_gain)
    if unit == "V" or log.force_gain is not None:
        return []
    key, of = ("torque_gain", "Nm") if log.units.get("position") in ("deg", "rev/min") else ("force_gain", "N")
    what = (
        f"the command is in {unit}, and nothing tells how many {of} one {unit} makes: mass or inertia and friction are "
        f"known as ratios to that constant only (structure axis); {key} = ... ({of}/{unit}) in the map, or `rds fit "
        f"--fix {key}=...`, gives them in SI units"
    )
    return [Finding(UNKNOWN, what)]


def _told(command: np.ndarray, force: np.ndarray, unit: str, stated: float | None) -> list[Finding]:
    found = _line(command, force)
    if found is None:
        what = (
            "force or torque and current hardly go together: no motor constant follows; are these the right columns, "
            "and of one axis?"
        )
        return [Finding("motor-constant", what, Gravity.WARNING)]
    k, error = found
    said = (
        f"motor constant: {k:.4g} ± {error:.2g} {unit} (standard error), by the logged force or torque; no interval of "
        "a fit counts that error"
    )
    if stated is not None and abs(k - stated) > max(_APART[0] * error, _APART[1] * abs(k)):
        what = f"{said}, where {stated:.4g} {unit} is stated; check the map, and the units of both columns"
        return [Finding("motor-constant", what, Gravity.WARNING)]
    return [Finding("motor-constant", said)]


def _line(command: np.ndarray, force: np.ndarray) -> tuple[float, float] | None:
    """Slope and its standard error; None where the two do not go together."""
    u, f = command - command.mean(), force - force.mean()
    size = float(np.sqrt((u @ u) * (f @ f)))
    if not size > 0.0 or abs(float(u @ f)) < _TOGETHER * size:
        return None
    parts = [(u[k], f[k]) for k in np.array_split(np.arange(len(u)), min(_STRETCHES, len(u)))]
    squares, products = np.array([a @ a for a, _ in parts]), np.array([a @ b for a, b in parts])
    slope = float(products.sum() / squares.sum())
    without = (products.sum() - products) / np.maximum(squares.sum() - squares, 1e-300)
    n = len(parts)
    return slope, float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
