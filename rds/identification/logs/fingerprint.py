"""Whether two logs hold the same data, whatever their files are called, in which format, and where they were cut.

A log's fingerprint is the set of short hashes of its distinctive windows. Windows are chosen by what they hold, not by
where they are (Schleimer, Wilkerson and Aiken, "Winnowing", 2003), so that a cut, a shifted or a renamed copy chooses
the same ones. Only increments of position count, so that a copy with another zero is known as well.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.log import Log

_WINDOW = 32  # samples, a power of 2
_DISTINCT = 8  # different increments in a window, at least: rest and steady speed look alike in all logs
_DECIMALS = 6  # mm and V: below any encoder and converter, above what a change of units or a file's digits cost
_ONE_IN = 4  # of so many windows one is taken
_AT_ONCE = 128  # of the smallest hashes: whose windows are looked at together
_MOST = 64  # hashes that a fingerprint keeps: the smallest, which again depends on what they hold alone
_BASE = 0x9E3779B97F4A7C15  # of the polynomial; odd, so that no bit is lost


def fingerprint(log: Log) -> str:
    """The fingerprint of a log: hashes, separated by blanks; "" where it has no distinctive window."""
    return " ".join(f"{value:016x}" for value in _chosen(log, _MOST))


def shared(log: Log, fingerprints: Iterable[str]) -> float:
    """The share, 0 to 1, of the log's windows that are among the data of these fingerprints."""
    own, known = _chosen(log), [_hashes(text) for text in fingerprints]
    known = [hashes for hashes in known if len(hashes)]
    if not known:
        return 0.0
    # of data with more windows the smallest hashes were kept: those of the log are compared up to there
    cut = [int(hashes.max()) for hashes in known if len(hashes) >= _MOST]
    comparable = own[own <= np.uint64(min(cut))] if cut else own
    return len(np.intersect1d(np.concatenate(known), comparable)) / len(comparable) if len(comparable) else 0.0


def _hashes(text: str) -> np.ndarray:
    try:
        return np.array([int(value, 16) for value in text.split()], dtype=np.uint64)
    except (ValueError, OverflowError):
        raise InputError(f"fingerprint = {text!r:.60} must be hashes of 16 hexadecimal digits") from None


def _chosen(log: Log, most: int | None = None) -> np.ndarray:
    """The hashes of the log's distinctive windows, ascending, each once, the first `most`: (hashes,), uint64."""
    steps = np.rint(np.diff(log.position) * 10**_DECIMALS).astype(np.int64)
    command = np.rint(log.command[:-1] * 10**_DECIMALS).astype(np.int64)
    if len(steps) < _WINDOW:
        return np.empty(0, dtype=np.uint64)
    rows = _mixed(_mixed(steps.view(np.uint64)) + command.view(np.uint64))
    # a polynomial of each window's rows, in its base; that of twice as many rows joins two neighbours
    hashes, factor, width = rows, _BASE, 1
    while width < _WINDOW:
        hashes = hashes[:-width] * np.uint64(factor) + hashes[width:]
        factor, width = factor * factor % 2**64, 2 * width
    hashes = _mixed(hashes)
    taken = np.flatnonzero(hashes % np.uint64(_ONE_IN) == 0)
    values, first = np.unique(hashes[taken], return_index=True)
    windows = np.lib.stride_tricks.sliding_window_view(steps, _WINDOW)
    found: list[np.ndarray] = [values[:0]]
    for begin in range(0, len(values), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        distinct = 1 + (np.diff(np.sort(windows[taken[first[part]]], axis=1), axis=1) != 0).sum(axis=1)
        found.append(values[part][distinct >= _DISTINCT])
        if most is not None and sum(map(len, found)) >= most:
            break
    return np.concatenate(found)[:most]


def _mixed(values: np.ndarray) -> np.ndarray:
    """Bits spread over the whole word (the finalizer of Steele, Lea and Flood's SplitMix64, 2014)."""
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))
