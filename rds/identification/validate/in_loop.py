"""A model in the loop that was logged: the experiment simulated with it, where controller and reference are known.

Feedback hides what a model is wrong in from a free run, and a free run lacks what held the axis. In the loop itself a
wrong time constant shows as another tracking error: so the simulated position is held against the measured one, beside
the size of the measured tracking error. Where the controller is not known, forces need none: inverse dynamics with the
model's parameters, beside a fit to the log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Model
from rds.identification.fit.run_model import library_table
from rds.identification.logs.log import Log
from rds.identification.logs.motion import noise
from rds.identification.validate.assessment import Assessment
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.cross_test import cross_test
from rds.identification.validate.own_loop import OwnLoop, own_loop
from rds.identification.validate.verdict import Bands, Reason, Side
from rds.models import library_model
from rds.results.result import Result

_AS_NOISE = 1.5  # times the measurement's noise: what is nearer, noise explains
_LEAST = 20  # samples
_SETTLING = 0.05  # of the log, at its begin: where the axis may have been elsewhere


Loop = Callable[[Model], Result]  # runs the experiment that was logged with this model in the axis's place


@dataclass(frozen=True)
class InLoop:
    """Simulated in the loop less measured: RMS in the position's unit, and what share that is of the tracking error."""

    rmse: float
    tracking_rms: float
    noise: float
    unit: str

    @property
    def fit_percent(self) -> float:
        """100 (1 - |simulated - measured| / |reference - measured|)."""
        return 100.0 * (1.0 - self.rmse / self.tracking_rms) if self.tracking_rms > 0.0 else float("-inf")


def in_loop(candidate: Candidate, log: Log, simulate: Loop) -> InLoop:
    """The experiment that was logged, simulated with the model by `simulate`, against the log.

    InputError for an experiment of several axes, or another sample period than the log's.
    """
    result = simulate(_model(candidate))
    if len(result.axes) != 1:
        raise InputError(f"a loop is simulated for one axis, and the experiment has {len(result.axes)}; leave one")
    axis, T = result.axes[0], result.sample_period
    if abs(T - log.sample_period) > 1e-3 * T:
        raise InputError(
            f"the experiment has a sample period of {T:g} s, and the log one of {log.sample_period:.6g} s; give the "
            "experiment that was logged",
            log.source or log.name,
        )
    n = min(len(log), len(result) - log.first)
    if n < _LEAST:
        raise InputError(
            f"the experiment has {len(result)} samples, and the log begins at its sample {log.first}; give the "
            "experiment that was logged",
            log.source or log.name,
        )
    same = slice(log.first, log.first + n)  # of a log that is a part of what was logged
    reference = log.extra.get("reference")
    wanted = np.asarray(result[f"{axis}_reference"][same] if reference is None else reference[:n], dtype=float)
    measured, simulated = log.position[:n], np.asarray(result[f"{axis}_measured"][same], dtype=float)
    counted = slice(round(_SETTLING * n), n)
    return InLoop(
        rmse=float(np.std((simulated - measured)[counted])),
        tracking_rms=float(np.std((wanted - measured)[counted])),
        noise=max(noise(log.position), (log.resolution or 0.0) / np.sqrt(12.0)),
        unit=log.units.get("position", "mm"),
    )


def closed_loop_reasons(candidate: Candidate, a: Assessment, loop: Loop | None, bands: Bands) -> Iterator[Reason]:
    """What the loop that was logged says of the model; where that is not known, what the forces in it say.

    `loop` is the experiment, if it is given; of our own results the loop is known without it.
    """
    known = own_loop(a.log) if loop is None else None
    if isinstance(known, OwnLoop):
        loop = known.simulate
    if loop is not None:
        yield from _of_loop(in_loop(candidate, a.log, loop), bands)
        return
    if isinstance(known, str):
        yield Reason(Side.NOTE, "loop", f"the loop itself is not simulated: {known}")
    if a.log.closed_loop:
        yield from _of_forces(candidate, a.log, bands)


def _of_forces(candidate: Candidate, log: Log, bands: Bands) -> Iterator[Reason]:
    """By inverse dynamics, what the model leaves of the force, and what of that its parameters are to blame for."""
    try:
        (crossed,) = cross_test(candidate, [log])
    except InputError:  # no equation that is linear in its parameters, or too little motion for the filters
        return
    own = sqrt(max(crossed.percent**2 - crossed.fitted_percent**2, 0.0))
    explained = crossed.fitted_percent <= bands.voltage_percent
    side = Side.NOTE
    if explained and own <= bands.gain_percent:
        side = Side.FOR
    elif explained and own > bands.voltage_percent:
        side = Side.AGAINST
    yield Reason(
        side,
        "forces",
        f"inverse dynamics, which needs no controller: the model leaves {crossed.percent:.3g} % of the force, a fit to "
        f"this log {crossed.fitted_percent:.3g} %, so {own:.2g} % are its parameters' own",
    )


def _of_loop(found: InLoop, bands: Bands) -> Iterator[Reason]:
    """What the loop says for the model, or against it."""
    good = found.fit_percent >= bands.fit_percent or found.rmse <= _AS_NOISE * found.noise
    yield Reason(
        Side.FOR if good else Side.AGAINST,
        "loop",
        f"simulated in the loop itself, it is {found.rmse:.3g} {found.unit} off the measured position (RMS), where the "
        f"tracking error is {found.tracking_rms:.3g} {found.unit}: {found.fit_percent:.1f} % of it is foretold; band "
        f"{bands.fit_percent:g} %",
    )


def _model(candidate: Candidate) -> Model:
    """The model as one that an experiment takes."""
    if candidate.model is not None:
        return candidate.model
    made = candidate.structure
    if candidate.source:
        from rds.identification.fit.model_file import read_model
        from rds.identification.fit.run_model import run_model

        return run_model(read_model(candidate.source))
    if made.name.endswith(".py"):
        raise InputError(f"the model {candidate.name} is no file, and only a file is simulated in a loop")
    table = library_table(made, candidate.values)
    return library_model(table.pop("name"), **table)
