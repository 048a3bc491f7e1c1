"""Results as MAT files (version 5): one column vector per column, and the description as JSON text.

In MATLAB: `load result.mat; about = jsondecode(rds_result); about.columns(1).unit`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from rds.core.errors import InputError
from rds.results.header import describe, parse

if TYPE_CHECKING:
    from rds.results.result import Result

_DESCRIPTION = "rds_result"
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")  # MATLAB's namelengthmax is 63


def writers(result: Result, path: Path) -> dict[Path, Callable[[BinaryIO], None]]:
    """What writes the file. A column whose name MATLAB cannot have is called `column_3` and the like there."""

    def write(stream: BinaryIO) -> None:
        from scipy.io import savemat

        header = describe(result)
        for entry, variable in zip(header["columns"], _variables([*result.columns]), strict=True):
            entry["variable"] = variable
        content: dict[str, Any] = {e["variable"]: result.columns[e["name"]] for e in header["columns"]}
        content[_DESCRIPTION] = json.dumps(header, allow_nan=False)
        file: Any = stream  # savemat takes open files, though its stubs know only paths
        savemat(file, content, long_field_names=True, do_compression=True, oned_as="column")

    return {path: write}


def _variables(names: list[str]) -> list[str]:
    taken = {_DESCRIPTION, *(name for name in names if _IDENTIFIER.fullmatch(name))}
    variables = []
    for index, name in enumerate(names):
        if not _IDENTIFIER.fullmatch(name) or name == _DESCRIPTION:
            name = f"column_{index}"
            while name in taken:
                name += "_"
            taken.add(name)
        variables.append(name)
    return variables


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any] | None]:
    """The columns, and the description where there is one. Reads numbers and text only; nothing in it is executed."""
    content = variables(path)
    text = content.get(_DESCRIPTION)
    if text is None:
        return _vectors(content), None
    if not isinstance(text, np.ndarray) or text.dtype.kind != "U" or text.size != 1:
        raise InputError(f"its variable {_DESCRIPTION} is not a text; save the result again")
    header = parse(str(text.item()))
    columns = {}
    for entry in header["columns"]:
        values = content.get(entry.get("variable", entry["name"]))
        if values is None:
            raise InputError(f"column {entry['name']!r} is missing: the file is truncated or was changed")
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
            raise InputError(f"column {entry['name']!r} does not hold real numbers; save the result again")
        columns[entry["name"]] = values.reshape(-1)
    return columns, header


def variables(path: Path) -> dict[str, Any]:
    """All variables of a MAT file up to version 7.2, as scipy gives them; InputError for any other file."""
    from scipy.io import loadmat

    try:
        return dict(loadmat(path, appendmat=False, squeeze_me=False, struct_as_record=True))
    except NotImplementedError as error:
        raise InputError("it is a MAT file of version 7.3; save it with -v7") from error
    except OSError:
        raise
    except Exception as error:  # scipy raises whatever its decoder trips over: half a dozen types on bad bytes
        raise InputError(f"it is not a MAT file, or is truncated ({error}); take another copy") from error


def _vectors(content: dict[str, Any]) -> dict[str, np.ndarray]:
    """The variables that are real vectors, by name."""
    return {
        name: values.reshape(-1)
        for name, values in content.items()
        if isinstance(values, np.ndarray) and values.dtype.kind in "fiu" and values.size == max(values.shape, default=0)
    }
