"""The texts of the panels in other languages: a file each (de.toml), whose left sides are all texts in English."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from rds.core.toml_file import read_own_toml

_FOLDER = Path(__file__).parent
ENGLISH = "English"  # of the panels themselves


@cache
def languages() -> dict[str, str]:
    """The languages by the names of their files, as each calls itself."""
    return {path.stem: str(_read(path)["language"]) for path in sorted(_FOLDER.glob("*.toml"))}


@cache
def texts(language: str) -> dict[str, str]:
    """The texts of a language by the English ones, for static/texts.js; none for English ("")."""
    if not language:
        return {}
    found = _read(_FOLDER / f"{language}.toml")
    return {text: text for text in found["same"]} | dict(found["texts"])


def _read(path: Path) -> dict[str, Any]:
    return read_own_toml(path)
