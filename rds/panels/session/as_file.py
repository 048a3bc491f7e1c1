"""The choices of a panel as what a user could have written: the experiment's file, and the same in Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.toml_text import toml_text

_UNITS = {"duration": "s", "sample_period": "s"}


def as_toml(table: Mapping[str, Any]) -> str:
    """The experiment as the text of a TOML file, which `rds run` takes from the session's folder."""
    return toml_text(table, "An experiment; run it with: rds run FILE")


def as_python(table: Mapping[str, Any]) -> str:
    """The experiment as Python, to be run in the session's folder."""
    lines = []
    for key, value in table.items():
        unit = f"  # {_UNITS[key]}" if key in _UNITS else ""
        lines.append(f"    {key}={_python(value)},{unit}")
    body = "\n".join(lines)
    return f"import rds\n\nexperiment = rds.Experiment(\n{body}\n)\nresult = experiment.run()\nprint(result.metrics)\n"


def write_toml(table: Mapping[str, Any], path: Path) -> Path:
    """Write the experiment's file; InputError if there is a file of that name, or it cannot be written."""
    if path.suffix != ".toml":
        raise InputError(f"an experiment's file ends with .toml; {path.name!r} does not")
    if path.exists():
        raise InputError("there is such a file already; choose another name", str(path))
    write_whole(path, as_toml(table).encode())
    return path


def _python(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f'"{key}": {_python(inner)}' for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_python, value)) + "]"
    return (
        f'"{value}"' if isinstance(value, str) and value.isprintable() and not set(value) & set('"\\') else repr(value)
    )
