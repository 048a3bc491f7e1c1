"""What every saved result says about itself, as one JSON object: its columns, units, types and description."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import DESCRIPTION, allow

if TYPE_CHECKING:
    from rds.results.result import Result

FORMAT = "rds result"
VERSION = 1
_TYPES = {"float64": np.float64, "int64": np.int64}


class Contents(NamedTuple):
    """What a result is made of, as `rds.results.result.Result` takes it."""

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    meta: Mapping[str, Any]


def describe(result: Result) -> dict[str, Any]:
    """The header of `result`: format, version, rows, columns with unit and type, meta."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "rows": len(result),
        "columns": [
            {"name": name, "unit": result.units[name], "type": str(values.dtype)}
            for name, values in result.columns.items()
        ],
        "meta": result.meta,
    }


def parse(text: str | bytes) -> dict[str, Any]:
    """The header in a JSON text; InputError says what is wrong with it."""
    allow(len(text), DESCRIPTION, f"its description has {len(text)} characters", "save the result again")
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"its description is not valid JSON ({error}); save the result again") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(f"its description is not that of a result (format is not {FORMAT!r})")
    if not isinstance(header.get("version"), int) or header["version"] > VERSION:
        what = f"it is in version {header.get('version')!r} of the format, and this rds reads up to {VERSION}"
        raise InputError(f"{what}; open it with a newer rds")
    columns = header.get("columns")
    if not isinstance(columns, list) or not all(_is_column(entry) for entry in columns):
        raise InputError("its description lists no columns with name, unit and type; save the result again")
    if not isinstance(header.get("rows"), int) or not isinstance(header.get("meta"), dict):
        raise InputError("its description lacks rows or meta; save the result again")
    return header


def _is_column(entry: Any) -> bool:
    return (
        isinstance(entry, dict)
        and isinstance(entry.get("name"), str)
        and isinstance(entry.get("unit"), str)
        and entry.get("type") in _TYPES
    )


def assemble(columns: Mapping[str, np.ndarray], header: dict[str, Any]) -> Contents:
    """The result that `header` describes, from the `columns` found; InputError where they do not agree."""
    names = [entry["name"] for entry in header["columns"]]
    missing = [name for name in names if name not in columns]
    if missing:
        raise InputError(f"column {missing[0]!r} is missing; the file holds {', '.join(columns) or 'none'}")
    extra = [name for name in columns if name not in names]
    if extra:
        raise InputError(f"column {extra[0]!r} is not in its description; save the result again")
    for name in names:
        if len(columns[name]) != header["rows"]:
            raise InputError(
                f"column {name!r} has {len(columns[name])} samples where {header['rows']} were saved: "
                "the file is truncated or was changed; take another copy"
            )
    typed = {e["name"]: np.asarray(columns[e["name"]]).astype(_TYPES[e["type"]], copy=False) for e in header["columns"]}
    return Contents(typed, {entry["name"]: entry["unit"] for entry in header["columns"]}, header["meta"])
