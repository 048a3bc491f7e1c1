"""Results saved and reopened: CSV, MAT and Parquet by suffix, or all three in a directory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rds.core.atomic import write_files
from rds.core.errors import InputError
from rds.core.extras import there
from rds.results.foreign import from_table
from rds.results.header import Contents, assemble

if TYPE_CHECKING:
    from rds.results.result import Result

Made = TypeVar("Made")

# in the order in which a directory's files are preferred
_FORMATS = {
    ".parquet": "rds.results.parquet_file",
    ".csv": "rds.results.csv_file",
    ".mat": "rds.results.mat_file",
}
_STEM = "result"
_RECORD = "record.rds"
_BESIDE = "changes.csv"  # of live values: no result
_SHOWN = 6  # names in a message


def save_result(result: Result, path: str | Path) -> Path:
    """Save to one file, in the format that its suffix names (.csv with a .json of the same name beside it).

    Nothing half-written is ever left. Raises InputError for an unknown suffix or a place that can't be written.
    """
    path = Path(path)
    write_files(_format(path).writers(result, path))
    return path


def save_all(result: Result, directory: str | Path) -> dict[str, Path]:
    """Save as result.csv, result.json, result.mat and result.parquet in `directory`; their paths by kind.

    Parquet is left out where pyarrow is not installed. Either all appear, complete, or none. Raises InputError if the
    directory cannot be written.
    """
    directory = Path(directory)
    writers: dict[Path, Any] = {}
    for suffix in _usable():
        path = directory / f"{_STEM}{suffix}"
        writers.update(_format(path).writers(result, path))
    write_files(writers)
    for suffix in _FORMATS.keys() - set(_usable()):  # an earlier run's, which would be opened in place of this one
        (directory / f"{_STEM}{suffix}").unlink(missing_ok=True)
    return {path.suffix.removeprefix("."): path for path in writers}


def new_folder(parent: str | Path, stem: str) -> Path:
    """The first of `stem`-1, `stem`-2, ... in `parent` that is not there; it is not made yet."""
    return next(path for k in count(1) if not (path := Path(parent) / f"{stem}-{k}").exists())


def saved_files(directory: str | Path) -> dict[str, Path]:
    """What `save_all` has left in `directory`: the paths by kind."""
    directory = Path(directory)
    return {suffix.removeprefix("."): directory / f"{_STEM}{suffix}" for suffix in (*_usable(), ".json")}


def read_saved(path: str | Path, make: Callable[..., Made]) -> Made:
    """`make(columns, units, meta)` of what is saved at `path`; see `rds.results.result.open_result`.

    InputError names the file that it was read from, also for what `make` refuses.
    """
    path = Path(path)
    try:
        if path.is_dir():
            path = _choose(path)
        if path.name == _RECORD:
            return make(*from_record(path.parent))
        if not path.exists():
            raise InputError("there is no such file; give a saved result (.parquet, .csv, .mat) or its folder")
        columns, header = _format(path).read(path)
        return make(*(from_table(columns) if header is None else assemble(columns, header)))
    except InputError as error:
        if error.where is not None:
            raise
        raise InputError(str(error), str(path)) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", str(path)) from error


def _format(path: Path) -> Any:
    module = _FORMATS.get(path.suffix.lower())
    if module is None:
        raise InputError(f"unknown suffix {path.suffix!r}; results are {', '.join(_FORMATS)}", str(path))
    return import_module(module)


def _usable() -> list[str]:
    """The formats that can be written and read here."""
    return [suffix for suffix in _FORMATS if suffix != ".parquet" or there("pyarrow")]


def _choose(directory: Path) -> Path:
    """The one result in `directory`; InputError lists them if there are several or none."""
    known = [
        file
        for file in sorted(directory.iterdir())
        if file.suffix.lower() in _FORMATS and file.is_file() and file.name != _BESIDE
    ]
    stems = sorted({file.stem for file in known})
    stem = _STEM if _STEM in stems else stems[0] if len(stems) == 1 else None
    if stem is not None:
        return next(
            directory / f.name
            for suffix in dict.fromkeys((*_usable(), *_FORMATS))
            for f in known
            if (f.stem, f.suffix.lower()) == (stem, suffix)
        )
    if stems:
        raise InputError(f"holds several results ({_some([file.name for file in known])}); name one of the files")
    if (directory / _RECORD).is_file():
        return directory / _RECORD
    inside = [d.name for d in sorted(directory.iterdir()) if d.is_dir() and _holds_result(d)]
    if inside:
        raise InputError(f"holds results in directories of their own ({_some(inside)}); name one of them")
    raise InputError(f"holds no result; it needs {', '.join(_STEM + suffix for suffix in _FORMATS)} or {_RECORD}")


def _some(names: Sequence[str]) -> str:
    """The first few names, and how many more there are."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def _holds_result(directory: Path) -> bool:
    return any(f.name == _RECORD or (f.stem == _STEM and f.suffix in _FORMATS) for f in directory.iterdir())


def from_record(directory: str | Path) -> Contents:
    """The result in the record of `directory`, up to its last whole row.

    It has the columns that the loop recorded and no verdict: that needs the plan of the run. Raises InputError for a
    record that cannot be read.
    """
    # imported here: a saved result opens without the runtime
    from rds.modes.process.record import read_record

    columns, units, meta = read_record(directory)
    meta["notes"] = [f"{note}, no verdict and no simulation" for note in meta["notes"]]
    if "program_line" in columns and len(columns["program_line"]):
        meta["notes"].append(f"the part program was in line {columns['program_line'][-1]:.0f}")
    return Contents(columns, units, meta)
