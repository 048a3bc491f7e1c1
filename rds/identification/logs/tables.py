"""One door to files of logged data, by the ending of their names."""

from __future__ import annotations

import codecs
import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rds.core.errors import InputError
from rds.identification.logs.table import Table

Progress = Callable[[int, int], None]
TEXTS = (".csv", ".txt", ".dat", ".tsv", ".prn", ".lvm")
BUSES = (".asc", ".blf", ".log", ".trc", ".mf4", ".db", ".can", ".crtd")
MEASUREMENTS = (".mf4", ".mdf", ".dat")  # of which some are text, and some bus logs
_BUS_CSV = re.compile(rb"timestamp,arbitration_id,|time ?stamp,\s*id,\s*extended,", re.IGNORECASE)


def read_table(
    path: Path,
    delimiter: str | None = None,
    decimal: str | None = None,
    dbc: Sequence[Path] = (),
    progress: Progress | None = None,
) -> Table:
    """What a file holds, with its SHA-256. InputError, with the file, for one that cannot be read or is unknown."""
    if path.is_dir():
        raise InputError("it is a folder; name the file of data in it", str(path))
    if not path.is_file():
        raise InputError("there is no such file; check the name and the folder", str(path))
    from rds.identification.logs import codesys_table, mf4_channels

    ending = path.suffix.lower()
    try:
        if ending in MEASUREMENTS and mf4_channels.is_measurement(path):
            table = mf4_channels.read_channels(path)
        elif ending == ".mdf":
            raise InputError("it is no MDF file with measurements; let the name of a bus log end in .mf4")
        elif ending in BUSES or ending == ".gz" or (ending in TEXTS and _is_bus_csv(path)):
            from rds.identification.logs.can_table import read_can

            table = read_can(path, dbc, progress)
        elif ending in TEXTS and codesys_table.is_trace(path):
            table = codesys_table.read_trace(path)
        elif ending in TEXTS:
            from rds.identification.logs.csv_table import read_csv

            table = read_csv(path, delimiter, decimal, progress)
        elif ending in (".mat", ".parquet"):
            from rds.identification.logs import other_tables

            table = other_tables.read_mat(path) if ending == ".mat" else other_tables.read_parquet(path)
        else:
            known = ", ".join((*TEXTS, ".mat", ".parquet", *BUSES, ".mdf"))
            raise InputError(f"there is no log of the ending {ending!r}; known: {known}")
        unprintable = next((name for name in table.columns if not name.isprintable()), None)
        if unprintable is not None:  # it would command the terminal that it is shown on
            raise InputError(f"column {unprintable!r} has characters in its name that are no text; rename it")
        with open(path, "rb") as stream:
            return replace(table, sha256=hashlib.file_digest(stream, "sha256").hexdigest())
    except InputError as error:
        raise error if error.where else InputError(str(error), str(path)) from error
    except OSError as error:
        reason = error.strerror or f"{error}; it is cut or damaged: take another copy"
        raise InputError(f"it cannot be read: {reason}", str(path)) from error


def _is_bus_csv(path: Path) -> bool:
    """Whether a CSV file is python-can's, or SavvyCAN's and GVRET's."""
    with open(path, "rb") as stream:
        return _BUS_CSV.match(stream.read(60).removeprefix(codecs.BOM_UTF8)) is not None
