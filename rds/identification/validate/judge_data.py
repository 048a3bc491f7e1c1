"""What the log itself says about a verdict by it: whether it is new, moves, is sound, and what it did not try."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

from rds.identification.fit.upsets import upsets
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.plausibility import held
from rds.identification.logs.slips import late
from rds.identification.validate.assessment import Assessment, largest
from rds.identification.validate.conclusion import DATA
from rds.identification.validate.verdict import Bands, Reason, Side
from rds.identification.validate.within import AS_NOISE

_MISLEADING = ("sign", "units", "columns", "wrap")  # findings of a log after which a good fit proves nothing
_IDENTICAL = 1e-9  # RMSE over the motion: only the model's own output comes so near


def of_data(a: Assessment, bands: Bands) -> Iterator[Reason]:
    """Whether the data are new, and hold a motion that tells anything."""
    log, resolution = a.log, a.log.resolution or 0.0
    if a.overlap.share > bands.seen:
        yield Reason(
            Side.CANNOT_TELL,
            "same-data",
            f"{100 * a.overlap.share:.0f} % of the log was seen by the fit ({a.overlap.how}): how well the model "
            "repeats it says nothing of other data; validate on another log",
        )
    elif not a.overlap.known:
        yield Reason(Side.NOTE, "provenance", f"{a.overlap.how}; make sure that they are others")
    if a.motion == 0.0:
        yield Reason(Side.CANNOT_TELL, "no-motion", f"the axis never moves ({a.measured[0]:.6g} {a.unit} throughout)")
    elif a.motion < bands.steps(log.is_rate) * resolution:
        steps, whose = a.motion / resolution, "its resolution" if log.is_rate else "its encoder"
        yield Reason(
            Side.CANNOT_TELL,
            "no-motion",
            f"the axis moves {a.motion:.4g} {a.unit}, {steps:.0f} steps of {whose}; {bands.steps(log.is_rate):.0f} are "
            "needed to tell a model from none",
        )
    elif float(a.measured.std()) <= AS_NOISE * a.noise:
        yield Reason(
            Side.CANNOT_TELL,
            "no-motion",
            f"the position varies by {a.measured.std():.3g} {a.unit} (RMS), which is its noise alone: the axis did not "
            "move, or not enough to show (play, friction)",
        )
    elif a.changes < bands.least_changes:
        yield Reason(
            Side.CANNOT_TELL,
            "short",
            f"in {a.time[-1] - a.time[0]:.3g} s the velocity changes between fast and slow, or forward and back, "
            f"{a.changes} times; {bands.least_changes:.0f} are needed to see any dynamics",
        )
    if float(log.command.min()) == float(log.command.max()):
        yield Reason(
            Side.CANNOT_TELL,
            "no-excitation",
            f"the command is {log.command[0]:.4g} {log.units.get('command', 'V')} throughout: it excites no dynamics",
        )
    if (disturbed := held(log)) is not None:  # of this log: it may be a part of another, which has moved
        yield Reason(Side.CANNOT_TELL, disturbed.kind, disturbed.what)
    for finding in log.findings:
        if finding.gravity is not Gravity.NOTE and finding.kind != "disturbed":
            yield Reason(_side_of(finding), f"{DATA}{finding.kind}", finding.what)
    yield from _too_good(a, bands)


def _side_of(finding: Finding) -> Side:
    """What speaks against a log speaks against what a model shows there: both may share a sign or a unit that is wrong.

    That samples are missing at its end, and what only the excitation lacks, takes nothing from the rest.
    """
    if finding.kind not in _MISLEADING:
        return Side.NOTE
    return Side.CANNOT_TELL if finding.gravity is Gravity.FAULT else Side.AGAINST


def _too_good(a: Assessment, bands: Bands) -> Iterator[Reason]:
    if a.free_run is None or a.motion == 0.0:
        return
    if a.free_run.rmse <= _IDENTICAL * a.motion:
        yield Reason(
            Side.CANNOT_TELL,
            "own-output",
            f"the model repeats the log to {a.free_run.rmse:.1g} {a.unit}: the log is this model's own output",
        )
    elif a.log.resolution and a.free_run.rmse < bands.floor * a.log.resolution / sqrt(12.0):
        yield Reason(
            Side.CANNOT_TELL,
            "too-good",
            f"the RMSE of {a.free_run.rmse:.2g} {a.unit} is below the encoder's own rounding "
            f"({a.log.resolution / sqrt(12.0):.2g} {a.unit}): the log is not what this encoder measured, or the "
            "stated resolution is wrong",
        )


def of_upsets(a: Assessment) -> Iterator[Reason]:
    """Where in time the log does something else; the verdict is on the whole."""
    if a.free_run is None or a.motion == 0.0:
        return
    for sentence in upsets(a.time, a.residual, a.noise, a.unit, a.modelled, a.log.resolution, late(a.log)):
        yield Reason(Side.NOTE, "upset", sentence)


def of_extent(a: Assessment, bands: Bands) -> Iterator[Reason]:
    """Speeds and commands beyond those of the fit's data."""
    for name, found in a.ranges.items():
        if found.fitted is None:
            continue
        here, fitted = largest(found.here), largest(found.fitted)
        if here > bands.beyond * fitted:
            yield Reason(
                Side.NOTE,
                "extrapolation",
                f"{name} up to {here:.3g} {found.unit} here, and up to {fitted:.3g} {found.unit} in the fit's data: "
                "beyond that the model extrapolates",
            )
