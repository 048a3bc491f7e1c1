"""Logs that come with the package: the mini CNC's axes and spindle, 10 s at 1 kHz, twice. Offline, and checksummed.

`python -m rds.identification.data.make` made them, with our own modules in system test mode.
"""

from __future__ import annotations

import hashlib
from importlib.resources import files
from pathlib import Path

from rds.core.errors import InputError
from rds.identification.logs.log import Log

_SUMS = "SHA256SUMS"


def names() -> list[str]:
    """What there is: "mini-cnc-X-steps" (to fit), "mini-cnc-X-sines" (to validate with), and so on."""
    return sorted(name.removesuffix(".parquet") for name in _sums())


def path(name: str) -> Path:
    """The file of one of `names()`, once its SHA-256 has been checked; InputError if it is unknown or damaged."""
    sums = _sums()
    file = f"{name}.parquet"
    if file not in sums:
        raise InputError(f"there is no shipped log {name!r}; there are {', '.join(names())}")
    found = Path(str(files("rds.identification.data").joinpath(file)))
    try:
        data = found.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; install rds again", str(found)) from error
    if hashlib.sha256(data).hexdigest() != sums[file]:
        raise InputError("it is not what was shipped (SHA-256); install rds again", str(found))
    return found


def log(name: str) -> Log:
    """One of the logs."""
    from rds.identification.logs.read_log import read_log

    (found,) = read_log(path(name))
    return found


def logs() -> dict[str, Log]:
    """All of them, by name."""
    return {name: log(name) for name in names()}


def _sums() -> dict[str, str]:
    """SHA-256 by file name."""
    text = files("rds.identification.data").joinpath(_SUMS).read_text(encoding="utf-8")
    return {file: digest for digest, file in (line.split() for line in text.splitlines())}
