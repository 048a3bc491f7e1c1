"""Which of a model's errors are within the bands on one log: those of the free run, those that a loop would feel."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, sqrt

import numpy as np

from rds.identification.fit.estimate import Errors
from rds.identification.validate.assessment import Assessment
from rds.identification.validate.discrepancy import EXPLAINED, Discrepancy, Off
from rds.identification.validate.verdict import Bands

AS_NOISE = 1.2  # times what noise makes of an error: no model could be better
_SURE = 2.6  # standard errors: 99 %
_SURE_OF_DELAY = 5.0  # a delay and a time constant make up for each other, by more than derivatives say
_LIKELY = 2.0  # 95 %
_UNTOLD = {"gain": 2.0, "speed": 2.0, "phase": 1.4}  # times the band: what the log leaves open is that wide
_SLIGHT = 0.25  # of the bands
_SLIGHT_FIT = (99.5, 98.0)  # %, of position and velocity


def passes(a: Assessment, bands: Bands) -> tuple[bool, bool]:
    """Whether the free run's position and velocity are within the band, or as near as noise lets any model come."""
    position = a.free_run is not None and (a.free_run.fit_percent >= bands.fit_percent or as_good(a))
    if a.velocity is None:
        return position, position
    return position, a.velocity.fit_percent >= bands.fit_percent or as_good_velocity(a)


def as_good(a: Assessment) -> bool:
    """Whether the free run's error is the measurement's noise alone, so that no model could do better.

    A constant beside it is the initial state's, which a few noisy samples tell no better, and which a play hides.
    """
    return a.free_run is not None and a.as_motion is not None and float(a.residual.std()) <= AS_NOISE * a.noise


def as_good_velocity(a: Assessment) -> bool:
    """The same of the velocity: what noise of the position makes of a difference over a block."""
    made = sqrt(2.0) * a.noise / (a.block * a.log.sample_period)
    return a.velocity is not None and a.as_motion is not None and a.velocity.rmse <= AS_NOISE * made


def of_noise(a: Assessment, errors: Errors) -> bool:
    """Whether a prediction from one measured position to another is as good as noise lets it be."""
    return errors.rmse <= AS_NOISE * sqrt(2.0) * a.noise


def skilled_at(a: Assessment, bands: Bands) -> list[int]:
    """The horizons, in samples, at which the model predicts clearly better than no model."""
    return [k for k, e in a.ahead.items() if k in a.naive and e.rmse < bands.skill * a.naive[k].rmse]


def foreseen_at(a: Assessment, bands: Bands) -> list[int]:
    """Those of `skilled_at` at which it foretells the way to the band of the fit, as a free run must."""
    share = 1.0 - bands.fit_percent / 100.0
    way = {k: float(np.sqrt(np.mean((a.measured[k:] - a.measured[:-k]) ** 2))) for k in skilled_at(a, bands)}
    return [k for k in way if a.ahead[k].rmse <= share * way[k]]


@dataclass(frozen=True)
class Measure:
    """What the model is off by in one thing, beside its band."""

    kind: str  # gain, phase, delay, friction, speed
    off: Off
    band: float
    by_chance: bool = False  # what the model leaves is no more than chance makes the truth leave

    @property
    def wrong(self) -> bool:
        """Clearly beyond the band."""
        if self.by_chance:
            return False
        sure = _SURE_OF_DELAY if self.kind == "delay" else _SURE
        return abs(self.off.value) > max(self.band, sure * self.off.error)

    @property
    def reach(self) -> float:
        """How far off it may be, 95 %."""
        return abs(self.off.value) + _LIKELY * self.off.error if isfinite(self.off.error) else float("inf")

    @property
    def told(self) -> bool:
        """Whether the log says that it is not far beyond the band, or that it is."""
        return self.wrong or self.reach <= _UNTOLD.get(self.kind, 1.0) * self.band

    @property
    def borderline(self) -> bool:
        """Whether a slightly other band would say otherwise."""
        return 0.75 * self.band <= abs(self.off.value) <= 1.33 * self.band


def judged_by(a: Assessment, bands: Bands) -> Discrepancy | None:
    """The measure of what a loop would feel: as the axis where that explains the log, else as motion."""
    axis = a.as_axis
    if axis is not None and (
        axis.reached <= bands.unexplained * a.noise or axis.rmse > bands.attainable * axis.reached
    ):
        return axis
    return a.as_motion


def measures(a: Assessment, bands: Bands) -> list[Measure]:
    """Gain and phase, and delay and friction where they are known; empty where nothing is.

    Of a log with one level of command each way that is judged as motion, or of which more than noise is left beside
    the best axis, which then takes what it lacks for gain or friction: the speed in place of these two.
    """
    found = judged_by(a, bands)
    if found is None:
        return []
    listed = _gain_and_phase(found, bands)
    if (motion := a.as_motion) is not None and found is not motion and motion.rmse <= AS_NOISE * a.noise:
        # the model leaves noise alone: what the parameters of an axis leave open, the motion itself may tell
        beside = _gain_and_phase(motion, bands)
        listed = [b if not m.told and b.told and not b.wrong else m for m, b in zip(listed, beside, strict=True)]
    together = tells_speed_alone(a, found)
    if together and motion is not None:
        listed[0] = _gain_and_phase(motion, bands)[0]
    if found.delay is not None:
        listed.append(Measure("delay", found.delay, max(bands.delay, 1.5 * a.log.sample_period), found.by_chance))
    if found.friction is not None and not together:
        listed.append(Measure("friction", found.friction, bands.friction_percent, found.by_chance))
    return listed


def tells_speed_alone(a: Assessment, found: Discrepancy) -> bool:
    """Whether gain and friction of `found`, by which the log is judged, cannot be told apart: see `measures`."""
    if a.as_motion is None or a.as_motion.speed is None:
        return False
    return found is a.as_motion or found.reached > EXPLAINED * a.noise


def _gain_and_phase(found: Discrepancy, bands: Bands) -> list[Measure]:
    kind, off = ("gain", found.gain) if found.speed is None else ("speed", found.speed)
    return [
        Measure(kind, off, bands.gain_percent, found.by_chance),
        Measure("phase", found.phase, bands.phase_degrees, found.by_chance),
    ]


def frequency_told(a: Assessment, bands: Bands) -> float | None:
    """The frequency in Hz up to which the phase is within its band for sure; None where that is the intended one.

    It is below the intended one: what is left open there is left open beyond it.
    """
    found = judged_by(a, bands)
    if found is None:
        return None
    phase = next(measure for measure in measures(a, bands) if measure.kind == "phase")
    if phase.told:
        return None
    lag = abs(found.lag.value) + _LIKELY * found.lag.error
    by_lag = bands.phase_degrees / 360.0 / lag if isfinite(lag) and lag > 0.0 else 0.0
    return min(by_lag, found.frequency * bands.phase_degrees / phase.reach)


def slight(a: Assessment, bands: Bands) -> bool:
    """Whether all that the model is off by is known, and far within the bands, or noise is all that is left of the log.

    No test of the residual, and no error that noise makes, matters then.
    """
    found = [m for m in measures(a, bands) if m.kind in ("gain", "speed", "phase")]
    if found and as_good(a) and all(m.told and not m.wrong for m in measures(a, bands) if m.kind != "friction"):
        return True
    if a.free_run is None or not found or any(m.reach > _SLIGHT * m.band for m in found):
        return False
    position, velocity = _SLIGHT_FIT
    near = a.free_run.fit_percent >= position or as_good(a)
    return near and (a.velocity is None or a.velocity.fit_percent >= velocity or as_good_velocity(a))
