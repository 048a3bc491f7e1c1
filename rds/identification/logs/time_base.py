"""The times of a log: increasing, and regular up to a stated limit; where they are not, the first sample is named."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.log import Finding, Gravity

_GAP = 1.5  # sample periods: a longer step has samples missing in it
_AGAIN = 2.0  # sample periods within which recordings begin at the same time
_HOUR = 3600.0  # s
_LEFT_OVER = 0.05  # of the samples: so many before the time goes back, once, may be left from before the recording
_ROUGH = 0.5  # periods: beyond it a step is hardly one of a regular recording
MOST_JITTER = 1.0  # periods
_ROUNDING = 1e-3  # of the period: less is rounding, and no jitter


@dataclass(frozen=True)
class TimeBase:
    """Which rows are used (`keep`, indices), in which stretches ([first, end) of the kept), with which period."""

    keep: np.ndarray
    stretches: tuple[tuple[int, int], ...]
    period: float  # s, the median step
    findings: tuple[Finding, ...]


def time_base(time: np.ndarray, jitter_limit: float, duplicates: str, gaps: str, where: str) -> TimeBase:
    """Judge the times `time` (s). `duplicates`: refuse or drop; `gaps`: refuse, split, or keep (the command was held).

    InputError at `where` for a time that goes back, fewer than two samples, and, naming the first sample, for
    duplicates and gaps that are to be refused and for a step further from the period than `jitter_limit` of it.
    """
    if len(time) < 2:
        raise InputError(f"it has {len(time)} sample{'s' * (len(time) != 1)}; a log needs two or more", where)
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if len(back):
        k = int(back[0]) + 1
        remedy = "is the column the time, and is it one recording? "
        if len(back) > 1 and np.ptp(time[[0, *(back + 1)]]) <= _AGAIN * float(np.median(np.abs(steps))):
            remedy = f"where {len(back) + 1} recordings stand one after another, put each into a file of its own. "
        remedy += "Of a counter that begins again, say in the map at which number, as in wrap = 65536 under [time]"
        if len(back) == 1 and _HOUR - 60.0 < -steps[k - 1] < _HOUR:
            remedy = (
                "a clock that is set back by an hour does so, as where summer time ends: log UTC, or give the later "
            )
            remedy += "rows their hour"
        elif len(back) == 1 and k <= _LEFT_OVER * len(time):
            rows = f"the first {k} rows of data are" if k > 1 else "the first row of data is"
            remedy = f"{rows} left from before the recording, as it seems: remove {'them' if k > 1 else 'it'}"
        raise InputError(
            f"time goes back at sample {k}, from {time[k - 1]:.9g} to {time[k]:.9g} s ({len(back)} such steps); "
            + remedy,
            where,
        )
    findings: list[Finding] = []
    keep = np.arange(len(time))
    twice = np.flatnonzero(steps == 0.0)
    if len(twice):
        k = int(twice[0]) + 1
        what = f"{len(twice)} samples have the time of the one before, the first is sample {k} ({time[k]:.9g} s)"
        if duplicates == "refuse":
            raise InputError(f'{what}; with duplicates = "drop" in the map the first of each is kept', where)
        keep = np.delete(keep, twice + 1)
        if len(keep) < 2:
            raise InputError("all samples have the same time; is the column the time?", where)
        steps = np.diff(time[keep])
        findings.append(Finding("duplicate", f"{what}; dropped", Gravity.WARNING, k))
    period = float(np.median(steps))
    stretches = [(0, len(keep))]
    wide = _with_missing(time[keep], np.flatnonzero(steps > _GAP * period), period)
    if len(wide):
        findings.append(_gaps(time[keep], steps, wide, period, gaps, where))
    if len(wide) and gaps == "split":
        ends = [0, *(wide + 1).tolist(), len(keep)]
        stretches = [(a, b) for a, b in pairwise(ends) if b - a >= 2]
    if gaps == "keep":
        wide = np.flatnonzero(steps > _GAP * period)  # samples that only came late, too
    steps = np.delete(steps, wide)
    findings += _jitter(time[keep], steps, wide, period, jitter_limit, where)
    return TimeBase(keep, tuple(stretches), period, tuple(findings))


def _with_missing(time: np.ndarray, wide: np.ndarray, period: float) -> np.ndarray:
    """The long steps in which samples are missing: not those after which late ones come until all are there."""
    lacking = np.minimum(np.rint((time[wide + 1] - time[wide]) / period) - 1.0, len(time)).astype(np.int64)
    after = wide + 1 + lacking  # where the log would be, had they only come late
    inside = after < len(time)
    made_up = np.zeros(len(wide), bool)
    made_up[inside] = time[after[inside]] - time[wide[inside]] < (lacking[inside] + _GAP) * period
    return wide[~made_up]


def _gaps(time: np.ndarray, steps: np.ndarray, wide: np.ndarray, period: float, gaps: str, where: str) -> Finding:
    k = int(wide[0]) + 1
    missing = int(np.rint(steps[wide] / period - 1.0).sum())
    what = (
        f"{len(wide)} gap{'s' * (len(wide) > 1)}, {missing} samples missing; the first before sample {k} "
        f"({time[k - 1]:.9g} s, then {time[k]:.9g} s, where the sample period is {period:.6g} s)"
    )
    if gaps == "refuse":
        raise InputError(
            f'{what}; at the top of the map, gaps = "split" makes a log of each stretch between gaps, and '
            '"keep" says that the command was held',
            where,
        )
    done = "split there" if gaps == "split" else "kept: the command is taken to have been held over them"
    return Finding("gap", f"{what}; {done}", Gravity.WARNING, k)


def _jitter(
    time: np.ndarray, steps: np.ndarray, wide: np.ndarray, period: float, limit: float, where: str
) -> list[Finding]:
    off = steps - period
    np.abs(off, out=off)
    worst = float(off.max(initial=0.0))
    deviation = float(np.std(steps))
    if worst <= _ROUNDING * period:
        what = f"regular: steps of {period:.9g} s, to {worst:.2g} s"
        return [Finding("jitter", what)]
    what = (
        f"the steps of the time are {period:.6g} s with a standard deviation of {deviation:.3g} s and at most "
        f"{worst:.3g} s ({100.0 * worst / period:.3g} % of the period) off"
    )
    if worst > limit * period * (1.0 + 1e-9):
        first = int(np.flatnonzero(off > limit * period * (1.0 + 1e-9))[0])
        k = first + int(np.searchsorted(wide - np.arange(len(wide)), first, side="right")) + 1
        remedy = f"a larger jitter_limit in the map (at most {MOST_JITTER:g}) takes the times as they are"
        if worst > MOST_JITTER * period:
            remedy = (
                f'no jitter_limit (at most {MOST_JITTER:g}) allows that: gaps = "keep" in the map says that samples '
            )
            remedy += "came late, and the command was held; else record at equal steps"
        raise InputError(
            f"{what}; beyond the limit of {100.0 * limit:g} % first at sample {k} ({time[k - 1]:.9g} s, then "
            f"{time[k]:.9g} s); {remedy}",
            where,
        )
    gravity = Gravity.NOTE if worst <= _ROUGH * period else Gravity.WARNING
    return [Finding("jitter", f"{what}; used as they are", gravity)]
