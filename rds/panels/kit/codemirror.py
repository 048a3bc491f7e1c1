"""CodeMirror 6 (MIT licence, in `static/`), the editor under all texts that are written in the page."""

from __future__ import annotations

from functools import cache
from pathlib import Path

_LIBRARY = Path(__file__).parent / "static" / "codemirror.min.js"


@cache
def module(script: Path) -> str:
    """The script of a widget, with the library above it, as `CM`."""
    return _LIBRARY.read_text(encoding="utf-8") + "\n" + script.read_text(encoding="utf-8")
