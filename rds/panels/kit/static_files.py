"""Scripts and styles of widgets: files in the folder `static` beside the module of whoever has them."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def static(module: str, *names: str) -> str:
    """The text of these files, one after the other; `module` is the `__file__` of whoever has them."""
    folder = Path(module).parent / "static"
    return "\n".join((folder / name).read_text(encoding="utf-8") for name in names)


def codemirror(module: str, name: str) -> str:
    """The script `name` below CodeMirror 6 (MIT licence, in `static/` here), which is `CM` there."""
    return f"{static(__file__, 'codemirror.min.js')}\n{static(module, name)}"
