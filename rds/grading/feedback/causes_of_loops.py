"""Where a loop lacks margin: its locus near -1, and which change of the law moves it away from there, computed."""

from __future__ import annotations

import numpy as np

from rds.core.colours import BLUE, GREEN, VERMILLION
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.criteria.linear import LinearLoop, NoLoop
from rds.grading.feedback.advice import Cause
from rds.grading.feedback.causes_of_errors import error_panels, wrong_sign
from rds.grading.feedback.chart import Curve, Panel
from rds.grading.grade import CriterionScore
from rds.identification.robustness.margins import margins_of

_GRID = 1 << 14
_NEAR = 3.0  # around the origin: what of the locus is drawn
_WORTH = 1.02  # times as far from -1: less is no help
_PLACE = {"gain-margin": 0, "phase-margin": 1}  # of what `margins_of` gives; all else goes by the distance from -1


def cause(run: CaseRun, criterion: Criterion, score: CriterionScore) -> Cause:
    """The change, of a few, that helps the margin the most."""
    loops = [loop for loop in run.linear or () if isinstance(loop, LinearLoop)]
    if not loops:
        grows = any(isinstance(loop, NoLoop) and loop.is_known for loop in run.linear or ())
        mend = " Take less gain, or give it more damping (more derivative action)." if grows else ""
        if away := next(filter(None, (wrong_sign(run, axis) for axis in run.result.axes)), ""):
            mend = f" {away}"
        return Cause(score.sentence + mend, error_panels(run))
    loop = min(loops, key=lambda each: each.margins[2])
    w, locus = loop.locus(_GRID)
    place = _PLACE.get(criterion.kind, 2)
    crossover = w[np.argmax(np.abs(locus) < 1.0)] or w[0]
    derivative = 0.5 / crossover  # s: half a radian of lead where the gain is one
    changes = {
        "less gain, 70 % of what it is": 0.7 * locus,
        "half the gain": 0.5 * locus,
        "more gain, 140 % of what it is": 1.4 * locus,
        f"more damping, a derivative part of {1e3 * derivative:.3g} ms times the gain": locus
        * (1 + 1j * w * derivative),
    }
    before = margins_of(w, locus[None])[0]
    after = {name: margins_of(w, each[None])[0] for name, each in changes.items()}
    best = max(after, key=lambda name: _size(after[name][place]))
    near = f"The loop comes as near to -1 as {before[2]:.3g}"
    curves = [_curve("loop", locus, BLUE, 1.6), Curve("-1", np.array([-1.02, -0.98]), np.zeros(2), VERMILLION, 6.0)]
    if not _size(after[best][place]) > _WORTH * _size(before[place]):
        said = (
            f"{near}, and neither gain nor damping alone mends it: delay, or a filter that is too slow, takes the "
            "phase."
        )
        return Cause(said, (_panel(curves),))
    curves.append(_curve(f"with {best.partition(',')[0]}", changes[best], GREEN, 1.3, "6 3"))
    names = (("gain margin", "dB"), ("phase margin", "°"), ("distance from -1", ""))
    title, unit = names[place]
    now, then = (_margin(each[place], unit) for each in (before, after[best]))
    said = f"{near}. With {best}, the {title} would be {then} instead of {now}, all else as it is."
    return Cause(said, (_panel(curves),))


def _margin(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip() if np.isfinite(value) else "unlimited"


def _size(value: float) -> float:
    return float(np.nan_to_num(value, nan=0.0, posinf=1e6))


def _curve(label: str, locus: np.ndarray, colour: str, width: float, dashes: str = "") -> Curve:
    shown = np.abs(locus) <= _NEAR
    real, imaginary = np.where(shown, locus.real, np.nan), np.where(shown, locus.imag, np.nan)
    kept = np.flatnonzero(shown)
    part = slice(kept[0], kept[-1] + 1) if len(kept) else slice(0, 1)
    return Curve(label, real[part], imaginary[part], colour, width, dashes, expected=True)


def _panel(curves: list[Curve]) -> Panel:
    return Panel(curves, "imaginary part of the loop", "real part of the loop", is_path=True)
