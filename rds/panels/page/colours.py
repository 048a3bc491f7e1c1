"""The page's colours: as the browser, or JupyterLab around it, prefers them, until somebody presses the Dark button."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from rds.panels.kit.static_files import static


class Colours(anywidget.AnyWidget):
    """Invisible; `button` is for the user, `show(dark)` is called at each change, `dark` says what is shown."""

    _esm = traitlets.Unicode().tag(sync=True)
    dark = traitlets.Bool(False).tag(sync=True)

    def __init__(self, show: Callable[[bool], None]):
        super().__init__(_esm=static(__file__, "colours.js"))
        self._show = show
        self._preferred = False  # what the browser said last
        self.button = widgets.ToggleButton(description="Dark", tooltip="Dark or light colours", value=False)
        self.button.layout.width = "auto"
        self._chosen = False
        self.button.observe(self._pressed, "value")
        self.on_msg(self._said)

    @property
    def name(self) -> str:
        """Of what is shown, as help pages call it."""
        return "dark" if self.dark else "light"

    def _pressed(self, change: Any) -> None:
        self._chosen = self._chosen or change["new"] != self._preferred
        self.dark = change["new"]
        self._show(self.dark)

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """What the browser prefers. Anything else does nothing."""
        if isinstance(content, dict) and content.get("kind") == "prefers" and isinstance(content.get("dark"), bool):
            self._preferred = content["dark"]
            if not self._chosen:
                self.button.value = self._preferred
