"""The slider of the feed override: more of it, while something moves, is an order that may come late."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static


class OverrideSlider(anywidget.AnyWidget):
    """`on_word(percent, ordered)` hears what is asked for; `ordered` is whether presence.js has let it go.

    The slider shows `value`, in per cent, which whoever hears sets. While it `moves`, more than that is only ordered.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    value = traitlets.Float(100.0).tag(sync=True)
    moves = traitlets.Bool(False).tag(sync=True)
    disabled = traitlets.Bool(False).tag(sync=True)
    tip = traitlets.Unicode("").tag(sync=True)

    def __init__(self, on_word: Callable[[float, bool], None], **options: Any):
        super().__init__(_esm=static(__file__, "override.js"), **options)
        self._on_word = on_word
        self.on_msg(self._told)

    def _told(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than a finite number of per cent changes nothing."""
        if not isinstance(content, dict) or content.get("kind") != "set":
            return
        percent, number = content.get("percent"), content.get("number")
        if isinstance(percent, int | float) and not isinstance(percent, bool) and math.isfinite(percent):
            self._on_word(float(percent), content.get("ordered") is True)
        self.send({"kind": "heard", "number": number})
