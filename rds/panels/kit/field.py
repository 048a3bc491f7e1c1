"""A field on the page: label with unit, control, tooltip, and beside it the reason why a value was refused."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.kit.html import Html
from rds.panels.kit.slider import Slider
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Flag, Number, Several, Text

_BUTTONS = 4  # as many options or fewer are all in sight; more are a list


class FieldView(widgets.VBox):
    """One field of `choices`, kept equal to it. A value that will not do stays in sight with the reason under it."""

    def __init__(
        self,
        choices: Choices,
        name: str,
        *,
        buttons: bool | None = None,
        disabled: bool = False,
        slider: bool = False,
    ):
        """`buttons` shows a choice as buttons or (False) as a list; `slider` adds one to a number."""
        super().__init__()
        self.add_class("rds-field")
        self.add_class(f"rds-field-{type(choices.fields[name]).__name__.lower()}")
        self._choices, self._name = choices, name
        self._buttons = buttons
        self._refusal = Html("")
        self._refusal.add_class("rds-refusal")
        self._loading = self._marked = False
        self._end = choices.watch(self._changed)
        self._disabled = disabled
        self._slider = Slider(self._slid) if slider else None
        self._shown: Field | None = None
        self._build()

    @property
    def field(self) -> Field:
        """The field that it shows."""
        return self._choices.fields[self._name]

    @property
    def refused(self) -> bool:
        """Whether what stands in it will not do."""
        return bool(self._refusal.value) and not self._marked

    def mark(self, sentence: str) -> None:
        """Say under the field what is wrong with its value beside those of others; empty: nothing is."""
        if not self.refused:
            self._refuse(sentence, marked=True)

    @property
    def disabled(self) -> bool:
        """Whether it can be changed."""
        return self._disabled

    @disabled.setter
    def disabled(self, off: bool) -> None:
        self._disabled = off
        self.control.disabled = off
        if self._slider is not None:
            self._slider.disabled = off

    def close(self) -> None:
        """No longer watch the choices."""
        self._end()
        if self._slider is not None:
            self._slider.close()
        super().close()

    def _build(self) -> None:
        self._shown = field = self.field
        unit = f" [{field.unit}]" if isinstance(field, Number) and field.unit else ""
        tip = field.tooltip + (f" ({field.range})" if isinstance(field, Number) else "")
        label = "" if isinstance(field, Flag) else f'<label title="{escape(tip)}">{escape(field.label + unit)}</label>'
        self._label = Html(label)
        self._label.add_class("rds-label")
        self.control = self._control(field, tip)
        self.control.disabled = self._disabled
        self.control.observe(self._typed, "value")
        self._refusal.value = ""
        beside: list[Any] = [self.control, self._refusal]
        if self._slider is not None and isinstance(field, Number):
            self._slider.show(field, self._choices[self._name])
            self._slider.disabled = self._disabled
            beside.insert(1, self._slider)
        self.children = [self._label, *beside] if label else beside

    def _control(self, field: Field, tip: str) -> Any:
        value = self._choices[self._name]
        if isinstance(field, Number):
            return widgets.Text(_text(value), continuous_update=False, tooltip=tip, placeholder=_placeholder(field))
        if isinstance(field, Choice):
            pairs = [(words, key) for key, words in field.options.items()]
            if self._buttons if self._buttons is not None else len(pairs) <= _BUTTONS:
                return widgets.ToggleButtons(options=pairs, value=value, tooltips=[tip] * len(pairs), tooltip=tip)
            return widgets.Dropdown(options=pairs, value=value, tooltip=tip)
        if isinstance(field, Flag):
            return widgets.Checkbox(value, description=field.label, indent=False, tooltip=tip)
        if isinstance(field, Several):
            pairs = [(words, key) for key, words in field.options.items()]
            return widgets.SelectMultiple(options=pairs, value=tuple(value), rows=min(len(pairs), 8), tooltip=tip)
        assert isinstance(field, Text)
        return widgets.Text(value, continuous_update=False, tooltip=tip, placeholder=field.placeholder)

    def _typed(self, change: Any) -> None:
        if not self._loading:
            self._set(change["new"])

    def _slid(self, value: float) -> None:
        if not self._disabled:
            self._set(round(value) if isinstance(self.field, Number) and self.field.whole else value)

    def _set(self, value: Any) -> None:
        try:
            self._choices.set(self._name, list(value) if isinstance(value, tuple) else value)
            self._refuse("")
        except InputError as error:
            self._refuse(str(error))

    def _refuse(self, sentence: str, marked: bool = False) -> None:
        self._marked = marked
        self._refusal.value = f'<span role="alert">✖ {escape(sentence)}</span>' if sentence else ""
        (self.add_class if sentence else self.remove_class)("rds-refused")

    def _changed(self, name: str) -> None:
        if name != self._name or self._name not in self._choices:
            return
        if self.field is not self._shown:
            self._build()
            return
        value = self._choices[name]
        if self._slider is not None and isinstance(self.field, Number):
            self._slider.show(self.field, value)
        wanted = _text(value) if isinstance(self.field, Number) else tuple(value) if isinstance(value, list) else value
        self._refuse("")
        if self.control.value != wanted:
            self._loading = True
            try:
                self.control.value = wanted
            finally:
                self._loading = False


def _text(value: Any) -> str:
    return "" if value is None else f"{value:.10g}"


def _placeholder(field: Number) -> str:
    return field.when_empty if field.optional else field.range


def check_mended(views: Iterable[FieldView]) -> None:
    """InputError that names those in sight with a refused value: what holds is not what stands there."""
    refused = [view.field.label for view in views if view.refused and view.layout.display != "none"]
    if refused:
        raise InputError(f"first mend what is refused: {', '.join(refused)}")


def field_group(choices: Choices, names: list[str]) -> widgets.VBox:
    """Fields that belong together."""
    group = widgets.VBox([FieldView(choices, name) for name in names])
    group.add_class("rds-group")
    return group
