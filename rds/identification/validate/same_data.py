"""Whether a log is the data that a model was fitted on: by file and rows, and by what it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rds.identification.logs.fingerprint import shared
from rds.identification.logs.log import Log
from rds.identification.logs.trace import retraced

if TYPE_CHECKING:
    from rds.identification.validate.candidate import Candidate


@dataclass(frozen=True)
class Overlap:
    """The share (0 to 1) of the log that the fit has seen, and how that is known; `known` is false where nothing is.

    `how` is a sentence's part: the same file, or the same numbers.
    """

    share: float
    how: str
    known: bool


def overlap(candidate: Candidate, log: Log) -> Overlap:
    """What of `log` is among the data that `candidate` was fitted on."""
    if not candidate.fitted_on:
        return Overlap(0.0, "nothing is recorded of the data that the model was fitted on", known=False)
    prints = [str(fitted["fingerprint"]) for fitted in candidate.fitted_on if fitted.get("fingerprint")]
    hashes = [str(fitted["sha256"]) for fitted in candidate.fitted_on if fitted.get("sha256")]
    alike = shared(log, prints)
    rows = _rows_seen(candidate, log) if log.sha256 in hashes and log.sha256 else 0.0
    if rows > 0.0:
        return Overlap(rows, f"the file is one that the model was fitted on ({log.source or log.name})", known=True)
    if alike > 0.0:
        if log.sha256 and log.sha256 in hashes:
            how = "these are other rows of the fit's file, but hold the same numbers again: does the command repeat?"
        else:
            how = "the file is another, but holds the same numbers as the fit's data"
        return Overlap(alike, how, known=True)
    traced = [fitted for fitted in candidate.fitted_on if fitted.get("trace")]
    again = max((retraced(log, str(f["trace"]), float(f.get("resolution") or 0.0)) for f in traced), default=0.0)
    if again > 0.0 and not (log.sha256 and log.sha256 in hashes):
        how = "other numbers, but the same motion as the fit's data, at the same times and within the noise"
        return Overlap(again, how, known=True)
    known = bool(prints or (hashes and log.sha256))
    if known:
        return Overlap(0.0, "other data than the fit's", known=True)
    return Overlap(0.0, "nothing tells whether these are the data that the model was fitted on", known=False)


def _rows_seen(candidate: Candidate, log: Log) -> float:
    """The share of the log's rows within the stretches that were fitted of the same file and axis."""
    length = len(log)
    begin = log.first
    seen = 0
    for fitted in candidate.fitted_on:
        if fitted.get("sha256") != log.sha256 or (fitted.get("name") and fitted["name"] != log.name):
            continue
        if "first" not in fitted or "end" not in fitted:
            return 1.0  # of the file, and nothing says which rows
        seen += max(0, min(int(fitted["end"]), begin + length) - max(int(fitted["first"]), begin))
    return min(seen / length, 1.0)
