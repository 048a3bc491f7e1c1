"""Logs of axes whose parameters are known: simulated exactly, then disturbed and quantized."""

from __future__ import annotations

import numpy as np

from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from rds.machines import load_machine

RESOLUTION = 0.001  # mm
CONVERTER_STEP = 20.0 / 4096  # V


def mini_cnc(axis: str) -> dict[str, float]:
    """tau, K, friction_plus, friction_minus of the paper's axis."""
    model = load_machine("mini-cnc").axes[axis].model
    return {name: float(model[name]) for name in ("tau", "K", "friction_plus", "friction_minus")}


def command(kind: str, t: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """A voltage of this kind with random size, frequency and phase, as the converter puts it out."""
    if kind == "square":
        wave = draw.uniform(1.5, 4.0) * np.sign(
            np.sin(2.0 * np.pi * draw.uniform(0.7, 2.0) * t + draw.uniform(0.0, 6.0))
        )
    elif kind == "sine":
        wave = draw.uniform(1.5, 5.0) * np.sin(2.0 * np.pi * draw.uniform(0.5, 3.0) * t + draw.uniform(0.0, 6.0))
    else:
        tones = np.arange(1, 13) * draw.uniform(0.4, 1.0)
        wave = np.sum([np.sin(2.0 * np.pi * f * t + draw.uniform(0.0, 6.28)) for f in tones], axis=0)
        wave *= draw.uniform(2.0, 5.0) / np.abs(wave).max()
    return np.round(wave / CONVERTER_STEP) * CONVERTER_STEP


def axis_log(
    values: dict[str, float],
    kind: str = "multisine",
    *,
    seed: int = 0,
    seconds: float = 10.0,
    noise: float = 0.001,
    resolution: float | None = RESOLUTION,
    options: tuple[str, ...] = (),
    times: np.ndarray | None = None,
    rounding: np.ufunc = np.round,
) -> Log:
    """`seconds` at 1 kHz (or at `times`) from a random place at rest; `noise` mm before the encoder rounds."""
    draw = np.random.default_rng(seed)
    t = np.arange(round(seconds * 1000)) * 0.001 if times is None else times
    u = command(kind, t, draw)
    structure = make(options)
    x0 = (draw.uniform(-1.0, 1.0), 0.0, 0.0)[: structure.states]
    y = structure.respond(t, u, x0, values) + noise * draw.standard_normal(len(t))
    if resolution is not None:
        y = rounding(y / resolution) * resolution
    return Log(f"{kind} {seed}", t, u, y, resolution=resolution)
