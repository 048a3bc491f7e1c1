"""A result saved where the user wants it, besides the files that every run leaves."""

from __future__ import annotations

from pathlib import Path

from rds.core.errors import InputError
from rds.core.private_files import make_folder
from rds.results import Result

KINDS = (".csv", ".mat", ".parquet")


def save_as(result: Result, folder: Path, name: str) -> Path:
    """Save to the file `name`, counted from `folder`; its suffix is the kind. InputError where that will not do.

    A file that is there already stays: a result is not replaced by another one by a slip.
    """
    if not name.strip():
        raise InputError(f"say where to: a name that ends with {', '.join(KINDS)}")
    path = folder / name.strip()
    if path.suffix not in KINDS:
        raise InputError(f"{path.name!r} must end with {', '.join(KINDS)}, which says the kind of file")
    if path.exists():
        raise InputError("there is such a file already; choose another name", str(path))
    try:
        make_folder(path.parent)
    except OSError as error:
        raise InputError(f"cannot be made: {error.strerror}", str(path.parent)) from error
    return result.save(path)
