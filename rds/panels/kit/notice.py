"""One line that says what happened: a note, a warning or an error, told by a sign and not by colour alone."""

from __future__ import annotations

from html import escape

from rds.panels.kit.field_names import in_fields
from rds.panels.kit.html import Html

_SIGNS = {"note": "ℹ", "good": "✔", "warning": "⚠", "error": "✖"}


class Notice(Html):
    """Empty until something is said."""

    def __init__(self) -> None:
        super().__init__("")
        self._said = ""
        self.add_class("rds-notice")

    def say(self, text: str, kind: str = "note", why: str = "") -> None:
        """Show `text`; kind is note, good, warning or error. Empty text shows nothing. *why?* opens the rest, `why`."""
        self._said = text
        text, why = in_fields(text), in_fields(why)
        if not text:
            self.value = ""
            return
        role = "alert" if kind == "error" else "status"
        lines = escape(text).replace("\n", "<br>")
        more = f" <details><summary>why?</summary><p>{escape(why)}</p></details>" if why else ""
        self.value = (
            f'<div class="rds-notice-{kind}" role="{role}"><b aria-hidden="true">{_SIGNS[kind]}</b> {lines}{more}</div>'
        )

    def take_back(self, text: str) -> bool:
        """Nothing to say any more, if `text` is what was said last; the answer is whether it was."""
        was_said = self._said == text
        if was_said:
            self.clear()
        return was_said

    def clear(self) -> None:
        """Nothing to say."""
        self.say("")
