"""The folder that a run's results go to: whether they can, known before the run begins."""

from __future__ import annotations

import datetime
import secrets
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rds.core.errors import InputError

_HEADING = b"time [s],"  # how the table of each run begins


def new_folder(names: Sequence[str], mode: str) -> Path:
    """Where the results of a run of these axes go when nobody says: a new folder under `runs/`."""
    stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    return Path("runs") / f"{stamp}-{'-'.join(names)}-{mode}-{secrets.token_hex(4)}"


def require_writable(folder: str | Path) -> None:
    """InputError unless files can be written into `folder`, which need not be there yet; nothing is left there.

    So is a folder that holds a `result.csv` of somebody else's, which a run would replace.
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
        table = folder / "result.csv"
        if _is_foreign(table):
            raise InputError("is there already, and is no result of a run; name another folder", str(table))
    except OSError as error:
        said = error.strerror or error
        raise InputError(f"results cannot be written there ({said}); name another folder", str(folder)) from error


def _is_foreign(table: Path) -> bool:
    if not table.is_file() or table.with_suffix(".json").exists():
        return False
    with table.open("rb") as file:
        return file.read(len(_HEADING)) != _HEADING


def holds_result(folder: str | Path) -> bool:
    """Whether a run has left its result or its record there, which another run into it replaces."""
    try:
        if _is_foreign(Path(folder) / "result.csv"):  # then no run goes into it
            return False
    except OSError:  # told where the run would write
        return False
    return any(any(Path(folder).glob(pattern)) for pattern in ("result.*", "record.rds"))
