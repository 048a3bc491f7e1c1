"""The page in another language: its texts are exchanged in the browser, wherever they come from."""

from __future__ import annotations

from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from rds.panels.kit.static_files import static
from rds.panels.session.fields import Choice
from rds.panels.session.session import Session
from rds.panels.texts import ENGLISH, languages, texts

_AS_BROWSER = "as the browser"


class Language(anywidget.AnyWidget):
    """Invisible; `choice` is for the user. Begins with the language of the browser, where there is a file for it."""

    _esm = traitlets.Unicode().tag(sync=True)
    language = traitlets.Unicode("").tag(sync=True)
    texts: Any = traitlets.Dict().tag(sync=True)

    def __init__(self, session: Session):
        super().__init__(_esm=static(__file__, "texts.js"))
        self._session = session
        known = {"en": ENGLISH} | languages()
        field = Choice("language", "Language", "of the panels", _AS_BROWSER, {_AS_BROWSER: _AS_BROWSER} | known)
        self._choices = session.choices("page", [field])
        options = [(name, code) for code, name in known.items()]
        self.choice = widgets.Dropdown(options=options, value="en", tooltip="Language of the panels")
        self.choice.add_class("rds-language")
        self.choice.observe(self._pressed, "value")
        self._choices.watch(lambda name: self._follow())
        self._preferred = "en"  # what the browser said last
        self.on_msg(self._said)
        self._follow()

    def _follow(self) -> None:
        chosen = self._choices["language"]
        self._show(self._preferred if chosen == _AS_BROWSER else chosen)

    def _show(self, code: str) -> None:
        language = self._session.language = "" if code == "en" else code
        if language != self.language:
            with self.hold_sync():
                self.texts, self.language = texts(language), language
        self.choice.value = code

    def _pressed(self, change: Any) -> None:
        if change["new"] != (self.language or "en"):
            self._choices.set("language", change["new"])

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """The languages that the browser prefers, the best first. Anything else does nothing."""
        if (
            isinstance(content, dict)
            and content.get("kind") == "prefers"
            and isinstance(content.get("languages"), list)
        ):
            short = [str(each).partition("-")[0].lower() for each in content["languages"]]
            self._preferred = next((each for each in short if each == "en" or each in languages()), "en")
            self._follow()
