"""The gains of a relay experiment from its saved run, and the margins that they give by the run's model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from rds.controllers import library_controller
from rds.controllers.relay import NAME, SIGNALS, Tuned, tuned
from rds.core.errors import InputError
from rds.core.linear_law import linear_law
from rds.core.toml_text import toml_text
from rds.core.types import SPINDLE_UNIT
from rds.identification.robustness.margins import grid, law_response, margins_of
from rds.models.machine_model import linear_part
from rds.modes import load_mode
from rds.results import Result, open_result

RELAY = "Found by `rds design relay`"  # how the table's file begins


@dataclass(frozen=True)
class RelayGains:
    """What the experiment found for one axis, and how far its loop is from swinging by the model that the run had.

    Margins are None where the run's model has no linear part, and NaN where the loop would be unstable.
    """

    found: Tuned
    delay: int  # samples that a voltage acts later than in a simulation
    phase_margin: float | None  # degrees
    gain_margin: float | None  # dB

    def controller(self) -> dict[str, Any]:
        """What `controller=` of the next experiment takes."""
        return self.found.controller()

    def table(self) -> str:
        """The [controller] table of an experiment file."""
        return toml_text({"controller": self.controller()}, f"{RELAY}.").lstrip()

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        found = self.found
        return {
            "axis": found.axis,
            "unit": found.unit,
            "rule": found.rule,
            "ultimate_gain": found.ultimate_gain,
            "ultimate_period_s": found.ultimate_period,
            "amplitude": found.amplitude,
            "spread": found.spread,
            "controller": self.controller(),
            "doubts": found.doubts(),
            "delay_samples": self.delay,
            "phase_margin_deg": _plain(self.phase_margin),
            "gain_margin_db": _plain(self.gain_margin),
        }

    def __str__(self) -> str:
        by = f"by the run's model, with {self.delay} sample{'' if self.delay == 1 else 's'} of delay"
        if self.phase_margin is None or self.gain_margin is None:
            said = "no margins, because the run's model has no tau and K"
        elif np.isnan(self.phase_margin):
            said = f"{by}, the loop with these gains is unstable"
        else:
            said = f"{by}: phase margin {self.phase_margin:.0f}°, gain margin {self.gain_margin:.1f} dB"
        return f"{self.found}\n{said}"


def relay_gains(run: Result | str | Path, axis: str | None = None, delay: int | None = None) -> RelayGains:
    """The gains that a run of the law `relay` found for `axis` (by default the first that it drove).

    `delay`, samples, is for the margins: by default that of the run's mode, 1 on a bus and 0 in a simulation.
    InputError where the run had no such law, or where the experiment found nothing, with what to change.
    """
    result = run if isinstance(run, Result) else open_result(Path(run))
    laws: Mapping[str, Any] = result.meta.get("controller") or {}
    having = [name for name, law in laws.items() if isinstance(law, Mapping) and _is_relay(law, result, name)]
    if not having or (axis is not None and axis not in having):
        who = "no axis of this run was" if axis is None else f"axis {axis!r} of this run was not"
        raise InputError(
            f"{who} driven by the law {NAME!r}"
            + (f"; it drove {', '.join(having)}" if having else f'; run one with [controller] name = "{NAME}"')
        )
    name = having[0] if axis is None else axis
    unit = result.units.get(f"{name}_measured") or "mm"
    signals = {signal: result[f"{name}_{signal}"] for signal in SIGNALS}
    found = tuned(name, unit, signals, laws[name]["params"])
    late = delay if delay is not None else int(bool(load_mode(str(result.meta.get("mode"))).followed))
    model = ((result.meta.get("model") or {}).get(name) or {}).get("params") or {}
    if not {"tau", "K"} <= set(model):
        return RelayGains(found, late, None, None)
    return RelayGains(found, late, *model_margins(found, model, result.sample_period, late))


def model_margins(found: Tuned, model: Mapping[str, Any], T: float, delay: int) -> tuple[float, float]:
    """Phase margin (°) and gain margin (dB) of the loop with an axis of these parameters; NaN if it is unstable.

    `delay` is in samples; the model's own is added, rounded up.
    """
    linear = linear_part(model) if "viscous" in model else model
    tau, K = float(linear["tau"]), float(linear["K"])
    is_spindle = found.unit == SPINDLE_UNIT
    options = {name: value for name, value in found.controller().items() if name != "name"}
    law = linear_law(library_controller("pid", {"tau": tau, "K": K}, T, inf, unit=found.unit, **options))
    kept = np.exp(-T / tau)
    if is_spindle:
        A, B = np.array([[kept]]), np.array([K * (1.0 - kept)])
    else:
        A = np.array([[1.0, tau * (1.0 - kept)], [0.0, kept]])
        B = np.array([K * (T - tau * (1.0 - kept)), K * (1.0 - kept)])
    late = delay + int(np.ceil(float(linear.get("delay", 0.0)) / T - 1e-9))
    if _radius(A, B, law, late) >= 1.0:
        return np.nan, np.nan
    w = grid(T, late + len(law.G))
    z = np.exp(1j * w * T)
    inverted = np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, np.tile(B[:, None], (len(z), 1, 1)))
    loop = -law_response(law, z) * inverted[:, 0, 0] * z**-late
    row = margins_of(w, loop[None])[0]
    return float(row[1]), float(row[0])


def _radius(A: np.ndarray, B: np.ndarray, law: Any, late: int) -> float:
    """The largest |pole| of the closed loop; states: axis, voltages that wait (latest first), law."""
    n, m = len(A), len(law.G)
    M = np.zeros((n + late + m, n + late + m))
    u = np.zeros(n + late + m)
    u[0], u[n + late :] = law.D, law.H[0]
    M[:n, :n] = A
    if late:
        M[:n, n + late - 1] = B
        M[n] = u
        for j in range(1, late):
            M[n + j, n + j - 1] = 1.0
    else:
        M[:n] += np.outer(B, u)
    M[n + late :, 0], M[n + late :, n + late :] = law.G[:, 0], law.F
    return float(np.abs(np.linalg.eigvals(M)).max())


def _is_relay(law: Mapping[str, Any], result: Result, axis: str) -> bool:
    return law.get("name") == NAME and all(f"{axis}_{signal}" in result for signal in SIGNALS)


def _plain(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None
