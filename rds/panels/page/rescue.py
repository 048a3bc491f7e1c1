"""The page's way around its own kernel, which a single call of a student's code may hold (static/rescue.js)."""

from __future__ import annotations

from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static


class Rescue(anywidget.AnyWidget):
    """Hidden while the kernel answers the page, once a second; else what it is at, and a button that ends it.

    The emergency stop goes to the page's server as well, with `channels`: those of the built-in bus beside the
    machine's own. Only on the page of `rds app`: JupyterLab has buttons of its own for its kernels.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    channels: Any = traitlets.List([]).tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=static(__file__, "rescue.js"), _css=static(__file__, "rescue.css"))
        self.on_msg(self._asked)

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the question whether it is there does nothing."""
        if content == {"kind": "beat"}:
            self.send({"kind": "beat"})
