"""10,000 closed loops of the 10 s experiment at 1 kHz, with parameters drawn from a fit's covariance."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

import rds
from benchmarks.figures import Figure
from rds.identification.fit.estimate import Estimate, Parameter
from rds.identification.fit.model_file import write_model
from rds.identification.robustness.study import study
from rds.machines import load_machine
from rds.models.linear_axis import PARAMETERS

RUNS = 10_000
ROUNDS = 3
LIMIT = 10.0  # s, on two cores
UNITS = {"tau": "s", "K": "(mm/s)/V", "friction_plus": "mm/s", "friction_minus": "mm/s"}


def run() -> list[Figure]:
    """Seconds for all runs, with draws, margins and figures; and the first use, which compiles."""
    with tempfile.TemporaryDirectory() as folder:
        experiment = _experiment(Path(folder))
        begun = perf_counter()
        study(experiment, 1)
        first = perf_counter() - begun
        rounds = tuple(study(experiment, RUNS, seed=number).seconds for number in range(ROUNDS))
        begun = perf_counter()
        experiment.run()
        once = perf_counter() - begun
    return [
        Figure(f"{RUNS:,} runs of 10 s at 1 kHz, warm", "s", rounds, LIMIT),
        Figure("of one run", "ms", tuple(1e3 * seconds / RUNS for seconds in rounds)),
        Figure("one run by the ordinary loop in Python", "ms", (1e3 * once,)),
        Figure("the first study, which compiles", "s", (first,)),
    ]


def _experiment(folder: Path) -> rds.Experiment:
    axis = load_machine("mini-cnc").axis("X")
    values = {name: float(axis.model[name]) for name in PARAMETERS}
    errors = np.array([0.02 * abs(value) for value in values.values()])
    parameters = {
        name: Parameter(value, error, value - 2 * error, value + 2 * error, UNITS[name])
        for (name, value), error in zip(values.items(), errors.tolist(), strict=True)
    }
    made = Estimate("axis", (), "simulation", parameters, np.diag(errors**2), (), {}, {}, {}, ())
    return rds.Experiment(
        axis="X",
        duration=10.0,
        reference=rds.sinusoid(5.0, 0.2),
        controller="tracking",
        model=str(write_model(folder / "x.toml", made)),
    )
