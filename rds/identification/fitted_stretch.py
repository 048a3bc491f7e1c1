"""What is kept of a log that was fitted, for whoever asks later what the model has seen."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.logs.fingerprint import fingerprint
from rds.logs.log import Log

_SMOOTH = 0.01  # s over which velocities are taken: an encoder's step in one sample is no speed


def fitted_stretch(log: Log) -> dict[str, Any]:
    """What an estimate, and the model file made of it, say of a log that was fitted: `Estimate.logs` holds these.

    Beside file and rows, the lowest and highest command (V) and velocity (mm/s), beyond which the model is a guess,
    and the fingerprint by which the data are known again under another name.
    """
    step = max(round(_SMOOTH / log.sample_period), 1)
    rate = log.position if log.units.get("position") == "rev/min" else _slopes(log, min(step, len(log) - 1))
    found: dict[str, Any] = {
        "name": log.name,
        "source": log.source,
        "sha256": log.sha256,
        "first": log.first,
        "end": log.first + len(log),
        "command": (float(log.command.min()), float(log.command.max())),
        "velocity": (float(rate.min()), float(rate.max())),
    }
    return found | ({"fingerprint": hashes} if (hashes := fingerprint(log)) else {})


def _slopes(log: Log, step: int) -> np.ndarray:
    """Mean velocities over `step` samples."""
    return (log.position[step:] - log.position[:-step]) / (log.time[step:] - log.time[:-step])
