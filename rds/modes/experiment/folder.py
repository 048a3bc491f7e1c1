"""The folder that a run's results go to: whether they can, known before the run begins."""

from __future__ import annotations

import datetime
import secrets
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rds.core.errors import InputError

_FILES = ("result.csv", "result.json", "result.mat", "result.parquet")
_OF_A_RUN = {"result.csv": b"_measured [", "result.json": b'"rds result"'}  # what stands at the begin of each
_BEGIN = 10_000  # bytes


def new_folder(names: Sequence[str], mode: str) -> Path:
    """Where the results of a run of these axes go when nobody says: a new folder under `runs/`."""
    stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    return Path("runs") / f"{stamp}-{'-'.join(names)}-{mode}-{secrets.token_hex(4)}"


def require_writable(folder: str | Path) -> None:
    """InputError unless files can be written into `folder`, which need not be there yet; nothing is left there.

    So is a folder that holds files of these names which are no run's: a run would replace them.
    """
    folder = Path(folder)
    place = folder
    try:
        while not place.is_dir():
            if place.exists() or place.is_symlink():
                raise InputError("is a file, not a folder; name another folder for the results", str(place))
            place = place.parent
        with tempfile.TemporaryFile(dir=place):
            pass
        if foreign := _foreign(folder):
            raise InputError("is there already, and is no result of a run; name another folder", str(foreign))
    except OSError as error:
        said = error.strerror or error
        raise InputError(f"results cannot be written there ({said}); name another folder", str(folder)) from error


def _foreign(folder: Path) -> Path | None:
    """A file that a run would replace there, and that is none of an earlier run's."""
    there = [folder / name for name in _FILES if (folder / name).is_file()]
    return there[0] if there and not any(map(_is_of_a_run, there)) else None


def _is_of_a_run(path: Path) -> bool:
    with path.open("rb") as file:
        return path.name in _OF_A_RUN and _OF_A_RUN[path.name] in file.read(_BEGIN)


def holds_result(folder: str | Path) -> bool:
    """Whether a run has left its result or its record there, which another run into it replaces."""
    try:
        if _foreign(Path(folder)):  # then no run goes into it
            return False
    except OSError:  # told where the run would write
        return False
    return any(any(Path(folder).glob(pattern)) for pattern in ("result.*", "record.rds"))
