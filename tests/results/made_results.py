"""Results made by formula: what each test expects of them can be worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.results import Result

PERIOD = 5.0  # s
T = 0.001  # s


def make_result(
    mode: str = "simulation", axes: str = "X", seconds: float = 10.0, error: float = 0.03, seed: int = 0, **meta: Any
) -> Result:
    """A 5 mm sinusoid followed with `error` mm against the direction of motion; timing and a model as the mode has."""
    random = np.random.default_rng(seed)
    time = np.arange(round(seconds / T)) * T
    phase = 2 * np.pi * time / PERIOD
    columns: dict[str, Any] = {"time": time}
    for axis in axes:
        reference = 5 * np.sin(phase)
        measured = np.round(reference - error * np.tanh(8 * np.cos(phase)), 3)
        voltage = np.clip(3.6 * np.cos(phase) + 0.3 * np.sign(np.cos(phase)), -10, 10)
        columns |= {
            f"{axis}_reference": reference,
            f"{axis}_reference_velocity": 2 * np.pi * np.cos(phase),
            f"{axis}_reference_acceleration": -0.4 * np.pi**2 * 20 * np.sin(phase),
            f"{axis}_measured": measured,
            f"{axis}_command": voltage * 1.0001,
            f"{axis}_voltage": voltage,
        }
        if mode in ("implementation", "model-validation"):
            columns[f"{axis}_modelled"] = measured + 0.2 * np.sin(phase / 3) + 0.002 * random.normal(size=len(time))
            columns[f"{axis}_simulated"] = reference - 0.8 * error * np.tanh(8 * np.cos(phase))
    if mode in ("implementation", "emulation"):
        columns["lateness"] = random.gamma(3, 2.0, len(time))
        columns["io"] = random.gamma(9, 8.0, len(time))
        columns["compute"] = random.gamma(20, 0.4, len(time))
        columns["model"] = random.gamma(20, 0.2, len(time))
        for sample in (4200, 7000, 7001):
            if sample < len(time):
                columns["lateness"][sample] += 1300.0
    about = {
        "mode": mode,
        "machine": "mini-cnc",
        "axes": list(axes),
        "sample_period": T,
        "duration": seconds,
        "period": dict.fromkeys(axes, PERIOD),
        "verdict": None if mode == "simulation" else "met",
        "verdict_evidence": "",
        "verdict_reason": None
        if mode == "simulation"
        else f"all {len(time)} samples were complete within their period",
        "ending": "done",
        "controller": {axis: {"name": "tracking", "sha256": "c0ffee", "params": {"g1": 1.5}} for axis in axes},
        "environment": {"scheduler": "fifo", "priority": 80, "locked_memory": True, "cores": 4},
        "versions": {"rds": "0.1.0"},
        "started": "2024-05-06T07:08:09+00:00",
        "voltage_range": 10.0,
    }
    return Result(columns, meta=about | meta)
