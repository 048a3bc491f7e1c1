"""Says when a browser has begun to show the page: a kernel that was made ready beforehand knows nothing newer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

_MODULE = """
function render({ model, el }) {
  el.style.display = "none";
  model.send({ kind: "here" });
}
export default { render };
"""


class Presence(anywidget.AnyWidget):
    """Invisible; calls `here()` each time that a browser shows the page."""

    _esm = traitlets.Unicode(_MODULE).tag(sync=True)

    def __init__(self, here: Callable[[], None]):
        super().__init__()
        self._here = here
        self.on_msg(self._said)

    def _said(self, _: Any, content: Any, __: Any) -> None:
        if content == {"kind": "here"}:
            self._here()
