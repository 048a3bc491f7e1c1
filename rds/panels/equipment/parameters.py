"""The one box of a controller's parameters: at rest they are the next run's, in a run they are live."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.equipment.state import Equipment
from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView
from rds.panels.kit.layout import fields_group
from rds.panels.kit.notice import Notice
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Number
from rds.panels.session.live_values import LiveValues

_MOST_UNDONE = 100
_LIVE = "Parameters, live: Enter sends"


class FoldedFields:
    """Fields that most leave alone, folded away; the title says how many there are, and how many were changed."""

    def __init__(self, title: str):
        self._title = title
        self.box = box_of_fields()
        self.widget = widgets.Accordion([self.box], titles=(title,), selected_index=None)
        self.widget.add_class("rds-folded")

    def show(self, views: Sequence[FieldView], changed: int) -> None:
        """Show these, if there are any."""
        fill(self.box, views)
        self.entitle(f"{self._title} ({len(views)}{f', {changed} changed' if changed else ''})")
        self.widget.layout.display = "" if views else "none"

    def entitle(self, title: str) -> None:
        """Another title."""
        if self.widget.titles != (title,):
            self.widget.titles = (title,)


class Parameters(FoldedFields):
    """`lock()` when a run begins, `show_live(values)` where its values can be changed, `rest()` when it is over."""

    def __init__(self, equipment: Equipment):
        super().__init__("Parameters")
        self._equipment = equipment
        self._resting: Sequence[FieldView] = ()
        self._live: list[FieldView] = []
        self._was_open: int | None = None
        self._locked = False
        self._history = _History(equipment.choices, lambda name: name in equipment.parameters)
        self._end: Callable[[], None] = lambda: None
        self._live_history: _History | None = None
        self._notice = Notice()
        tip = "Take back the last change of a parameter; in a run the old value is sent"
        self.undo_button = button("Undo", tip, self._undo, self._notice)
        below = widgets.VBox([self.box, self.undo_button, self._notice])
        self.widget.children = [below]
        self._enable()
        equipment.choices.watch(lambda name: self._enable())

    def show(self, views: Sequence[FieldView], changed: int = 0) -> None:
        """The parameters at rest; while a run goes on, they come into sight after it."""
        self._resting = views
        if not self._live:
            super().show(views, count_changed(self._equipment.choices, self._equipment.parameters))
            for view in views:
                view.disabled = self._locked

    def lock(self) -> None:
        """A run has begun: what is changed now would not be in it."""
        self._locked = True
        self.show(self._resting)
        self._enable()

    def show_live(self, values: LiveValues, is_own: bool) -> None:
        """The live values of a run; of one that this panel began (`is_own`), what is changed is the next run's, too."""
        chosen = self._equipment.words()

        def keep(name: str) -> None:
            choices, field = self._equipment.choices, values.at_rest(name, self._equipment.parameters)
            same = is_own and self._equipment.words() == chosen
            if same and field is not None and isinstance(choices.fields[field], Number):
                choices.set(field, values[name])

        self._end = values.watch(keep)
        self._live_history = _History(values, lambda name: True, self._enable)
        self._live = [FieldView(values, name, slider=True) for name in values.fields]
        fill(self.box, self._live)
        self.entitle(_LIVE)
        self.widget.layout.display = ""
        self._was_open, self.widget.selected_index = self.widget.selected_index, 0
        self.box.add_class("rds-live-values")
        self._enable()

    def rest(self) -> None:
        """The run is over."""
        self._locked = False
        self._end()
        live, self._live, self._live_history = self._live, [], None
        if live:
            self.box.remove_class("rds-live-values")
            self.widget.selected_index = self._was_open
        self.show(self._resting)
        for view in live:
            view.close()
        self._enable()

    def _undo(self) -> None:
        self._notice.clear()
        (self._live_history or self._history).undo()
        self._enable()

    def _enable(self) -> None:
        history = self._live_history or (None if self._locked else self._history)
        self.undo_button.disabled = history is None or not history.changes


class _History:
    """The changes of some choices, so that the last one can be taken back."""

    def __init__(self, choices: Choices, of: Callable[[str], bool], told: Callable[[], None] = lambda: None):
        self._choices, self._of, self._told = choices, of, told
        self._values = choices.values()
        self.changes: list[tuple[str, Any]] = []  # name, and the value before
        choices.watch(self._changed)

    def undo(self) -> None:
        """Take the last change back. InputError where the loop will not have the old value."""
        name, value = self.changes.pop()
        if name not in self._choices:
            raise InputError("the changed value belongs to a choice that is no longer made; choose it again first")
        count = len(self.changes)
        self._choices.set(name, value)
        del self.changes[count:]

    def _changed(self, name: str) -> None:
        values = self._choices.values()
        if name in values and name in self._values and self._of(name) and values[name] != self._values[name]:
            self.changes = [*self.changes, (name, self._values[name])][-_MOST_UNDONE:]
        self.changes = [each for each in self.changes if each[0] in values]  # what is chosen has other parameters
        self._values = values
        self._told()


def count_changed(choices: Choices, names: Iterable[str]) -> int:
    """How many of these are not at their defaults."""
    return sum(choices[name] != choices.fields[name].default for name in names)


def box_of_fields() -> widgets.Box:
    """An empty box for fields, out of sight."""
    box = fields_group([])
    box.layout.display = "none"
    return box


def fill(box: widgets.Box, views: Iterable[widgets.Widget]) -> None:
    """Show these in a box, which is out of sight where there are none."""
    children = tuple(views)
    if box.children != children:
        box.children = children
        box.layout.display = "" if children else "none"
