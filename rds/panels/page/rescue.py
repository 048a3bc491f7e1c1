"""The page's way around its own kernel, which a single call of a student's code may hold (static/rescue.js)."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets

_STATIC = Path(__file__).parent / "static"


@cache
def _static(ending: str) -> str:
    return (_STATIC / f"rescue.{ending}").read_text(encoding="utf-8")


class Rescue(anywidget.AnyWidget):
    """Hidden while the kernel answers the page, once a second; else what it is at, and a button that ends it.

    The emergency stop goes to the page's server as well, with `channels`: those of the built-in bus beside the
    machine's own. Only on the page of `rds app`: JupyterLab has buttons of its own for its kernels.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    channels: Any = traitlets.List([]).tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=_static("js"), _css=_static("css"))
        self.on_msg(self._asked)

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the question whether it is there does nothing."""
        if content == {"kind": "beat"}:
            self.send({"kind": "beat"})
