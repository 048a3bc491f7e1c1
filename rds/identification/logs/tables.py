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
# what of other programs is not read, and which export of theirs is
_EXPORTS = {
    ".tdms": "NI's TDMS: in LabVIEW write the channels by `Write To Measurement File` as text (LVM); or in Python "
    "`nptdms.TdmsFile.read(FILE).as_dataframe(time_index=True).to_csv('log.csv', index_label='time [s]')`",
    **dict.fromkeys(
        (".xlsx", ".xls", ".ods"),
        "a spreadsheet: save the sheet with the samples as CSV (UTF-8), with the units in its headings (`pos [mm]`)",
    ),
    ".feather": "Arrow's Feather: in Python `pandas.read_feather(FILE).to_parquet('log.parquet')`",
    **dict.fromkeys(
        (".pkl", ".pickle"),
        "a pickle, which can run anything: if you trust it, type `pandas.read_pickle(FILE).to_parquet('log.parquet')`",
    ),
    **dict.fromkeys(
        (".npz", ".npy"),
        "NumPy's: in Python `numpy.savetxt('log.csv', numpy.column_stack([t, u, y]), delimiter=',', "
        "header='t [s],u [V],y [mm]')`",
    ),
    **dict.fromkeys(
        (".h5", ".hdf5", ".hdf"),
        "HDF5, in which each program has an order of its own: save time, command and position as CSV or Parquet, in "
        "Python by `pandas.DataFrame({'t [s]': file['t'][:], ...}).to_parquet('log.parquet')` of `h5py.File(FILE)`",
    ),
    **dict.fromkeys(
        (".bag", ".db3", ".mcap"),
        "a recording of ROS: export the topic as CSV, as PlotJuggler does, or `ros2 topic echo`",
    ),
    ".json": "JSON: save the signals as columns of CSV, in Python by "
    "`pandas.DataFrame({'t [s]': ..., 'u [V]': ..., 'y [mm]': ...}).to_csv('log.csv', index=False)`",
    **dict.fromkeys(
        (".jsonl", ".ndjson"),
        "lines of JSON: in Python `pandas.read_json(FILE, lines=True).to_csv('log.csv', index=False)`",
    ),
    ".svdx": "TwinCAT's scope: export it as CSV, with semicolons",
    **dict.fromkeys((".isf", ".wfm", ".bin", ".psdata"), "an oscilloscope's own: save its channels as CSV"),
    ".fig": "a figure of MATLAB: save the vectors that it shows as a MAT file",
}
_OF_BUS = re.compile(
    rb"timestamp,arbitration_id,|time ?stamp,\s*id,\s*extended,|\s*\([\d. :-]{3,30}\)\s+\S+\s+[\dA-F]+(?:#|\s+\[)",
    re.IGNORECASE,
)


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
    from rds.identification.logs import codesys_table, halscope_table, labelled_table, mf4_channels

    ending = path.suffix.lower()
    try:
        if ending in MEASUREMENTS and mf4_channels.is_measurement(path):
            table = mf4_channels.read_channels(path)
        elif ending in (*TEXTS, ".log") and halscope_table.is_halscope(path):
            table = halscope_table.read_halscope(path)
        elif ending in (*TEXTS, ".log") and labelled_table.is_labelled(path):
            table = labelled_table.read_labelled(path)
        elif ending == ".log" and not dbc and not _is_of_frames(path):
            from rds.identification.logs.csv_table import read_csv

            try:
                table = read_csv(path, delimiter, decimal, progress)  # what a terminal has saved
            except InputError as error:
                what = str(error).removeprefix(f"{error.where}: ")
                raise InputError(f"{what}; nor is it a log of frames, as `candump -L` writes", error.where) from error
        elif ending == ".mdf":
            raise InputError("it is no MDF file with measurements; let the name of a bus log end in .mf4")
        elif ending in BUSES or ending == ".gz" or (ending in TEXTS and _is_of_bus(path)):
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
            told = f"it is {_EXPORTS[ending]}. Read" if ending in _EXPORTS else "known"
            raise InputError(f"there is no log of the ending {ending!r}; {told}: {known}")
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


def _is_of_frames(path: Path) -> bool:
    from rds.bus.tools.logs import is_of_frames

    return is_of_frames(path)


def _is_of_bus(path: Path) -> bool:
    """Whether a text is python-can's CSV, SavvyCAN's and GVRET's, or candump's by another name."""
    with open(path, "rb") as stream:
        return _OF_BUS.match(stream.read(60).removeprefix(codecs.BOM_UTF8)) is not None
