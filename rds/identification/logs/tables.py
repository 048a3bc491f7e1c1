"""One door to files of logged data: a format is a row of `FORMATS`, and its endings reach every list of them."""

from __future__ import annotations

import codecs
import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from rds.bus.tools.log_formats import ENDINGS as BUS_ENDINGS
from rds.bus.tools.log_formats import PACKED, READ_ONLY
from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.identification.logs.signatures import unpacked_start, what_it_is
from rds.identification.logs.table import Table

TEXTS = (".csv", ".txt", ".dat", ".tsv", ".prn", ".lvm")
MEASUREMENTS = (".mf4", ".mdf", ".dat")  # of which some are text, and some bus logs
# what of other programs is not read, and which export of theirs is
_EXPORTS = {
    ".toml": "a model, a map or an experiment, and no log: `rds validate` takes the model first, then logs",
    ".tdms": "NI's TDMS: in LabVIEW write the channels by `Write To Measurement File` as text (LVM); or in Python "
    "`nptdms.TdmsFile.read(FILE).as_dataframe(time_index=True).to_csv('log.csv', index_label='time [s]')`; where "
    "that says that no time properties are available, `as_dataframe().to_csv('log.csv', index=False)`, and the rate of "
    "the samples in a map",
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
        "a recording of ROS: export the topics as CSV, as PlotJuggler does (of several topics, a map says "
        'blanks = "hold"), or `ros2 topic echo`',
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
    rb"timestamp,arbitration_id,|time ?stamp,\s*id,\s*extended,|\s*\([\d. :-]{3,30}\)\s+\S+\s+[\dA-F]+(?:#|\s+\[)|"
    rb"\s+\S+\s+[\dA-F]{3,8}\s+\[\d+\]",  # candump without times, which its reader refuses
    re.IGNORECASE,
)


class ReadOptions(NamedTuple):
    """What a map says of a file beside its name, and who hears how far its reading has come."""

    delimiter: str | None = None
    decimal: str | None = None
    dbc: Sequence[Path] = ()
    progress: Progress | None = None


class DataFormat(NamedTuple):
    """A format of logged data. A file is of it by its ending and, where there is `is_one`, by what that says of it."""

    title: str
    endings: Sequence[str]
    read: Callable[[Path, ReadOptions], Table]
    is_one: Callable[[Path, ReadOptions], bool] | None = None


def _late(module: str, name: str, *asks: str) -> Callable[[Path, ReadOptions], Any]:
    """The function `name(path)` of a module beside this one, imported on use; of what was asked it takes `asks`."""

    def call(path: Path, asked: ReadOptions) -> Any:
        function = getattr(import_module(f"rds.identification.logs.{module}"), name)
        return function(path, **{each: getattr(asked, each) for each in asks})

    return call


def _is_of_frames(path: Path, asked: ReadOptions) -> bool:
    from rds.bus.tools.logs import is_of_frames

    return bool(asked.dbc) or is_of_frames(path)


def _is_of_bus(path: Path, asked: ReadOptions) -> bool:
    """Whether a text is python-can's CSV, SavvyCAN's and GVRET's, or candump's by another name."""
    with open(path, "rb") as stream:
        return _OF_BUS.match(stream.read(60).removeprefix(codecs.BOM_UTF8)) is not None


def _packed_table(path: Path) -> str:
    """What to do with a gzip file that holds no bus log; "" for another file."""
    name = path.name.lower()
    if not name.endswith(".gz") or (name.endswith(PACKED) and not name.endswith(".csv.gz")):
        return ""
    start = unpacked_start(path)
    if name.endswith(".csv.gz") and (not start or _OF_BUS.match(start.removeprefix(codecs.BOM_UTF8))):
        return ""
    return "only bus logs are read as they are packed; unpack it, as by `gunzip -k FILE`"


_read_csv = _late("csv_table", "read_csv", "delimiter", "decimal", "progress")
_read_can = _late("can_table", "read_can", "dbc", "progress")


def _read_terminal(path: Path, asked: ReadOptions) -> Table:
    """What a terminal has saved, which it calls .log as candump does."""
    try:
        table: Table = _read_csv(path, asked)
        return table
    except InputError as error:
        what = str(error).removeprefix(f"{error.where}: ")
        raise InputError(f"{what}; nor is it a log of frames, as `candump -L` writes", error.where) from error


def _without_measurements(path: Path, asked: ReadOptions) -> Table:
    raise InputError("it is no MDF file with measurements; let the name of a bus log end in .mf4")


_OF_FRAMES = tuple(each for each in (*BUS_ENDINGS, *READ_ONLY) if each not in TEXTS)
FORMATS: tuple[DataFormat, ...] = (  # the first that a file is of reads it
    DataFormat(
        "measurements in MDF",
        MEASUREMENTS,
        _late("mf4_channels", "read_channels"),
        _late("mf4_channels", "is_measurement"),
    ),
    DataFormat(
        "LinuxCNC's halscope",
        (*TEXTS, ".log"),
        _late("halscope_table", "read_halscope"),
        _late("halscope_table", "is_halscope"),
    ),
    DataFormat(
        "labelled numbers of a serial plotter",
        (*TEXTS, ".log"),
        _late("labelled_table", "read_labelled"),
        _late("labelled_table", "is_labelled"),
    ),
    DataFormat(
        "columns that a terminal has saved",
        (".log",),
        _read_terminal,
        lambda path, asked: not _is_of_frames(path, asked),
    ),
    DataFormat("", (".mdf",), _without_measurements),
    DataFormat("a bus log", (*_OF_FRAMES, ".gz"), _read_can),
    DataFormat("a bus log", TEXTS, _read_can, _is_of_bus),
    DataFormat("a trace of CODESYS", TEXTS, _late("codesys_table", "read_trace"), _late("codesys_table", "is_trace")),
    DataFormat(
        "a measurement of LabVIEW",
        TEXTS,
        _late("labview_table", "read_labview"),
        _late("labview_table", "is_labview"),
    ),
    DataFormat("columns of text", TEXTS, _read_csv),
    DataFormat("vectors of MATLAB", (".mat",), _late("other_tables", "read_mat")),
    DataFormat("numeric columns", (".parquet",), _late("other_tables", "read_parquet")),
)


def endings() -> tuple[str, ...]:
    """The endings of the files that are read: texts, other tables, bus logs."""
    every = (ending for each in FORMATS for ending in each.endings if ending not in _OF_FRAMES)
    return tuple(dict.fromkeys((*TEXTS, *every, *_OF_FRAMES)))


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
    ending, asked = path.suffix.lower(), ReadOptions(delimiter, decimal, dbc, progress)
    try:
        if told := what_it_is(path, ending, (*TEXTS, ".log")) or _packed_table(path):
            raise InputError(told)
        fitting = (each for each in FORMATS if ending in each.endings and (not each.is_one or each.is_one(path, asked)))
        found = next(fitting, None)
        if found is None:
            told = f"it is {_EXPORTS[ending]}. Read" if ending in _EXPORTS else "known"
            told = told if ending else f"let the name of a table of text end in .csv; {told}"
            raise InputError(f"there is no log of the ending {ending!r}; {told}: {', '.join(endings())}")
        table = found.read(path, asked)
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
